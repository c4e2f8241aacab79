"""What is said of terms that the model of a sensor in a known field does not have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agonic.health import Finding, figure
from agonic.thermal.maths.alternatives import FIELD, NETWORK, TEMPERATURE, Alternative

HELPS, MATTERS = 0.95, 0.8
"""The rms on unseen blocks, over that without, below which an alternative helps, and matters."""
_MOVES = {
    TEMPERATURE: "change the temperature more slowly, or calibrate in the direction of use",
    FIELD: "keep strong fields away, and step the coil as the field of use changes",
    NETWORK: "agonic fit network LOG --base CALIBRATION --inputs field,temperature, and compare",
}


def list_unseen(found: Sequence[Alternative], unseen: float) -> dict[str, float]:
    """The rms of each alternative on blocks that it has not seen, for `unseen` without any."""
    return {one.name: one.ratio * unseen for one in found}


def judge_alternatives(alternatives: Mapping[str, float], unseen: float) -> list[Finding]:
    """The alternative that foretells unseen blocks best, where it does so better than the fit.

    >>> [f.severity for f in judge_alternatives({NETWORK: 60.0, FIELD: 79.0}, 80.0)]
    ['check']
    """
    if not alternatives:
        return []
    best = min(alternatives, key=lambda name: alternatives[name])
    ratio = alternatives[best] / max(unseen, 1e-300)
    if ratio > HELPS:
        return []
    return [
        Finding(
            "not in the model",
            "check" if ratio < MATTERS else "note",
            f"with {best} {figure(alternatives[best])} nT would be left of unseen blocks, "
            f"{figure(unseen)} without",
            _MOVES[best],
        )
    ]


def describe_alternatives(alternatives: Mapping[str, float], unseen: float) -> tuple[str, ...]:
    """That nothing more would help, or by how much each alternative would."""
    if not alternatives:
        return ()
    if min(alternatives.values()) > HELPS * unseen:
        return ("neither hysteresis nor a network would foretell unseen blocks better",)
    said = ", ".join(f"{figure(left)} nT with {name}" for name, left in alternatives.items())
    return (f"on unseen blocks it would be {said}",)
