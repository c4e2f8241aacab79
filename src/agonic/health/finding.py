"""`Finding`: something about the data or a fit that the user should know, by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["note", "check", "refuse"]
"""A note needs no action, a check asks the user to look, a refusal forbids using the result."""


@dataclass(frozen=True)
class Finding:
    """A named observation: what was seen, and the move that helps.

    >>> Finding("static", "refuse", "the sensor did not turn", "turn it about all axes").sentence
    'the sensor did not turn; turn it about all axes'
    """

    name: str
    severity: Severity
    what: str
    move: str = ""

    @property
    def sentence(self) -> str:
        """What was seen and what to do, in one sentence."""
        return f"{self.what}; {self.move}" if self.move else self.what
