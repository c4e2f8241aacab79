"""Whether the orientations would tell a reference, or a clock, that is turned from north.

A wrong clock, longitude, latitude and variometer all turn the reference's axes. Where the platform
is turned about one axis only, such a turn is part of the alignment, and no residual shows it (the
external reliability of the net, in the words of geodesy).
"""

from __future__ import annotations

from collections.abc import Callable

from agonic.alignment.maths.two_frames import GROUPS, compute_turn_sd, invert
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.health import Finding, figure
from agonic.maths.rotations.frames import ARCSEC_RAD

DOUBTED_ARCSEC = 10.0
"""A turn of the reference that happens: a clock wrong by 0.7 s, a variometer by 0.003°."""
WORSE = 1.5
"""Times the stated or wanted standard error above which such a turn matters."""


def compute_sd_with_doubted_reference(fit: AlignmentFit) -> float:
    """Standard error of the worst axis, arcsec, were the reference's axes known to 10″ only."""
    prior = fit.solution.prior.copy()
    prior[GROUPS["reference"]] = 1 / (DOUBTED_ARCSEC * ARCSEC_RAD) ** 2
    return compute_turn_sd(invert(fit.solution.information, prior)) / ARCSEC_RAD


def examine_reference(
    fit: AlignmentFit, wanted_sd_arcsec: float, moves: Callable[[], str]
) -> list[Finding]:
    """A check where a small turn of the reference would move the alignment unseen.

    Nothing where the reference's axes are solved for or known to a stated standard deviation:
    then the standard error contains their turn.
    """
    if "reference" in fit.solution.groups:
        return []
    stated = max(fit.worst_sd_arcsec, wanted_sd_arcsec)
    doubted = compute_sd_with_doubted_reference(fit)
    if doubted <= WORSE * stated:
        return []
    return [
        Finding(
            "reference unchecked",
            "check",
            "these orientations do not tell whether the reference's axes and the clocks are right: "
            f"were they off by {DOUBTED_ARCSEC:g}″ (0.7 s of a clock), the alignment would be off "
            f"by up to {figure(doubted)}″, and no residual would show it",
            f"{moves()}; or state how well north and the clocks are known (axes_sd_arcsec of the "
            "reference; a second is 15″)",
        )
    ]
