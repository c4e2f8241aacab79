"""What does not fit together in a session: residuals too large, or a mounting that cannot be."""

from __future__ import annotations

import numpy as np

from agonic.alignment.maths.two_frames import compute_rotation_vector
from agonic.alignment.star_sensor.likely_causes import compute_misfit, find_likely_mistakes
from agonic.alignment.star_sensor.misfit import find_explanations
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.health import Finding, figure

RARE = 1e-4
"""Residuals that are larger than this often by chance do not fit."""
FAR_FROM_NOMINAL = 4.0
"""Standard deviations of the mounting."""


def doubt(fit: AlignmentFit) -> list[Finding]:
    """Residuals too large, or an alignment far from the nominal one, and what would explain it."""
    bad = fit.solution.freedom > 0 and fit.solution.p_value < RARE
    turn = _from_nominal(fit)
    far = turn is not None and turn[0] > FAR_FROM_NOMINAL * turn[1]
    if fit.solution.freedom == 0:
        return [
            Finding(
                "no redundancy",
                "check",
                "the orientations just determine the unknowns, so nothing tells a mistake",
                "add orientations",
            )
        ]
    if not (bad or far):
        return []
    now = compute_misfit(fit.session, fit.solution)
    causes = find_likely_mistakes(fit.session, fit.solve, now)
    seen = (
        f"the residuals are {figure(fit.residual_rms, 3)} nT rms, "
        f"{figure(float(np.sqrt(fit.solution.chi2 / fit.solution.freedom)))} times what the "
        "noise explains"
        if bad
        else f"the alignment is {figure(turn[0], 3)}° from the nominal mounting"  # type: ignore[index]
    )
    if causes:
        others = [cause.words for cause in causes[1:4]]
        also = f" (as well: {'; '.join(others)})" if others else ""
        return [
            Finding(
                "session mistake",
                "refuse",
                f"{seen}; {causes[0].words} would explain it{also}",
                causes[0].move,
            )
        ]
    if bad:
        return [_misfit(fit, seen)]
    return [Finding("nominal mounting", "check", seen, "check the nominal angles and the axes")]


def _misfit(fit: AlignmentFit, seen: str) -> Finding:
    """Residuals that no usual mistake explains, with what else would."""
    found = find_explanations(fit.observed, fit.solution, fit.session.site)
    if found:
        others = " or ".join(one.words for one in found[1:])
        also = f"; so would {others}" if others else ""
        said = f"{seen}; {found[0].words} would explain it{also}"
        return Finding("session misfit", "check", said, found[0].move)
    return Finding(
        "session misfit",
        "check",
        f"{seen}; none of the usual mistakes explains it",
        "look at the residuals of each orientation; solve for the magnetometer's bias and "
        "matrix, or for the pier",
    )


def _from_nominal(fit: AlignmentFit) -> tuple[float, float] | None:
    """How far the alignment is from the nominal one, degrees, and the nominal one's sd."""
    mounting = fit.session.mounting
    if mounting is None:
        return None
    turn = compute_rotation_vector(fit.rot_mc @ mounting.rot_mc.T)
    return float(np.degrees(np.linalg.norm(turn))), mounting.sd_deg
