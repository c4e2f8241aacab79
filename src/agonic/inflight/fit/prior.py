"""The prior: the ground calibration, and how far gains and terms may have moved since."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.inflight.fit.ground_errors import SHAPE, compute_ground_covariance, find_order
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.terms import Terms
from agonic.inflight.maths.residuals import Layout
from agonic.maths.equation import polynomial
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


def compute_prior_covariance(problem: Problem, terms: Terms, layout: Layout) -> Array:
    """Covariance of xx yy zz xy xz yz of the change, then of the coefficients of all terms.

    What is solved for of the matrix may have moved by `gain_sd` since the ground; all gains alike
    are free where that had no magnitude to go by (`scale_free`); terms that were asked for have the
    scales above. To that the errors add that the ground calibration states, over temperature as
    polynomials through as many temperatures of the record as they have coefficients.
    """
    asked, kb, km = problem.settings, layout.bias_terms, layout.matrix_terms
    freed = np.arange(6) < FREED[asked.solve]
    bias = np.full((3, kb), TERM_SD)
    bias[:, terms.splines + asked.temperature_degree : terms.splines + terms.degree] = 0.0
    matrix = np.full((6, km), MATRIX_TERM_SD) * freed[:, None]
    matrix[:, asked.temperature_degree : terms.matrix_degree] = 0.0
    alone = np.concatenate([np.where(freed, asked.gain_sd, 0.0), bias.ravel(), matrix.ravel()])
    covariance = np.diag(alone**2 + FIXED**2)
    if problem.ground is None:
        covariance[range(6), range(6)] = (asked.soft_iron_sd or 1 / FIXED) ** 2
        return covariance
    covariance[:6, :6] += np.outer(UNIT, UNIT) * (SCALE_SD * problem.scale_free) ** 2
    order = find_order(problem.ground)
    x = np.cos(np.pi * (np.arange(order + 1) + 0.5) / (order + 1))
    at_C = terms.centre_C + terms.half_range_C * x
    by_power = np.kron(np.linalg.inv(polynomial.powers(x, order)), np.eye(12))
    ground = by_power @ compute_ground_covariance(problem.ground, at_C) @ by_power.T
    axes, entries = np.arange(3), np.arange(6)
    of_ground, own = [entries], [entries]
    for power in range(1, order + 1):
        of_ground += [12 * power + entries, 12 * power + 9 + axes]
        own += [6 + 3 * kb + km * entries + power - 1, 6 + kb * axes + terms.splines + power - 1]
    some, here = np.concatenate(of_ground), np.concatenate(own)
    size = np.where(some % 12 < 6, 1.0, 1.0 / problem.magnitude)
    covariance[np.ix_(here, here)] += ground[np.ix_(some, some)] * np.outer(size, size)
    return covariance


def build_prior(problem: Problem, terms: Terms, layout: Layout) -> leastsq.Prior:
    """Gaussian prior on the matrix and on all terms; bias and turn are free.

    Residuals L⁻¹(S − identity, terms) over the six symmetric entries and the coefficients, LLᵀ the
    covariance of `compute_prior_covariance`; without a ground calibration of S/g, g = tr S/3.
    """
    m, c = layout.parameters, layout.constants
    shape = np.zeros((6, m))
    shape[:, :c] = SHAPE[:6, :9] @ model_basis("full", layout.gauge)[3:]
    mean = shape[:3].mean(axis=0)
    whiten = np.linalg.inv(np.linalg.cholesky(compute_prior_covariance(problem, terms, layout)))

    def residuals(params: Array) -> tuple[Array, Array]:
        gain = float(mean @ params) if problem.ground is None else 1.0
        entries = shape @ params / gain
        jacobian = np.eye(6 + m - c, m, c - 6)
        jacobian[:6] = shape / gain
        if problem.ground is None:
            jacobian[:6] -= np.outer(entries, mean) / gain
        return whiten @ np.concatenate([entries - UNIT, params[c:]]), whiten @ jacobian

    return residuals
