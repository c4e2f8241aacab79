"""What the noise of accelerometer and gyro leaves open beyond what residuals show.

Through the low-pass the accelerometer's noise lasts for seconds, and the gyro's adds up. Both may
lie far below the noise of a reading and yet decide the result, for they turn as the vehicle turns.
With J the Jacobian, weighted, a tilt ⟨a⟩/g scatters the score by Σ ⟨J⟩⟨J⟩ᵀ var a/g², a heading
∫ω dt by Σ C Cᵀ var ω, C the sum of J from each row to the end of its stretch.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.inertial.attitude import Inertial, find_parts
from agonic.inertial.maths.low_pass import low_pass
from agonic.maths.equation.affine import split
from agonic.maths.equation.channels import Problem, compute_residuals, pieces
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.leastsq import inverse
from agonic.units import STANDARD_GRAVITY_M_S2


def add_inertial_noise(
    found: Estimate, part: Problem, time: Array, felt: Inertial, settling_s: float
) -> Estimate:
    """The estimate with a covariance that is no smaller than this noise makes it.

    Parameters: the problem of the rows that were fitted, their times (n,) and what they felt.
    """
    solution = found.solution
    known, scatter = solution.information.copy(), np.zeros_like(solution.information)
    prior = part.prior(part.soft_iron_sd)
    if prior is not None:
        jacobian = prior(solution.params)[1]
        scatter = jacobian.T @ jacobian
        known += scatter
    for channel in found.noise:
        scatter = scatter + _scatter(found, part, channel, time, felt, settling_s)
    bread = inverse(known)
    physical = bread @ scatter @ bread
    return found._replace(
        solution=solution._replace(covariance=_larger(solution.covariance, physical))
    )


def _scatter(
    found: Estimate, part: Problem, channel: str, time: Array, felt: Inertial, settling_s: float
) -> Array:
    """The scatter of the score of one channel: white, and what lasts."""
    noise, params = found.noise[channel], found.solution.params
    residuals = compute_residuals(part, channel, params)
    weight = noise.loss.curvature((residuals / noise.sd) ** 2) / noise.sd**2 / noise.correlation
    jacobian = np.concatenate([j for _, j in pieces(part, channel)(params)]) * weight[:, None]
    white = noise.sd**2 * jacobian.T @ jacobian
    if channel == "magnitude":
        return white * noise.correlation
    assert part.dip is not None
    _, matrix = split(part.basis @ params[: part.basis.shape[1]])
    gain = float(np.trace(matrix) / 3)
    horizontal, vertical = (float(np.mean(v)) for v in (part.dip.horizontal, part.dip.vertical))
    size = np.hypot(horizontal, vertical) if channel == "dip" else abs(vertical)
    lean = size / gain * felt.force_sd / STANDARD_GRAVITY_M_S2
    step = float(np.median(np.diff(time)))
    for rows in find_parts(time):
        if len(rows) > 3:
            lasting = low_pass(jacobian[rows], step, settling_s) * lean
            white = white + lasting.T @ lasting
    if channel == "azimuth" and part.relative is not None:
        turned = jacobian * (horizontal / gain * felt.rate_sd * step)
        for stretch in range(int(part.relative.stretch.max()) + 1):
            drift = np.cumsum(turned[part.relative.stretch == stretch][::-1], axis=0)
            white = white + drift.T @ drift
    return white


def _larger(first: Array, second: Array) -> Array:
    """The least covariance that is nowhere below either of the two."""
    size = np.sqrt(np.diag(first))
    values, axes = np.linalg.eigh((second - first) / np.outer(size, size))
    grown = (axes * np.maximum(values, 0.0)) @ axes.T
    return np.asarray(first + grown * np.outer(size, size))
