"""The prior: the ground calibration, and how far gains and terms may have moved since."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.inflight.fit.ground_errors import compute_shape_covariance
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.terms import Terms
from agonic.inflight.maths.residuals import Layout
from agonic.maths.equation.affine import model_basis
from agonic.maths.estimation import leastsq

FIXED = 1e-7
"""Standard deviation of what is not solved for, as a share of the gain: as good as fixed."""
SCALE_SD = 0.3
"""That of a scale that only a convention sets, beyond what data sheets leave of a sensitivity."""
TERM_SD = 0.5
"""Standard deviation of each term of the bias over the field."""
MATRIX_TERM_SD = 0.05
"""Standard deviation of each term of an entry of the matrix."""
UNIT = np.array([1.0, 1, 1, 0, 0, 0])
FREED = {"bias": 0, "gains": 3, "full": 6}


def compute_matrix_covariance(
    ground: Calibration, temperature_C: float, solve: str, gain_sd: float, scale_free: bool
) -> Array:
    """Covariance (6, 6) of xx yy zz xy xz yz of the change about identity.

    What the ground calibration was uncertain by, whatever is solved for, and `gain_sd`, by which
    what is solved for may have moved since. All gains alike are free where the ground had no
    magnitude to go by (`scale_free`).
    """
    moved = np.full(6, FIXED)
    moved[: FREED[solve]] = np.hypot(gain_sd, FIXED)
    alike = SCALE_SD * UNIT * scale_free
    own = compute_shape_covariance(ground, temperature_C)[:6, :6]
    return own + np.diag(moved**2) + np.outer(alike, alike)


def build_prior(problem: Problem, terms: Terms, layout: Layout) -> leastsq.Prior:
    """Gaussian prior on the matrix and on all terms; bias and turn are free.

    Residuals L⁻¹(S − identity) over the six symmetric entries with a ground calibration, LLᵀ the
    covariance of `compute_matrix_covariance`; (S/g − identity)/soft_iron_sd with g = tr S/3
    without; and coefficients over their own.
    """
    ground, asked = problem.ground, problem.settings
    m, c = layout.parameters, layout.constants
    shape = np.zeros((6, m))
    shape[:, :c] = _symmetric() @ model_basis("full", layout.gauge)
    mean = shape[:3].mean(axis=0)
    whiten = np.eye(6) / (asked.soft_iron_sd or np.inf)
    if ground is not None:
        moved = (asked.solve, asked.gain_sd, problem.scale_free)
        covariance = compute_matrix_covariance(ground, terms.centre_C, *moved)
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    matrix_term_sd = np.where(np.arange(6) < FREED[asked.solve], MATRIX_TERM_SD, FIXED)
    term_sd = np.concatenate(
        [np.full(3 * layout.bias_terms, TERM_SD), np.repeat(matrix_term_sd, layout.matrix_terms)]
    )

    def residuals(params: Array) -> tuple[Array, Array]:
        gain = 1.0 if ground is not None else float(mean @ params)
        entries = shape @ params / gain
        jacobian = np.zeros((6 + m - c, m))
        jacobian[:6] = shape / gain
        if ground is None:
            jacobian[:6] -= np.outer(entries, mean) / gain
        jacobian[:6] = whiten @ jacobian[:6]
        jacobian[6:, c:] = np.diag(1 / term_sd)
        return np.concatenate([whiten @ (entries - UNIT), params[c:] / term_sd]), jacobian

    return residuals


def _symmetric() -> Array:
    """From the twelve local numbers to xx yy zz xy xz yz of the symmetric part, (6, 12)."""
    onto = np.zeros((6, 12))
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
        onto[k, 3 + 3 * i + j] += 0.5
        onto[k, 3 + 3 * j + i] += 0.5
    return onto
