"""The most probable unknowns of vectors in two frames, and what is known of each combination."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from agonic.alignment.maths import two_frames as kernel
from agonic.alignment.maths.two_frames import GROUPS, SIZE, Measured, Unknowns
from agonic.arrays import Array, Mask
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.vectors import find_best_rotation

ROUNDS, STEPS = 6, 30
HOPELESS = 1e4
"""Mean square of residuals, in units of the noise, that no further round will improve."""
UNDETERMINED = 1e-3
"""A combination with a standard error above this share of the field (206″) is not known."""

RARE = 1e-4
"""Residuals that are larger than this often by chance do not fit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """The unknowns, and the information on them.

    `information` (18, 18) is that of the measurements, `prior` (18,) that of what was known before;
    `chi2` and `freedom` tell whether the residuals are as large as they should be.
    """

    unknowns: Unknowns
    measured: Measured
    information: Array
    prior: Array
    magnitude: float
    chi2: float
    freedom: int

    @property
    def free(self) -> Mask:
        """Which of the unknowns (18,) are not fixed."""
        return np.isfinite(self.prior)

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups of which all are free."""
        return tuple(group for group, rows in GROUPS.items() if self.free[rows].all())

    @property
    def p_value(self) -> float:
        """How often residuals would be at least as large by chance; 1 with no freedom left."""
        return float(chdtrc(self.freedom, self.chi2)) if self.freedom > 0 else 1.0

    @property
    def inflation(self) -> float:
        """By how much variances grow because the residuals are larger than stated."""
        if self.freedom <= 0 or self.p_value > 0.01:
            return 1.0
        return max(1.0, self.chi2 / self.freedom)

    @cached_property
    def covariance(self) -> Array:
        """Of all unknowns (18, 18), rad and nT, 0 where nothing was solved for."""
        return self.inflation * kernel.invert(self.information, self.prior)

    @cached_property
    def residuals(self) -> Array:
        """(k, 3) of each orientation, nT, magnetometer axes."""
        rot_mc = self.unknowns.rot_mc
        return kernel.compute_residual(self.unknowns, self.measured)[0] @ rot_mc.T

    @property
    def residuals_sd(self) -> Array:
        """What each should be, (k, 3), nT, by the stated noise."""
        rot_mc = self.unknowns.rot_mc
        spread = rot_mc @ kernel.compute_covariance(self.unknowns, self.measured) @ rot_mc.T
        return np.asarray(np.sqrt(np.diagonal(spread, axis1=1, axis2=2)))

    @property
    def known(self) -> Array:
        """Information of measurements and prior on the free unknowns, per nT², (m, m)."""
        return kernel.weigh(self.information, self.prior, self.magnitude)

    @property
    def combinations(self) -> tuple[Array, Array]:
        """Standard errors, nT, of the m independent combinations (columns), worst first."""
        values, vectors = np.linalg.eigh(self.known)
        whole = np.zeros((SIZE, len(values)))
        whole[self.free] = vectors
        return 1 / np.sqrt(np.maximum(values, 1e-30)), whole

    @property
    def undetermined(self) -> Array:
        """The combinations (18, j) that neither measurements nor prior determine."""
        sd, vectors = self.combinations
        return vectors[:, sd > UNDETERMINED * self.magnitude]

    @property
    def rank(self) -> int:
        """How many combinations are determined."""
        return int(self.free.sum()) - int(self.undetermined.shape[1])

    @property
    def condition(self) -> float:
        """Of the information, every unknown counted by what it moves the field by."""
        sd, _ = self.combinations
        return float((sd[0] / sd[-1]) ** 2)


def solve(
    measured: Measured,
    prior: Array,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    rot_mc: Array | None = None,
    *,
    rounds: int = ROUNDS,
) -> Solution:
    """Levenberg–Marquardt about a start, the rotations taken anew each round.

    Parameters: `prior` (18,) the information on the unknowns before (`make_prior`), about `offset`
    (3,) of the field between the piers and a reference that is not turned; `rot_mc` to start from,
    without which it is the one that fits best; `rounds`, the most: after one the misfit is told
    roughly.
    """
    prior_at = kernel.start_unknowns(offset)
    free = np.isfinite(prior)
    at = _start(prior_at, measured, free) if rot_mc is None else prior_at._replace(rot_mc=rot_mc)
    magnitude = float(np.linalg.norm(measured.reference + prior_at.offset, axis=1).mean())
    units = kernel.find_unit_sizes(magnitude)[free]
    root = np.sqrt(prior[free])
    cost = np.inf
    for _ in range(rounds):
        white = kernel.compute_whitener(at, measured)
        away = _departure(at, prior_at)[free]
        solution = leastsq.solve(
            partial(_pieces, at, measured, white, free, units),
            np.zeros(int(free.sum())),
            scale=1.0,
            prior=partial(_prior, root, away, units),
            tolerance=1e-6,
            max_iterations=STEPS if rounds > 1 else STEPS // 10,
        )
        at = at.add_step(_whole(solution.params / units, free))
        settled = np.abs(solution.params).max() < 1e-7 * magnitude
        hopeless = solution.cost > max(HOPELESS * len(solution.residuals), cost / 2)
        cost = solution.cost
        if settled or hopeless:
            break
    residuals, _ = kernel.compute_residual(at, measured)
    white = kernel.compute_whitener(at, measured) @ residuals[:, :, None]
    departures = root * _departure(at, prior_at)[free]
    return Solution(
        unknowns=at,
        measured=measured,
        information=kernel.compute_information(at, measured),
        prior=prior,
        magnitude=magnitude,
        chi2=float((white**2).sum() + (departures**2).sum()),
        freedom=white.size + int((prior[free] > 0).sum()) - int(free.sum()),
    )


def _start(at: Unknowns, measured: Measured, free: Mask) -> Unknowns:
    """The rotation that fits best without anything else; a bias is taken out as the mean."""
    expected, field = kernel.predict_field_c(at, measured), measured.field
    if free[GROUPS["bias"]].all() and len(field) > 3:
        expected, field = expected - expected.mean(axis=0), field - field.mean(axis=0)
    return at._replace(rot_mc=find_best_rotation(expected, field))


def _pieces(
    base: Unknowns, measured: Measured, white: Array, free: Mask, units: Array, params: Array
) -> Iterable[tuple[Array, Array]]:
    """Whitened residuals and their Jacobian by the free unknowns, in nT of field moved."""
    at = base.add_step(_whole(params / units, free))
    residuals, jacobian = kernel.compute_residual(at, measured)
    scaled = jacobian[:, :, free] / units
    yield (white @ residuals[:, :, None]).ravel(), (white @ scaled).reshape(-1, len(units))


def _prior(root: Array, away: Array, units: Array, params: Array) -> tuple[Array, Array]:
    """The prior as one more residual: how far from it, in its standard deviations."""
    return root * (away + params / units), np.diag(root / units)


def _whole(step: Array, free: Mask) -> Array:
    whole = np.zeros(SIZE)
    whole[free] = step
    return whole


def _departure(at: Unknowns, prior_at: Unknowns) -> Array:
    """How far pier and axes of the reference (18,) are from the prior."""
    away = np.zeros(SIZE)
    away[GROUPS["pier"]] = at.offset - prior_at.offset
    away[GROUPS["reference"]] = kernel.compute_rotation_vector(at.rot_nr)
    return away
