"""How the gradient of a fit with the attitude really scatters, row by row and across channels.

The solver takes the noise of a channel for equal in all rows, and that of two channels for
independent. Neither holds where one axis of the sensor is noisier than the others: its noise stands
in magnitude, dip and azimuth of a row at once, and more in some directions than in others. With
scores s_c = w z J of the channels c and their correlation lengths L,

    B = Σ_rows Σ_ab s_a s_bᵀ / max(L_a, L_b)

needs neither. It counts as far as it differs from the solver's by more than chance. A noise with a
long memory is known from few independent residuals: its scores grow by Student's t. Errors that
stand in the sensor's axes, or turn the attitude, show in all channels at once, along directions
that turn with the vehicle: what products of residuals show of them (`noise_with_memory`) takes the
place of the correlation lengths. Where they show nothing, the readings' noise has the memory in
every channel that it has in the magnitude.

Source: H. White (1980), Econometrica 48, 817; MacKinnon & White (1985) for the leverage.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.affine import correct, split
from agonic.maths.equation.channels import Problem, field_of_terms, pieces
from agonic.maths.equation.maximum_likelihood import Estimate, find_attitude_shares
from agonic.maths.estimation.leastsq import inverse
from agonic.maths.estimation.noise.few_rows import FEW, scatter_of_few
from agonic.maths.estimation.noise.noise_with_memory import STRETCHES, Stretches, find_memory
from agonic.maths.estimation.noise.student import compute_widening

_CHANCE = 1.5  # by so much more than chance do the rows' own scores differ from equal ones
_WORST_CONDITION = 1e9
_LEAST_FREEDOM = 3.0
_MOST_LEVERAGE = 0.9
_LEAST_WHITE = 0.02
_BLOCK = 4096
_GEOMETRIES = slice(0, 3), slice(3, 6), slice(6, 7)
"""Slow errors stand in the axes of the sensor, turn the attitude, or the heading alone."""


def compute_row_covariance(problem: Problem, estimate: Estimate) -> Array:
    """A⁻¹ (B + P) A⁻¹ with the information A of readings and priors together, P of the priors."""
    solution, noise = estimate.solution, estimate.noise
    n, m = len(problem.points), len(solution.params)
    if n < 2 * m or solution.condition > _WORST_CONDITION:
        return solution.covariance
    prior = problem.prior(problem.soft_iron_sd)
    by = np.zeros((0, m)) if prior is None else prior(solution.params)[1]
    root = np.asarray(np.linalg.cholesky(inverse(solution.information + by.T @ by)))
    lengths = np.array([of.correlation for of in noise.values()])
    each = -(-n // STRETCHES)
    sums = _Sums(m, lengths, _share_memory(estimate), each)
    few = np.zeros_like(root)
    for block in _blocks(problem, estimate, root, each * max(_BLOCK // each, 1)):
        sums.add(*block)
        if n <= FEW:  # one block, too short to show memory
            few = _scatter_of_few(lengths, *block[:3])
    known, scatter = by @ root, max(sums.scatter(), few, key=lambda found: float(np.trace(found)))
    return np.asarray(root @ (scatter + known.T @ known) @ root.T)


def _scatter_of_few(lengths: Array, residuals: Array, weights: Array, jacobians: Array) -> Array:
    """How the gradient scatters where rows are few, by all correlations that they leave likely."""
    roots = np.sqrt(weights)
    counted = jacobians * (roots / lengths[:, None])[..., None]
    each = zip(residuals * roots, counted, strict=True)
    return np.asarray(np.sum([scatter_of_few(*channel) for channel in each], axis=0))


class _Sums:
    """What rows add up to, in coordinates in which the fit's covariance is one: of each channel the
    information, the score's square and the weight; how scores scatter, and by how much by chance.
    """

    def __init__(self, parameters: int, lengths: Array, shared: Array, each: int) -> None:
        count, square = len(lengths), (parameters, parameters)
        self.each = each
        self.lengths, self.shared = lengths, shared
        self.information = np.zeros((count, *square))
        self.weight, self.power, self.fourth, self.lever, self.rows = np.zeros((5, count))
        self.own = np.zeros((count, *square))
        self.pairs = list(combinations(range(count), 2))
        self.crossed = np.zeros((len(self.pairs), *square))
        self.across = np.zeros(len(self.pairs))
        self.stretches: list[Stretches] = []
        self.along: list[Array] = []

    def add(self, residuals: Array, weights: Array, jacobians: Array, directions: Array) -> None:
        """Rows: residuals over their noise and weights (c, n), Jacobians (c, n, m), and the
        directions along which slow errors show, (c, n, g)."""
        scores = weights * residuals
        size = np.einsum("cnm,cnm->cn", jacobians, jacobians)
        kept = 1 - np.minimum(weights * size / self.lengths[:, None], _MOST_LEVERAGE)
        for c, j in enumerate(jacobians):
            self.information[c] += (j.T * weights[c]) @ j
            self.own[c] += (j.T * (scores[c] ** 2 / kept[c])) @ j
        self.stretches.append(self._sum_stretches(residuals, weights, jacobians, directions))
        self.along.append((weights[..., None] * directions**2).sum(axis=1))
        self.weight += weights.sum(axis=1)
        self.rows += np.count_nonzero(weights, axis=1)
        self.power += (scores**2).sum(axis=1)
        self.fourth += (scores**4).sum(axis=1)
        self.lever += ((weights > 0) * size**2).sum(axis=1)
        for k, (a, b) in enumerate(self.pairs):
            product = (jacobians[a].T * (scores[a] * scores[b])) @ jacobians[b]
            self.crossed[k] += product + product.T
            along = np.einsum("nm,nm->n", jacobians[a], jacobians[b]) ** 2
            both = (weights[a] * weights[b]) > 0
            self.across[k] += 2 * float(((size[a] * size[b] + along) * both).sum())

    def _sum_stretches(
        self, z: Array, weights: Array, jacobians: Array, directions: Array
    ) -> Stretches:
        """The rows' channels one after the other."""
        held = weights / self.lengths[:, None]
        columns = (z, jacobians, held, directions)
        seen, by, held, along = (np.moveaxis(x, 0, 1).reshape(-1, *x.shape[2:]) for x in columns)
        return Stretches.of(seen, by, held, along, self.each * len(z))

    def scatter(self) -> Array:
        """How the gradient scatters, with what lasts in products of residuals, if any does."""
        parts = zip(*self.stretches, strict=True)
        geometries = _GEOMETRIES[: len(self.lengths)]
        one = np.eye(self.own.shape[1])
        sums = Stretches(*map(np.concatenate, parts))
        memory = find_memory(sums, one, geometries)
        if memory is None:
            return self._scatter_rows(np.maximum(self.lengths, self.shared))
        along = np.sum(self.along, axis=0) / np.maximum(self.weight, 1e-300)[:, None]
        sizes = zip(geometries, memory.slow, strict=True)
        slow = np.sum([variance * along[:, at].sum(axis=1) for at, variance in sizes], axis=0)
        return self._scatter_rows(np.maximum(1.0 - slow, _LEAST_WHITE)) + memory.scatter

    def _scatter_rows(self, memory: Array) -> Array:
        """How the gradient scatters: by the rows' own scores, as far as equal ones do not explain
        it. Parameters: by how much each channel's sum scatters more than of independent rows, (c,),
        its correlation length; below one what is left of it beside slow errors."""
        rows, lengths = np.maximum(self.rows, 1.0), self.lengths
        taken = np.trace(self.information, axis1=1, axis2=2) / lengths
        freedom = np.maximum(rows / np.maximum(memory, 1.0) - taken, _LEAST_FREEDOM)
        wider = np.array([compute_widening(one) for one in freedom])
        mean, fourth = self.power / rows, self.fourth / rows
        share = self.power / np.maximum(self.weight, 1e-300) * rows / np.maximum(rows - taken, 1.0)
        per_row = wider**2 * memory / lengths**2
        equal = np.einsum("c,cij->ij", per_row * share, self.information)
        own = np.einsum("c,cij->ij", per_row, self.own)
        chance = float(np.sum((fourth - mean**2) * self.lever * per_row**2 * memory))
        for (a, b), crossed, across in zip(self.pairs, self.crossed, self.across, strict=True):
            shortest = min(memory[a], memory[b])
            per_pair = wider[a] * wider[b] * shortest / (lengths[a] * lengths[b])
            own += per_pair * crossed
            chance += mean[a] * mean[b] * across * per_pair**2 * shortest
        apart = float(np.sum((own - equal) ** 2))
        return np.asarray(own + min(_CHANCE * chance / max(apart, 1e-300), 1.0) * (equal - own))


