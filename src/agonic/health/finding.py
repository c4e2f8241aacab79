"""`Finding`: something the user should know, by name and moment; `Judged`: a result with such."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.readable import Readable

Severity = Literal["note", "check", "refuse"]
"""A note needs no action, a check asks the user to look, a refusal forbids using the result."""


_NAMED = re.compile(r"\w+[._]\w")
_GRAVEST_FIRST: tuple[Severity, ...] = ("refuse", "check", "note")

Verdict = Literal["good", "check", "refused"]
"""What a result is worth: to be used, to be looked at, not to be used."""


class Limit(NamedTuple):
    """Above which a number is to be looked at, refuses, or is worth a note."""

    check: float = float("inf")
    refuse: float = float("inf")
    note: float = float("inf")

    def grade(self, size: float) -> Severity | None:
        """How grave a number of this size is; one that is not known (NaN) exceeds no limit."""
        return next((one for one in _GRAVEST_FIRST if size > getattr(self, one)), None)


def figure(value: float, digits: int = 2) -> str:
    """A number with so many significant digits, never as a power of ten."""
    return np.format_float_positional(
        value, precision=digits, unique=False, fractional=False, trim="-"
    )


@dataclass(frozen=True)
class Finding:
    """A named observation: what was seen, and the move that helps.

    `moments` are those at which something changed, in seconds of the log's clock, or rows where it
    has none."""

    name: str
    severity: Severity
    what: str
    move: str = ""
    moments: tuple[float, ...] = ()

    @property
    def sentence(self) -> str:
        """What was seen and what to do, in one sentence."""
        return f"{self.what}; {self.move}" if self.move else self.what


class Number(float):
    """A number in a sentence: `{n}` has two significant digits, `{n:5}` five, `{n:.1f}` as ever."""

    def __format__(self, spec: str) -> str:
        if spec and not spec.isdecimal():
            return float(self).__format__(spec)
        return figure(self, int(spec or 2))


Told = Mapping[str, Any] | float | None
"""A value and what else stands in a sentence, by name; None where there is nothing to say."""


class Fact(NamedTuple):
    """A row of a table of facts: what `measure` finds in a subject is told where its value is above
    the limit, or whenever anything is found, with the severity that is given. It stands in braces
    in `what` and `move`."""

    name: str
    measure: Callable[..., Told]
    limit: Severity | Limit
    what: str
    move: str = ""


def find_facts(table: Iterable[Fact], *subject: object) -> Iterator[Finding]:
    """The findings of the rows of a table that are true of a subject."""
    for fact in table:
        if (finding := word_fact(fact, fact.measure(*subject))) is not None:
            yield finding


def word_fact(fact: Fact, told: Told, **more: object) -> Finding | None:
    """The finding of what the measure of a row told, if it is one; `more` words for its braces."""
    if told is None:
        return None
    words = {**(told if isinstance(told, Mapping) else {"value": told}), **more}
    limit = fact.limit
    severity = limit.grade(words["value"]) if isinstance(limit, Limit) else limit
    if severity is None:
        return None
    return word_finding(fact.name, severity, fact.what, fact.move, words)


def find_first(table: Iterable[Fact], *subject: object) -> Finding | None:
    """The finding of the first row of a table that is true of a subject."""
    return next(find_facts(table, *subject), None)


def word_finding(
    name: str, severity: Severity, what: str, move: str, words: Mapping[str, Any]
) -> Finding:
    """The finding of a row of a table, with these words in its braces."""
    said = {key: Number(one) if isinstance(one, float) else one for key, one in words.items()}
    return Finding(name, severity, what.format(**said), move.format(**said))


def sort_findings(findings: Iterable[Finding | None]) -> tuple[Finding, ...]:
    """Findings with refusals first and notes last, each kind in its order; None is left out."""
    found = (finding for finding in findings if finding is not None)
    return tuple(sorted(found, key=lambda finding: _GRAVEST_FIRST.index(finding.severity)))


def verdict_of(findings: Iterable[Finding], *, failed: bool = False) -> Verdict:
    """`good`, `check` or `refused`, by the gravest of the findings; a check that failed counts as
    one to be looked at."""
    severities = {finding.severity for finding in findings}
    if "refuse" in severities:
        return "refused"
    return "check" if failed or "check" in severities else "good"


NOT_READ = "not read"
"""The finding that is said before all others: what follows does not know what the log holds."""


class Judged(Readable):
    """A result that says what it is worth: `findings` give the verdict, `remarks` figures."""

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


MOST_MOMENTS = 6
"""Moments and stretches that are named; of more, the first or the longest."""


def describe_moments(rows: Index, time: Array | None) -> str:
    """The moments of rows (k,) in words, by `time` (n,), the log's clock."""
    if not len(rows):
        return "for all of the log but its ends"
    named = [
        f"row {row}" if time is None else f"t = {time[row]:.1f} s" for row in rows[:MOST_MOMENTS]
    ]
    if len(rows) > MOST_MOMENTS:
        return f"near {', '.join(named)} and {len(rows) - MOST_MOMENTS} more times"
    return f"near {', '.join(named[:-1])}{' and ' if len(named) > 1 else ''}{named[-1]}"


def describe_stretches(stretches: Index, time: Array | None) -> str:
    """Stretches (k, 2), first row and last, in words; the longest where there are many."""
    longest = (stretches[:, 0] - stretches[:, 1]).argsort(kind="stable")[:MOST_MOMENTS]
    named = list[str]()
    for k in sorted(longest):
        first, last = stretches[k]
        if time is None:
            ends = f"{'row ' if not named else ''}{first} to {last}"
        else:
            ends = f"{'t = ' if not named else ''}{time[first]:.1f} s to {time[last]:.1f} s"
        named.append(f"from {ends}")
    if len(stretches) > MOST_MOMENTS:
        return f"{', '.join(named)} and {len(stretches) - MOST_MOMENTS} times more"
    return ", ".join(named[:-1]) + (" and " if len(named) > 1 else "") + named[-1]
