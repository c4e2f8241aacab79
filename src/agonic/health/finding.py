"""`Finding`: something the user should know, by name; `Judged`: a result that rests on findings."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from agonic.readable import Readable

Severity = Literal["note", "check", "refuse"]
"""A note needs no action, a check asks the user to look, a refusal forbids using the result."""


_NAMED = re.compile(r"\w+[._]\w")
_GRAVEST_FIRST: tuple[Severity, ...] = ("refuse", "check", "note")

Verdict = Literal["good", "check", "refused"]
"""What a result is worth: to be used, to be looked at, not to be used."""


def figure(value: float, digits: int = 2) -> str:
    """A number with so many significant digits, never as a power of ten.

    >>> figure(31_234.5), figure(0.00571), figure(2.0, 3)
    ('31000', '0.0057', '2')
    """
    return np.format_float_positional(
        value, precision=digits, unique=False, fractional=False, trim="-"
    )


@dataclass(frozen=True)
class Finding:
    """A named observation: what was seen, and the move that helps.

    `moments` are those at which something changed, in seconds of the log's clock, or rows where it
    has none.

    >>> Finding("static", "refuse", "the sensor did not turn", "turn it about all axes").sentence
    'the sensor did not turn; turn it about all axes'
    """

    name: str
    severity: Severity
    what: str
    move: str = ""
    moments: tuple[float, ...] = ()

    @property
    def sentence(self) -> str:
        """What was seen and what to do, in one sentence."""
        return f"{self.what}; {self.move}" if self.move else self.what


def sort_findings(findings: Iterable[Finding | None]) -> tuple[Finding, ...]:
    """Findings with refusals first and notes last, each kind in its order; None is left out.

    >>> found = (Finding("gap", "note", ""), None, Finding("drift", "check", ""))
    >>> [finding.name for finding in sort_findings(found)]
    ['drift', 'gap']
    """
    found = (finding for finding in findings if finding is not None)
    return tuple(sorted(found, key=lambda finding: _GRAVEST_FIRST.index(finding.severity)))


def verdict_of(findings: Iterable[Finding], *, failed: bool = False) -> Verdict:
    """`good`, `check` or `refused`, by the gravest of the findings; a check that failed counts as
    one to be looked at.

    >>> verdict_of([]), verdict_of([Finding("plane", "refuse", "all readings lie in a plane")])
    ('good', 'refused')
    """
    severities = {finding.severity for finding in findings}
    if "refuse" in severities:
        return "refused"
    return "check" if failed or "check" in severities else "good"


NOT_READ = "not read"
"""The finding that is said before all others: what follows does not know what the log holds."""


class Judged(Readable):
    """A result that says what it is worth: its `findings` give the verdict, its `remarks` figures.

    >>> class Result(Judged):
    ...     findings = (Finding("static", "refuse", "the sensor did not turn"),)
    ...     remarks = ("noise 12 nT",)
    >>> Result().verdict, Result().ok, Result().status
    ('refused', False, 'The sensor did not turn. Noise 12 nT.')
    """

    findings: tuple[Finding, ...]
    remarks: tuple[str, ...]

    def _say(self) -> list[str]:
        said = [f"{type(self).__name__}: {self.verdict}", *textwrap.wrap(self.status, 94)]
        calibration = getattr(self, "calibration", None)
        return [*said, *calibration._say()] if isinstance(calibration, Readable) else said

    def _say_how_good(self) -> tuple[str, ...]:
        """What is said of a result that is not refused, between what is wrong and notes."""
        return self.remarks

    @property
    def verdict(self) -> Verdict:
        """`good`, `check` or `refused`."""
        return verdict_of(self.findings)

    @property
    def ok(self) -> bool:
        """Nothing to object."""
        return self.verdict == "good"

    @property
    def status(self) -> str:
        """The result in words: what stands in the way, how good it is, what else was seen."""
        unread = [finding for finding in self.findings if finding.name == NOT_READ]
        notes = [finding for finding in self.findings if finding.severity == "note"]
        grave = [finding for finding in self.findings if finding.severity != "note"]
        before, after = (*unread, *grave), (finding for finding in notes if finding not in unread)
        return sentences(
            *(finding.sentence for finding in before),
            *self._say_how_good(),
            *(finding.sentence for finding in after),
        )


def sentences(*texts: str) -> str:
    """Texts as sentences, each with its capital and its stop."""
    return " ".join(f"{start_sentence(text)}." for text in texts)


def start_sentence(text: str) -> str:
    """A text with a capital first, unless it begins with the name of a file or a column."""
    return text if _NAMED.match(text) else text[:1].upper() + text[1:]