def _share_memory(estimate: Estimate) -> Array:
    """The correlation length that noise of the readings gives each channel, (c,), by its share of
    the variance: beside errors of the attitude a dip hardly shows that the sensor's noise lasts."""
    noise = estimate.noise
    of_readings = noise["magnitude"]
    shares = [min(of_readings.sd / of.sd, 1.0) ** 2 for of in noise.values()]
    return np.asarray(1.0 + np.array(shares) * (of_readings.correlation - 1.0))


def _blocks(
    problem: Problem, estimate: Estimate, root: Array, size: int
) -> Iterator[tuple[Array, ...]]:
    """Blocks of rows: residuals over their noise and weights (c, n), Jacobians (c, n, m) in
    coordinates in which the fit's covariance is one, and directions of slow errors (c, n, g)."""
    noise, params = estimate.noise, estimate.solution.params
    shares, sd = find_attitude_shares(problem, noise, params), noise["magnitude"].sd
    for start in range(0, len(problem.points), size):
        rows = slice(start, start + size)
        part, used = problem.subset(rows), estimate.weights[rows] > 0
        residuals, weights, jacobians, directions = [], [], [], []
        turns = _find_turns(part, params)
        for channel, of in noise.items():
            found = zip(*pieces(part, channel, sd, shares[channel])(params), strict=True)
            r, jacobian = map(np.concatenate, found)
            residuals.append(r / of.sd)
            weights.append(of.loss.weight(residuals[-1] ** 2) * used)
            jacobians.append(jacobian @ root / of.sd)
            along = [jacobian[:, :3] * (sd / of.sd)]
            if turns:
                along.append(turns[channel] * (noise["dip"].sd / of.sd))
            if "azimuth" in noise:
                along.append(np.full((len(r), 1), float(channel == "azimuth")))
            directions.append(np.concatenate(along, axis=1))
        yield tuple(map(np.stack, (residuals, weights, jacobians, directions)))


def _find_turns(part: Problem, params: Array) -> dict[str, Array]:
    """The axes in the body about which an error of the attitude moves each channel, (n, 3), times
    the share of the field that it moves; nothing without a dip.

    With down d, the field's level direction m and t = d × m: the dip turns about t, and the azimuth
    about (H d − Z m)/F.
    """
    if part.dip is None:
        return {}
    bias, matrix = split(part.basis @ params[: part.basis.shape[1]])
    down, horizontal, vertical = part.dip
    field = correct(part.points - field_of_terms(part, params), bias, matrix)
    level = field - down * (field * down).sum(axis=1, keepdims=True)
    level /= np.maximum(np.sqrt((level**2).sum(axis=1, keepdims=True)), np.finfo(float).tiny)
    of_azimuth = horizontal[:, None] * down - vertical[:, None] * level
    return {
        "magnitude": np.zeros_like(down),
        "dip": np.cross(down, level),
        "azimuth": of_azimuth / np.hypot(horizontal, vertical)[:, None],
    }
