"""Vectors in two frames: R_mcᵀ W (raw − bias) − R_cn H (reference + offset), made small.

R_cn turns north-east-down into the platform's components (measured, by a star sensor or by circle
and levels), R_mc those into the magnetometer's (the wanted rotation), and H the reference's axes
into north, east and down. Rotations change by small rotation vectors on the left, so no angle is
ever singular. What is known of an unknown beforehand is one number, its prior information: 0 where
nothing is, infinite where it is fixed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from scipy.special import chdtrc

from agonic.arrays import Array, Mask
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.maths.rotations.vectors import find_best_rotation, skew

GROUPS = {
    "alignment": slice(0, 3),
    "reference": slice(3, 6),
    "pier": slice(6, 9),
    "bias": slice(9, 12),
    "matrix": slice(12, 18),
}
"""Where each group of unknowns stands among the eighteen."""
SIZE = 18
MAX_ROUNDS, MAX_ITERATIONS = 6, 30
UNDETERMINED = 1e-3
"""A combination with a standard error above this share of the field (206″) is not known."""
RARE = 1e-4
"""Residuals that are larger than this often by chance do not fit."""


class Unknowns(NamedTuple):
    """The two rotations, the offset of the field between the piers, bias and symmetric matrix; as
    they are where nothing is turned."""

    rot_mc: Array = np.eye(3)
    rot_nr: Array = np.eye(3)
    offset: Array = np.zeros(3)
    bias: Array = np.zeros(3)
    matrix: Array = np.eye(3)

    def add_step(self, step: Array) -> Unknowns:
        """After a step (18,): rotation vectors on the left, the others added."""
        return Unknowns(
            make_rotation(step[:3]) @ self.rot_mc,
            make_rotation(step[3:6]) @ self.rot_nr,
            self.offset + step[6:9],
            self.bias + step[9:12],
            unpack_symmetric(pack_symmetric(self.matrix) + step[12:18]),
        )

    def leave_from(self, offset: Array) -> Array:
        """Pier offset and rotation of the reference's axes, less their prior, (18,); else 0."""
        turn = compute_rotation_vector(self.rot_nr)
        return np.concatenate([np.zeros(3), turn, self.offset - offset, np.zeros(9)])


class Measured(NamedTuple):
    """Means of k orientations: fields (k, 3), attitudes (k, 3, 3), standard deviations (k,).
    `attitude_covariance` (k, 3, 3), rad², axes of the platform. `along` (k, 3), axes of the
    platform, where the field is known along one direction alone."""

    field: Array
    reference: Array
    rot_cn: Array
    attitude_covariance: Array
    noise: Array
    reference_noise: Array
    along: Array | None = None


def make_prior(
    solve: Collection[str],
    pier_sd: float | None = None,
    reference_sd_arcsec: float | Sequence[float] | None = None,
) -> Array:
    """Prior information (18,): the groups to solve for are free, all others fixed. Pier and axes of
    the reference that are known with a standard deviation join: what is uncertain about them is
    then in every standard error."""
    prior = np.full(SIZE, np.inf)
    for group in solve:
        prior[GROUPS[group]] = 0.0
    known = {"pier": (pier_sd or 0.0) + np.zeros(3)}
    known["reference"] = np.asarray(reference_sd_arcsec or 0.0) * ARCSEC_RAD + np.zeros(3)
    for group, sd in known.items():
        prior[GROUPS[group]][sd > 0] = sd[sd > 0] ** -2
    return prior


def predict_field_c(at: Unknowns, rot_cn: Array, reference: Array) -> Array:
    """The field (k, 3) in the platform's axes, by attitude and reference."""
    return np.asarray(rot_cn @ at.rot_nr @ (reference + at.offset)[:, :, None])[:, :, 0]


def predict_raw(at: Unknowns, rot_cn: Array, reference: Array) -> Array:
    """What the magnetometer reads, (k, 3): W⁻¹ R_mc of that, and its bias."""
    field = predict_field_c(at, rot_cn, reference) @ at.rot_mc.T
    return np.asarray(field @ np.linalg.inv(at.matrix).T + at.bias)


