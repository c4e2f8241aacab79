"""What is known of each reading, and the residuals that it gives: one kind is a channel.

The magnitude of the field alone leaves rotations of the matrix open; roll and pitch add the dip; a
known heading adds the azimuth, and with it the whole vector. Errors of roll and pitch enter the dip
only and those of the heading the azimuth only. Fields of sources on board join as terms of the
bias.

Everything here works on points centred and scaled to about one, terms centred and scaled to about
one, and fields scaled to mean magnitude one; whoever poses a problem puts the units back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import (
    NO_SHARE,
    SYMMETRIC,
    AttitudeShare,
    Derivatives,
    azimuth_residual,
    dip_residual,
    magnitude_residual,
    model_basis,
    split,
)
from agonic.maths.equation.inertial import (
    Relative,
    Shared,
    relative_azimuth_residual,
    shared_dip_residual,
)
from agonic.maths.equation.priors import make_prior
from agonic.maths.estimation import leastsq

_ROWS = 4096  # temporaries stay in the cache, and calls cost little beside them


class Dip(NamedTuple):
    """Down (n, 3) in the axes of the corrected field, and horizontal and vertical intensity, each
    (1,) or (n,)."""

    down: Array
    horizontal: Array
    vertical: Array


class Problem(NamedTuple):
    """Readings, what is known of the field at each, and the priors.

    `points` (n, 3); `magnitude` (1,) or (n,); `terms` (n, k) of sources on board; `dip` and
    `across` (n, 3), horizontal and square to the field, where they are known, with
    `across_weight` (n,), by how much less an azimuth scatters than a usual one. `soft_iron_sd`:
    prior on the symmetric part of the matrix over its mean gain; `turn_sd`: prior on the rotation
    in a free matrix, rad. `shared`: errors that all rows have in common, where down comes from an
    inertial unit; `relative`: what its gyro knows of the azimuth, instead of `across`. `rounding`:
    what rounding to steps scatters a reading on an axis.
    """

    points: Array
    magnitude: Array
    model: str
    soft_iron_sd: float | None
    gauge: str = SYMMETRIC
    turn_sd: float | None = None
    terms: Array | None = None
    dip: Dip | None = None
    across: Array | None = None
    across_weight: Array | None = None
    shared: Shared | None = None
    relative: Relative | None = None
    rounding: float = 0.0

    def subset(self, rows: Index | slice) -> Problem:
        """The same problem on some of the readings."""

        def some(values: Array) -> Array:
            return values if len(values) == 1 else values[rows]

        return self._replace(
            points=self.points[rows],
            magnitude=some(self.magnitude),
            terms=None if self.terms is None else self.terms[rows],
            dip=None if self.dip is None else Dip(*map(some, self.dip)),
            across=None if self.across is None else self.across[rows],
            across_weight=None if self.across_weight is None else self.across_weight[rows],
            shared=None if self.shared is None else self.shared.subset(rows),
            relative=None if self.relative is None else self.relative.subset(rows),
        )

    @property
    def basis(self) -> Array:
        """From the parameters of the matrix model to the twelve local numbers."""
        return model_basis(self.model, self.gauge)

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that can be had."""
        azimuth = self.across if self.relative is None else self.relative
        known = {"magnitude": True, "dip": self.dip, "azimuth": azimuth}
        return tuple(channel for channel, there in known.items() if there is not None)

    def prior(self, soft_iron_sd: float | None) -> leastsq.Prior | None:
        """The priors, with another standard deviation of soft iron."""
        terms = 0 if self.terms is None else self.terms.shape[1]
        return make_prior(
            self.model,
            soft_iron_sd,
            gauge=self.gauge,
            turn_sd=self.turn_sd,
            terms=terms,
            shared=self.shared_count,
        )

    def move(self, params: Array, step: Array) -> Array:
        """Parameters a step away, along lines on which the field is linear.

        field = W (raw − b − K x) is linear in W, W b and W K: where W changes by δW, the steps of b
        and K are (W + δW)⁻¹ W times as long. Gain and bias vouch for each other along such a line
        where a vehicle hardly tilts; b + δb leaves it, and the way to the minimum is then a
        hundred small steps (a retraction: Absil, Mahony & Sepulchre 2008, §4.1). By the magnitude
        alone two populations of readings lie best on an endless cylinder, to which such steps
        would lead, so there they are the plain ones.
        """
        if self.magnitude_only:
            return params + step
        basis = self.basis
        m = basis.shape[1]
        _, matrix = split(basis @ params[:m])
        bias, change = split(basis @ step[:m])
        moved, there = params + step, matrix + change
        if not np.isfinite(there).all():
            return moved  # no step: its cost is no number either
        try:
            further = np.linalg.inv(there) @ matrix - np.eye(3)
        except np.linalg.LinAlgError:
            return moved
        moved[:m] += basis[:3].T @ (further @ bias)
        if self.terms is not None:
            slopes = slice(m, m + 3 * self.terms.shape[1])
            moved[slopes] += (further @ step[slopes].reshape(3, -1)).ravel()
        return moved

    def prior_information(self, params: Array) -> Array:
        """What the priors know of the parameters, at these."""
        prior = self.prior(self.soft_iron_sd)
        if prior is None:
            return np.zeros((len(params), len(params)))
        jacobian = prior(params)[1]
        return np.asarray(jacobian.T @ jacobian)

    @property
    def shared_count(self) -> int:
        """How many unknowns there are of the errors that all rows share; they come last."""
        return 0 if self.shared is None else len(self.shared.dip_by)

    @property
    def eliminated(self) -> dict[str, int]:
        """How many unknowns of each channel were eliminated beforehand."""
        stretches = 0 if self.relative is None else int(self.relative.stretch.max()) + 1
        return {"azimuth": stretches}

    @property
    def magnitude_only(self) -> bool:
        """Whether nothing but the magnitude tells of bias and matrix, and nothing joins them."""
        return self.terms is None and len(self.channels) == 1


