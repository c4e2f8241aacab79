"""The most probable unknowns of a session, and what is known of each combination of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import chdtrc

from agonic.alignment.maths import session as kernel
from agonic.alignment.maths.session import GROUPS, SIZE, Given, Unknowns
from agonic.alignment.session import Observed, Session
from agonic.arrays import Array, Mask
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.maths.rotations.vectors import find_best_rotation

ROUNDS, STEPS = 6, 30
HOPELESS = 1e4
"""Mean square of residuals, in units of the noise, that no further round will mend."""
UNDETERMINED = 1e-3
"""A combination with a standard error above this share of the field (206″) is not known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """The unknowns, and the information on them, in units that all move the field by one nT.

    `groups` are those that were free; `free` (18,) marks them; `information` (18, 18) is that of
    the observations, `prior` (18,) that of what was known before; `chi2` and `freedom` tell
    whether the residuals are as large as they should be.
    """

    unknowns: Unknowns
    given: Given
    groups: tuple[str, ...]
    free: Mask
    information: Array
    prior: Array
    magnitude: float
    chi2: float
    freedom: int
    iterations: int
    converged: bool

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

    @property
    def known(self) -> Array:
        """Information of observations and prior on the free unknowns, per nT², (m, m)."""
        units = kernel.find_unit_sizes(self.magnitude)[self.free]
        whole = self.information + np.diag(self.prior)
        return np.asarray(whole[np.ix_(self.free, self.free)] / np.outer(units, units))

    @property
    def covariance(self) -> Array:
        """Of all unknowns (18, 18), rad and nT, 0 where nothing was solved for."""
        units = kernel.find_unit_sizes(self.magnitude)[self.free]
        whole = np.zeros((SIZE, SIZE))
        inside = self.inflation * leastsq.inverse(self.known) / np.outer(units, units)
        whole[np.ix_(self.free, self.free)] = inside
        return whole

    @property
    def combinations(self) -> tuple[Array, Array]:
        """Standard errors, nT, of the m independent combinations (columns), worst first."""
        values, vectors = np.linalg.eigh(self.known)
        whole = np.zeros((SIZE, len(values)))
        whole[self.free] = vectors
        return 1 / np.sqrt(np.maximum(values, 1e-30)), whole

    @property
    def undetermined(self) -> Array:
        """The combinations (18, j) that neither observations nor departures determine."""
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


def make_given(observed: Observed) -> Given:
    """What the kernel needs of the observations."""
    return Given(
        observed.field,
        observed.reference,
        observed.rot_cn,
        observed.star_covariance,
        observed.noise,
        observed.reference_noise,
    )


def solve_for(session: Session, observed: Observed, solve: Collection[str]) -> Solution:
    """Levenberg–Marquardt about a start that needs no guess, the rotations taken anew each round.

    Beliefs with a standard deviation (pier, axes of the reference) join as unknowns with a prior,
    so that what is uncertain about them is in every standard error.
    """
    given = make_given(observed)
    prior = _prior_information(session)
    groups = tuple(g for g in GROUPS if g in solve or prior[GROUPS[g]].any())
    free = np.zeros(SIZE, dtype=bool)
    for group in groups:
        free[GROUPS[group]] = True
    at = _start(session, given, groups)
    magnitude = float(np.linalg.norm(given.reference, axis=1).mean())
    units = kernel.find_unit_sizes(magnitude)[free]
    iterations, converged, cost = 0, False, np.inf
    for _ in range(ROUNDS):
        base = at
        solution = leastsq.solve(
            partial(
                _pieces,
                base,
                given,
                kernel.compute_whitener(kernel.compute_covariance(at, given)),
                free,
                units,
            ),
            np.zeros(int(free.sum())),
            scale=1.0,
            prior=_prior(session, base, prior, free, units),
            tolerance=1e-6,
            max_iterations=STEPS,
        )
        at = base.add_step(_whole(solution.params / units, free))
        iterations += solution.iterations
        converged = solution.converged
        settled = np.abs(solution.params).max() < 1e-7 * magnitude
        hopeless = solution.cost > max(HOPELESS * len(solution.residuals), cost / 2)
        cost = solution.cost
        if settled or hopeless:
            break
    return _make_solution(session, at, given, groups, free, prior, magnitude, iterations, converged)