def compute_residual(at: Unknowns, measured: Measured) -> tuple[Array, Array]:
    """Residuals (k, 3), nT, axes of the platform, and the Jacobian (k, 3, 18) of a small step."""
    d = measured.field - at.bias
    own, back = d @ at.matrix, at.rot_mc.T
    beside = (measured.reference + at.offset) @ at.rot_nr.T
    jacobian = np.empty((len(d), 3, SIZE))
    jacobian[:, :, :3] = back @ skew(own)
    jacobian[:, :, 3:6] = measured.rot_cn @ skew(beside)
    jacobian[:, :, 6:9] = -measured.rot_cn @ at.rot_nr
    jacobian[:, :, 9:12] = -back @ at.matrix
    for k, unit in enumerate(np.eye(6)):
        jacobian[:, :, 12 + k] = d @ unpack_symmetric(unit) @ at.rot_mc
    field_c = predict_field_c(at, measured.rot_cn, measured.reference)
    return own @ at.rot_mc - field_c, jacobian


def compute_covariance(at: Unknowns, measured: Measured) -> Array:
    """Covariance (k, 3, 3) of the residuals, nT²: magnetometer, reference and attitude. An attitude
    that is off by the small rotation ε sees the field v off by ε × v."""
    across = skew(predict_field_c(at, measured.rot_cn, measured.reference))
    turned = across @ measured.attitude_covariance @ np.swapaxes(across, 1, 2)
    matrix = at.rot_mc.T @ at.matrix
    own = measured.noise[:, None, None] ** 2 * (matrix @ matrix.T)
    beside = measured.reference_noise[:, None, None] ** 2 * np.eye(3)
    return np.asarray(own + beside + turned)


def compute_whitener(at: Unknowns, measured: Measured) -> Array:
    """What turns residuals into independent ones of sd 1, (k, 3, 3): L⁻¹ of covariances L Lᵀ. Where
    the field is known along one direction alone it is (k, 1, 3): that direction."""
    if measured.along is not None:
        return np.asarray(measured.along / measured.noise[:, None])[:, None, :]
    return np.asarray(np.linalg.inv(np.linalg.cholesky(compute_covariance(at, measured))))


def compute_information(at: Unknowns, measured: Measured) -> Array:
    """JᵀC⁻¹J (k, 18, 18) of all unknowns, of each orientation."""
    white = compute_whitener(at, measured) @ compute_residual(at, measured)[1]
    return np.asarray(np.einsum("kir,kis->krs", white, white))


def weigh(information: Array, prior: Array, magnitude: float) -> Array:
    """Information (…, 18, 18) and that of the prior on the free unknowns, per nT², (…, m, m)."""
    free = np.isfinite(prior)
    units = find_unit_sizes(magnitude)[free]
    whole = information[..., free, :][..., free] + np.diag(prior[free])
    return np.asarray(whole / np.outer(units, units))


def invert(information: Array, prior: Array) -> Array:
    """The covariance (18, 18) that information of measurements and prior leaves, 0 where fixed."""
    free = np.isfinite(prior)
    both = np.ix_(free, free)
    covariance = np.zeros((SIZE, SIZE))
    covariance[both] = leastsq.inverse(information[both] + np.diag(prior[free]))
    return covariance


def compute_turn_sd(covariance: Array) -> float:
    """The standard error of a rotation about the axis about which it is known least, rad."""
    turn = covariance[:3, :3]
    if not np.isfinite(turn).all():
        return float("inf")
    return float(np.sqrt(np.linalg.eigvalsh(turn)[-1]))


def compute_rotation_vector(matrix: Array) -> Array:
    """The rotation vectors (…, 3) of matrices (…, 3, 3), rad."""
    return np.asarray(Rotation.from_matrix(matrix).as_rotvec())


