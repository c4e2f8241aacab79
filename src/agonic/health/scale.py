"""Whether readings are in the unit that they claim."""

from __future__ import annotations

from agonic.health.finding import Finding, figure

GAIN = (0.5, 2.0)
"""A gain outside is no error of a sensor."""


def check_scale(gain: float, unit: str) -> Finding | None:
    """A gain far from one where both sides are in nT: a wrong unit or a wrong reference.

    >>> check_scale(100.0, "nT").what
    'readings had to be multiplied by 100 to reach the stated field'
    """
    if unit != "nT" or GAIN[0] < gain < GAIN[1]:
        return None
    return Finding(
        "scale",
        "check",
        f"readings had to be multiplied by {figure(gain)} to reach the stated field",
        "check the unit of the log and the reference magnitude",
    )