def _make_solution(
    session: Session,
    at: Unknowns,
    given: Given,
    groups: tuple[str, ...],
    free: Mask,
    prior: Array,
    magnitude: float,
    iterations: int,
    converged: bool,
) -> Solution:
    """The result with its test of the residuals."""
    residuals, _ = kernel.compute_residual(at, given)
    white = kernel.compute_whitener(kernel.compute_covariance(at, given)) @ residuals[:, :, None]
    departures = _departure(session, at) * np.sqrt(prior)
    count = 3 * len(residuals) + int((prior[free] > 0).sum()) - int(free.sum())
    return Solution(
        unknowns=at,
        given=given,
        groups=groups,
        free=free,
        information=kernel.compute_information(at, given),
        prior=prior,
        magnitude=magnitude,
        chi2=float((white**2).sum() + (departures**2).sum()),
        freedom=count,
        iterations=iterations,
        converged=converged,
    )


def _start(session: Session, given: Given, groups: tuple[str, ...]) -> Unknowns:
    """The rotation that fits best without anything else; a bias is taken out as the mean."""
    at = kernel.start_unknowns()._replace(
        offset=np.asarray(session.pier.difference, dtype=np.float64)
    )
    expected, field = kernel.predict_field_c(at, given), given.field
    if "bias" in groups and len(field) > 3:
        expected, field = expected - expected.mean(axis=0), field - field.mean(axis=0)
    return at._replace(rot_mc=find_best_rotation(expected, field))


def _pieces(
    base: Unknowns,
    given: Given,
    white: Array,
    free: Mask,
    units: Array,
    params: Array,
) -> Iterable[tuple[Array, Array]]:
    """Whitened residuals and their Jacobian by the free unknowns, in nT of field moved."""
    at = base.add_step(_whole(params / units, free))
    residuals, jacobian = kernel.compute_residual(at, given)
    scaled = jacobian[:, :, free] / units
    yield (white @ residuals[:, :, None]).ravel(), (white @ scaled).reshape(-1, int(free.sum()))


def _whole(step: Array, free: Mask) -> Array:
    whole = np.zeros(SIZE)
    whole[free] = step
    return whole


def _prior_information(session: Session) -> Array:
    """Information (18,) of the prior: pier and the reference's axes."""
    prior = np.zeros(SIZE)
    if session.pier.sd:
        prior[GROUPS["pier"]] = 1 / session.pier.sd**2
    if session.reference_sd_arcsec:
        prior[GROUPS["reference"]] = 1 / (session.reference_sd_arcsec * ARCSEC_RAD) ** 2
    return prior


def _departure(session: Session, at: Unknowns) -> Array:
    """How far the unknowns (18,) are from the prior."""
    away = np.zeros(SIZE)
    away[GROUPS["pier"]] = at.offset - session.pier.difference
    away[GROUPS["reference"]] = compute_rotation_vector(at.rot_nr)
    return away


def compute_rotation_vector(matrix: Array) -> Array:
    """The rotation vector of a matrix, rad."""
    return np.asarray(Rotation.from_matrix(matrix).as_rotvec())


def _prior(
    session: Session, base: Unknowns, prior: Array, free: Mask, units: Array
) -> leastsq.Prior | None:
    """The prior, about the present base."""
    if not prior.any():
        return None
    root, away = np.sqrt(prior[free]), _departure(session, base)[free]
    jacobian = np.diag(root / units)

    def residuals(params: Array) -> tuple[Array, Array]:
        return root * (away + params / units), jacobian

    return residuals