def pieces(
    problem: Problem, channel: str, noise_sd: float = 0.0, share: AttitudeShare = NO_SHARE
) -> leastsq.Pieces:
    """The residuals of one channel, block by block, for the solver.

    Parameters: what a reading scatters by on an axis, and which share of the channel's variance
    errors of the attitude make, for both stand in residuals and Jacobian alike.
    """
    m, k = problem.basis.shape[1], 0 if problem.terms is None else problem.terms.shape[1]
    onto, m_all = problem.basis.T, m + 3 * k

    def blocks(params: Array) -> Iterator[tuple[Array, Array]]:
        for part in _parts(problem, channel):
            r, jacobian = _residual(part, channel, params, (noise_sd, share))
            local = jacobian.T
            reduced = np.empty((len(params), len(r)))  # a row a parameter: what follows is faster
            np.matmul(onto, local[:12], out=reduced[:m])
            if part.terms is not None:
                slopes = reduced[m:m_all].reshape(3, k, -1)
                np.multiply(local[:3, None], part.terms.T, out=slopes)
            shared = m_all + len(local) - 12
            reduced[m_all:shared], reduced[shared:] = local[12:], 0.0
            yield r, reduced.T

    return blocks


def compute_residuals(
    problem: Problem, channel: str, params: Array, noise_sd: float = 0.0
) -> Array:
    """The residuals of one channel at given parameters, (n,)."""
    parts = _parts(problem, channel)
    none = (noise_sd, NO_SHARE)
    found = [_residual(part, channel, params, none, differentiate=False)[0] for part in parts]
    return np.concatenate(found) if len(found) > 1 else found[0]


def compute_gradients(problem: Problem, channel: str, params: Array) -> tuple[Array, Array]:
    """The residuals (n,) of one channel, and their derivatives by the bias (n, 3)."""
    none = (0.0, NO_SHARE)
    found = [
        _residual(part, channel, params, none, differentiate="bias")
        for part in _parts(problem, channel)
    ]
    return (
        np.concatenate([residuals for residuals, _ in found]),
        np.concatenate([jacobian[:, :3] for _, jacobian in found]),
    )


def _parts(problem: Problem, channel: str) -> Iterator[Problem]:
    """The problem in blocks of rows."""
    n = len(problem.points)
    whole = channel == "azimuth" and problem.relative is not None  # stretches stay in one piece
    if whole or n <= _ROWS:
        yield problem
        return
    for start in range(0, n, _ROWS):
        yield problem.subset(slice(start, start + _ROWS))


def _unknowns(problem: Problem, params: Array) -> Array:
    """Those of the errors that all rows share."""
    return params[len(params) - problem.shared_count :]


def field_of_terms(problem: Problem, params: Array) -> Array | float:
    """What the terms add to each point, (n, 3); zero without any."""
    if problem.terms is None:
        return 0.0
    m, k = problem.basis.shape[1], 3 * problem.terms.shape[1]
    return np.asarray(problem.terms @ params[m : m + k].reshape(3, -1).T)


def compute_distances(
    raw: Array, bias: Array, matrix: Array, magnitude: Array
) -> tuple[Array, Array]:
    """Distance of each reading from the ellipsoid and the unit normal there, (n,) and (n, 3).

    Parameters: raw (n, 3), bias (3,), matrix (3, 3), magnitude (1,) or (n,), in any units.
    """
    residuals, normals = np.empty(len(raw)), np.empty((len(raw), 3))
    for start in range(0, len(raw), _ROWS):
        rows = slice(start, start + _ROWS)
        f = magnitude if len(magnitude) == 1 else magnitude[rows]
        residuals[rows], jacobian = magnitude_residual(
            raw[rows], bias, matrix, f, differentiate="bias"
        )
        np.negative(jacobian, out=normals[rows])
    return residuals, normals


def _residual(
    part: Problem,
    channel: str,
    params: Array,
    noise: tuple[float, AttitudeShare],
    *,
    differentiate: Derivatives = True,
) -> tuple[Array, Array]:
    """Those of one channel in one block of rows, and where asked for the Jacobian."""
    noise_sd, share = noise
    bias, matrix = split(part.basis @ params[: part.basis.shape[1]])
    raw, unknowns = part.points, _unknowns(part, params)
    if part.terms is not None:
        raw = raw - field_of_terms(part, params)
    if channel == "magnitude":
        return magnitude_residual(
            raw, bias, matrix, part.magnitude, noise_sd, differentiate=differentiate
        )
    assert part.dip is not None
    down, shared, wanted = part.dip.down, part.shared, differentiate
    if channel == "dip" and shared is None:
        return dip_residual(raw, bias, matrix, *part.dip, noise_sd, share, differentiate=wanted)
    at, every = (raw, bias, matrix, down), bool(wanted)
    if channel == "dip" and shared is not None:
        level = (part.dip.horizontal, part.dip.vertical)
        felt = (shared, unknowns, noise_sd, share)
        return shared_dip_residual(*at, level, *felt, differentiate=every)
    if part.relative is not None:
        assert shared is not None
        return relative_azimuth_residual(*at, part.relative, shared, unknowns, differentiate=every)
    assert part.across is not None
    r, jacobian = azimuth_residual(
        raw, bias, matrix, part.across, part.dip, share, differentiate=wanted
    )
    weight = part.across_weight
    return (r, jacobian) if weight is None else (weight * r, weight[:, None] * jacobian)
