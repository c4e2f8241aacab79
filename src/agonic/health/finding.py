"""`Finding`: something about the data or a fit that the user should know, by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Severity = Literal["note", "check", "refuse"]
"""A note needs no action, a check asks the user to look, a refusal forbids using the result."""


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
