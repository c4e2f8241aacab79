"""An affine calibration taught by the field's magnitude, its dip, and its azimuth.

Which of them are known decides the fit: the magnitude alone leaves rotations open; roll and pitch
add the dip; a known heading adds the azimuth. Each is a channel with a noise of its own: errors of
roll and pitch enter the dip only and those of the heading the azimuth only, so each channel is
weighted by what its own residuals say. On-board sources of field join as terms of the bias.

Everything here works on points centred and scaled to about one, terms centred and scaled to about
one, and fields scaled to mean magnitude one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import (
    FREE,
    azimuth_residual,
    dip_residual,
    expand_covariates,
    magnitude_residual,
    model_basis,
    split,
)
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.least_median import fit_least_median_sphere
from agonic.maths.estimation.noise import Noise, estimate_noise, is_like_gaussian

_ROWS = 4096  # a block whose temporaries stay in the cache
_ENOUGH = 3000  # readings for the search; the refinement uses all
_LITTLE = 0.01  # noise over the field that leaves no doubt about a fit
TERM_SD = 0.5  # prior: one standard deviation of a source moves the bias by less than the field


class Problem(NamedTuple):
    """What is known of each reading, and what is believed before.

    `points` (n, 3), `terms` (n, k); `horizontal` and `vertical` (1,) or (n,); `down` (n, 3) in the
    axes of the corrected field, or None; `across` (n, 3) horizontal and square to the field, or
    None. `soft_iron_sd`: prior on the symmetric part of the matrix over its mean gain; `turn_sd`:
    prior on the rotation in a free matrix, rad.
    """

    points: Array
    terms: Array
    horizontal: Array
    vertical: Array
    down: Array | None
    across: Array | None
    model: str
    gauge: str
    soft_iron_sd: float | None
    turn_sd: float | None

    def subset(self, rows: Index | slice) -> Problem:
        """The same problem on some of the readings."""

        def of(values: Any) -> Any:
            return values if values is None or len(values) == 1 else values[rows]

        names = ("points", "terms", "horizontal", "vertical", "down", "across")
        return self._replace(**{name: of(getattr(self, name)) for name in names})

    @property
    def basis(self) -> Array:
        """From the parameters of the matrix model to the twelve local numbers."""
        return model_basis(self.model, self.gauge)

    @property
    def kinds(self) -> tuple[str, ...]:
        """The channels that can be had."""
        known = {
            "magnitude": True,
            "dip": self.down is not None,
            "azimuth": self.across is not None,
        }
        return tuple(kind for kind, there in known.items() if there)


def pieces(problem: Problem, kind: str, noise_sd: float = 0.0) -> leastsq.Pieces:
    """The residuals of one kind, block by block, for the solver."""
    basis = problem.basis
    m = basis.shape[1]

    def blocks(params: Array) -> Iterator[tuple[Array, Array]]:
        bias, matrix = split(basis @ params[:m])
        coefficients = params[m:].reshape(3, -1)
        for start in range(0, len(problem.points), _ROWS):
            part = problem.subset(slice(start, start + _ROWS))
            raw = part.points - part.terms @ coefficients.T
            r, jacobian = _residual(part, kind, raw, bias, matrix, noise_sd)
            added = expand_covariates(jacobian[:, :3], part.terms)
            yield r, np.concatenate([jacobian @ basis, added], axis=1)

    return blocks


def _residual(
    part: Problem, kind: str, raw: Array, bias: Array, matrix: Array, noise_sd: float
) -> tuple[Array, Array]:
    if kind == "magnitude":
        f = np.hypot(part.horizontal, part.vertical)
        return magnitude_residual(raw, bias, matrix, f, noise_sd)
    if kind == "dip":
        assert part.down is not None
        return dip_residual(raw, bias, matrix, part.down, part.horizontal, part.vertical, noise_sd)
    assert part.across is not None
    return azimuth_residual(raw, bias, matrix, part.across)


_DIAGONAL = np.eye(12)[[3, 7, 11]]
"""What takes the diagonal of the matrix out of the twelve local numbers."""


def _off_diagonal(sign: float) -> Array:
    """What takes (W_ij + sign W_ji)/2 as xy, xz, yz out of the twelve local numbers, (3, 12)."""
    rows = np.zeros((3, 12))
    for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        rows[k, 3 + 3 * i + j], rows[k, 3 + 3 * j + i] = 0.5, sign * 0.5
    return rows


def prior_of(problem: Problem, soft_iron_sd: float | None) -> leastsq.Prior:
    """Gaussian priors on soft iron, on the rotation in a free matrix, and on the terms.

    Residuals ((W_ij + W_ji)/2g − δ_ij)/sd, (W_ij − W_ji)/(2 g turn_sd), g = tr W/3, and
    coefficients over `TERM_SD`.
    """
    basis = problem.basis
    m, terms = basis.shape[1], 3 * problem.terms.shape[1]
    gauge = np.concatenate([_DIAGONAL, _off_diagonal(1.0), _off_diagonal(-1.0)])
    wanted = np.array([1.0, 1, 1, 0, 0, 0, 0, 0, 0])
    turn = problem.turn_sd if problem.gauge == FREE else None
    sds = np.concatenate([np.full(6, soft_iron_sd or np.inf), np.full(3, turn or np.inf)])
    if problem.model == "sphere":
        sds[:6] = np.inf
    shape, mean = gauge @ basis, gauge[:3].mean(axis=0) @ basis

    def prior(params: Array) -> tuple[Array, Array]:
        gain = float(mean @ params[:m])
        entries = shape @ params[:m] / gain
        jacobian = np.zeros((9 + terms, m + terms))
        jacobian[:9, :m] = (shape - np.outer(entries, mean)) / gain / sds[:, None]
        jacobian[9:, m:] = np.eye(terms) / TERM_SD
        return np.concatenate([(entries - wanted) / sds, params[m:] / TERM_SD]), jacobian

    return prior


def normals(problem: Problem, params: Array) -> Array:
    """Unit directions (n, 3) in which the residuals of the magnitude are measured."""
    blocks = [-jacobian[:, :3] for _, jacobian in pieces(problem, "magnitude")(params)]
    return np.concatenate(blocks)


def added(problem: Problem, params: Array) -> Array:
    """What the terms add to each point, (n, 3)."""
    return np.asarray(problem.terms @ params[problem.basis.shape[1] :].reshape(3, -1).T)


def turn(problem: Problem, solution: leastsq.Solution) -> tuple[Array, Array]:
    """The turn in a free matrix, (W − Wᵀ)/2g as xy xz yz, and its covariance (3, 3), rad."""
    m = problem.basis.shape[1]
    local = problem.basis @ solution.params[:m]
    onto = _off_diagonal(-1.0) / float((_DIAGONAL @ local).mean())
    reduced = onto @ problem.basis
    return onto @ local, reduced @ solution.covariance[:m, :m] @ reduced.T


class Estimate(NamedTuple):
    """The solution, and noise, residuals and weights of each channel by its kind."""

    solution: leastsq.Solution
    noise: dict[str, Noise]
    residuals: dict[str, Array]
    weights: dict[str, Array]

    @property
    def weight(self) -> Array:
        """What the robust losses left of each reading, the least of its channels."""
        return np.asarray(np.minimum.reduce(list(self.weights.values())))


def estimate(problem: Problem, *, robust: bool = True, seed: int = 0) -> Estimate:
    """The most probable parameters, how sure they are, and the noise of each channel.

    From a start on a few thousand readings the prior on soft iron is relaxed step by step; where
    not all of them agree with the minimum, other starts may find a better one. The best is refined
    on all readings.
    """
    n = len(problem.points)
    few = problem
    if n > _ENOUGH:
        rows = np.sort(np.random.default_rng(seed).choice(n, _ENOUGH, replace=False))
        few = problem.subset(rows)
    found: list[Estimate] = []
    for start in _starts(few, seed):
        found.append(refined(few, _relax(few, start, robust), robust))
        if _agreed(found[-1]):
            break
    best = min(found, key=lambda e: sum(np.log(noise.sd) for noise in e.noise.values()))
    return best if few is problem else refined(problem, best.solution.params, robust)


def _agreed(found: Estimate) -> bool:
    """Whether all readings agree with a minimum, so that another could hold for some of them only.

    None was left out or counts for less in any channel, and the magnitude, which errors of the
    attitude do not reach, is as near to that of the field as Gaussian noise lets it.
    """
    sd, m = found.noise["magnitude"].sd, len(found.solution.params)
    return bool(
        found.weight.min() == 1.0
        and sd < _LITTLE
        and is_like_gaussian(found.residuals["magnitude"], sd, m)
    )


def _starts(few: Problem, seed: int) -> Iterator[Array]:
    """Parameters to start from: the middle of the readings, and the sphere of most readings."""
    turning = np.sqrt(np.var(few.points - few.points.mean(axis=0), axis=0).sum())
    level = float(np.mean(few.horizontal))
    middle = few.points.mean(axis=0)
    if few.down is not None:
        middle = middle - few.down.mean(axis=0) * float(np.mean(few.vertical)) * turning / level
    yield _start(few, middle, level / max(turning, 1e-9))
    f = np.hypot(few.horizontal, few.vertical)
    yield _start(few, *fit_least_median_sphere(few.points, f, seed=seed))


def _start(few: Problem, bias: Array, gain: float) -> Array:
    local = np.concatenate([bias, gain * np.eye(3).ravel()])
    params = np.linalg.lstsq(few.basis, local, rcond=None)[0]
    return np.concatenate([params, np.zeros(3 * few.terms.shape[1])])


def _relax(few: Problem, params: Array, robust: bool) -> Array:
    """To the minimum with the prior on soft iron loosened step by step."""
    loss = leastsq.cauchy() if robust else leastsq.squares()
    final = few.soft_iron_sd or np.inf
    steps = [sd for sd in (0.01, 0.03, 0.1) if sd < final]
    for sd in (*steps, few.soft_iron_sd, few.soft_iron_sd):
        channels = []
        for kind in few.kinds:
            scale = leastsq.robust_scale(residuals(few, kind, params), len(params))
            channels.append(leastsq.Channel(pieces(few, kind), max(scale, 1e-9), loss))
        params = leastsq.solve_together(
            channels, params, prior=prior_of(few, sd), tolerance=0.1, max_iterations=25
        ).params
    return params


def residuals(problem: Problem, kind: str, params: Array) -> Array:
    """The residuals of one kind at given parameters, (n,)."""
    return np.concatenate([r for r, _ in pieces(problem, kind)(params)])


def refined(
    problem: Problem, params: Array, robust: bool, prior: leastsq.Prior | None = None
) -> Estimate:
    """The minimum on all readings from a near start, noise and correlation of each channel taken
    from its residuals; without a prior of its own, with that on soft iron, turn and terms."""
    prior = prior or prior_of(problem, problem.soft_iron_sd)
    seen = {kind: residuals(problem, kind, params) for kind in problem.kinds}
    for _ in range(12):
        noise = {kind: estimate_noise(r, robust, len(params)) for kind, r in seen.items()}
        sd = noise["magnitude"].sd
        channels = [
            leastsq.Channel(pieces(problem, kind, sd), *_channel(of)) for kind, of in noise.items()
        ]
        solution = leastsq.solve_together(channels, params, prior=prior, tolerance=1e-2)
        params = solution.params
        parts = np.split(solution.residuals, len(noise))
        seen = dict(zip(noise, parts, strict=True))
        found = {kind: estimate_noise(r, robust, len(params)) for kind, r in seen.items()}
        if all(found[kind].settled(noise[kind]) for kind in noise):
            break
    weights = {k: noise[k].loss.weight((r / noise[k].sd) ** 2) for k, r in seen.items()}
    return Estimate(solution, noise, seen, weights)


def _channel(noise: Noise) -> tuple[float, leastsq.Loss, float]:
    return noise.sd, noise.loss, noise.correlation
