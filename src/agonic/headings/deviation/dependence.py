"""A reference that follows the compass: one that was read off it, or estimated by it."""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc

from agonic.arrays import Array
from agonic.health import Finding, figure
from agonic.maths.rotations.deviation import DeviationSolution

ALIKE_DEG = 1e-6
ZERO_DEG = 0.5  # rms of a deviation that sights by hand do not tell from none
ZERO_LIKELY = 0.05


def find_dependence(
    rows: Array, solved: DeviationSolution, difference_deg: Array, estimated: bool
) -> Finding | None:
    """What tells that the reference is no other than the compass: no deviation, where there is one.

    Parameters: rows (n, k) of the terms and their solution; reference less compass (n,); whether
    the reference is known to be an estimate that follows a compass.
    """
    rms = float(np.sqrt(np.mean((rows @ solved.params) ** 2)))
    if estimated:
        what = "the reference is an estimate that follows a compass itself"
    elif rows.shape[1] == 1:
        return None
    elif float(np.ptp(difference_deg)) <= ALIKE_DEG:
        what = "compass and reference differ by the same on every heading, to the last digit"
    elif rms <= ZERO_DEG and _is_noise(rows, solved):
        what = f"compass and reference differ by no more than noise, {figure(rms)}° rms"
    else:
        return None
    return Finding(
        "readings alike",
        "check",
        f"{what}; where one follows the other the card says nothing",
        "take the reference from something that no magnetism moves: a surveyed line, two antennas, "
        "the sun",
    )


def _is_noise(rows: Array, solved: DeviationSolution) -> bool:
    """Whether all terms together are what noise makes of none, by F."""
    left = solved.residuals[solved.weights > 0]
    k = rows.shape[1]
    freedom = len(left) - k
    if freedom < 1:
        return False
    noise = max(float(left @ left) / freedom * solved.correlation, 1e-24)
    fitted = rows @ solved.params
    return float(fdtrc(k, freedom, fitted @ fitted / (k * noise))) > ZERO_LIKELY