def find_unit_sizes(magnitude: float) -> Array:
    """How many nT a unit of each unknown moves the field by, (18,): rad and matrix by its size."""
    return np.concatenate([np.full(6, magnitude), np.ones(6), np.full(6, magnitude)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """The most probable unknowns, and the information on them. `information` (18, 18) is that of
    the measurements, `prior` (18,) that of what was known before; by `chi2` and `freedom` the
    residuals are as large as they should be, or not."""

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
        fits = self.freedom <= 0 or self.p_value > 0.01
        return 1.0 if fits else max(1.0, self.chi2 / self.freedom)

    @cached_property
    def covariance(self) -> Array:
        """Of all unknowns (18, 18), rad and nT, 0 where nothing was solved for."""
        return self.inflation * invert(self.information, self.prior)

    @cached_property
    def residuals(self) -> Array:
        """(k, 3) of each orientation, nT, magnetometer axes."""
        return compute_residual(self.unknowns, self.measured)[0] @ self.unknowns.rot_mc.T

    @property
    def residuals_sd(self) -> Array:
        """What each should be, (k, 3), nT, by the stated noise."""
        rot_mc = self.unknowns.rot_mc
        spread = rot_mc @ compute_covariance(self.unknowns, self.measured) @ rot_mc.T
        return np.asarray(np.sqrt(np.diagonal(spread, axis1=1, axis2=2)))

    @property
    def combinations(self) -> tuple[Array, Array]:
        """Standard errors, nT, of the m independent combinations (columns), worst first."""
        known = weigh(self.information, self.prior, self.magnitude)
        values, vectors = np.linalg.eigh(known)
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
    rounds: int = MAX_ROUNDS,
) -> Solution:
    """Levenberg–Marquardt about a start, the rotations taken anew each round. Parameters: `prior`
    (18,) the information on the unknowns before (`make_prior`), about `offset` (3,) of the field
    between the piers and a reference that is not turned; `rot_mc` to start from, without which it
    is the one that fits best; `rounds`, the most: after one the misfit is rough."""
    before, free = np.asarray(offset, dtype=np.float64), np.isfinite(prior)
    at = Unknowns(offset=before)
    at = at._replace(rot_mc=_start(at, measured, free) if rot_mc is None else rot_mc)
    magnitude = float(np.linalg.norm(measured.reference + before, axis=1).mean())
    onto = np.diag(1 / find_unit_sizes(magnitude))[:, free]
    root, cost = np.sqrt(prior[free]), np.inf
    iterations = MAX_ITERATIONS if rounds > 1 else MAX_ITERATIONS // 10
    for _ in range(rounds):
        found = _improve(at, measured, onto, root * at.leave_from(before)[free], root, iterations)
        at = at.add_step(onto @ found.params)
        settled = np.abs(found.params).max() < 1e-7 * magnitude
        # so large a misfit no further round will improve
        hopeless = found.cost > max(1e4 * len(found.residuals), cost / 2)
        cost = found.cost
        if settled or hopeless:
            break
    residuals, _ = compute_residual(at, measured)
    white = compute_whitener(at, measured) @ residuals[:, :, None]
    departures = root * at.leave_from(before)[free]
    return Solution(
        unknowns=at,
        measured=measured,
        information=compute_information(at, measured).sum(axis=0),
        prior=prior,
        magnitude=magnitude,
        chi2=float((white**2).sum() + (departures**2).sum()),
        freedom=white.size + int((prior[free] > 0).sum()) - int(free.sum()),
    )


def _start(at: Unknowns, measured: Measured, free: Mask) -> Array:
    """The rotation that fits best without anything else; a bias is taken out as the mean."""
    expected = predict_field_c(at, measured.rot_cn, measured.reference)
    field = measured.field
    if free[GROUPS["bias"]].all() and len(field) > 3:
        expected, field = expected - expected.mean(axis=0), field - field.mean(axis=0)
    return find_best_rotation(expected, field)


def _improve(
    base: Unknowns, measured: Measured, onto: Array, away: Array, root: Array, iterations: int
) -> leastsq.Solution:
    """One round: the step in nT of field moved, which `onto` (18, m) turns into unknowns; the prior
    is one more residual, `away` at the base, in its standard deviations, its information root²."""
    white = compute_whitener(base, measured)

    def pieces(step: Array) -> Iterable[tuple[Array, Array]]:
        residuals, jacobian = compute_residual(base.add_step(onto @ step), measured)
        moved = (white @ (jacobian @ onto)).reshape(-1, len(step))
        yield (white @ residuals[:, :, None]).ravel(), moved

    slope = root * onto.sum(axis=0)
    return leastsq.solve(
        pieces,
        np.zeros(onto.shape[1]),
        scale=1.0,
        prior=lambda step: (away + slope * step, np.diag(slope)),
        tolerance=1e-6,
        max_iterations=iterations,
    )
