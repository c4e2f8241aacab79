"""The sums of one pass of a magnitude fit over readings that are not kept.

What `leastsq.accumulate` adds up over the blocks of `equation.channels`, for the full model, in
one sweep over the columns; the other models are linear in it (`reduced`). Sums are kept by
stretches of time, with how they change with parameters and noise, so that what another pass would
see is known without it. Where numba is installed the sweep is compiled and lets other threads run;
without it NumPy does the same by blocks.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.ellipsoid.maths import sweep
from agonic.maths.equation.affine import magnitude_residual, model_basis, split
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import Loss, squares, tukey

Columns = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]

TUKEY = 6.0
"""The reach of `tukey`, in standard deviations."""

_ROWS = 4096
_BASIS = model_basis("full")


class Frame(NamedTuple):
    """point = (factor · reading − centre)/size, of magnitude one as in `equation.channels`."""

    centre: Array
    size: float
    factor: float = 1.0


class Assumed(NamedTuple):
    """The noise that a pass assumes: standard deviation of a residual, and whether Tukey's loss
    meets those that stand out."""

    sd: float
    robust: bool

    @property
    def loss(self) -> Loss:
        """The loss."""
        return tukey(TUKEY) if self.robust else squares()


class Sums(NamedTuple):
    """What a pass adds up, in units of the noise: `facts` holds Σρ, Σw, Σρ'', Σw²z², Σwz², the
    number of readings, how many of them weigh nothing, and the largest |z|. Of each of k stretches:
    `curved` (k, 9, 9) Σ ρ'' J Jᵀ, by which Newton's step goes; `score` (k, 9) Σ w z J; `grown`
    (k, 9) Σ ρ'' (∂z/∂ln σ) J, what the score gains for a noise greater by so much."""

    facts: Array
    curved: Array
    score: Array
    grown: Array

    @classmethod
    def empty(cls, stretches: int) -> Sums:
        """Nothing added up yet."""
        one = np.zeros((stretches, 9))
        return cls(np.zeros(8), np.zeros((stretches, 9, 9)), one, one.copy())

    def first(self, stretches: int) -> Sums:
        """The same without the stretches behind the last reading."""
        return self._replace(
            curved=self.curved[:stretches],
            score=self.score[:stretches],
            grown=self.grown[:stretches],
        )

    def with_noise(self, growth: float) -> Sums:
        """As another pass would see it, by first order, with ln σ greater by `growth`."""
        facts = self.facts.copy()
        facts[[0, 3, 4]] *= np.exp(-2.0 * growth)
        return self._replace(facts=facts, score=self.score + growth * self.grown)

    def after(self, step: Array, sd: float) -> Array:
        """The score (k, 9) after a step (9,) of the parameters, by first order."""
        return np.asarray(self.score + self.curved @ step / sd)

    def normal(self, sd: float, reduction: Array) -> leastsq.Normal:
        """The same as the solver takes it, for the model that a reduction (9, m) makes."""
        cost, weight, curvature, scatter, _, total, _, _ = self.facts.tolist()
        curved = self.curved.sum(axis=0)
        information = reduction.T @ curved @ reduction * (weight / curvature / sd**2)
        return leastsq.Normal(
            cost,
            self.score.sum(axis=0) @ reduction / sd,
            information,
            weight,
            curvature,
            scatter,
            np.empty(0),
            round(total),
        )


def reduction(model: str) -> Array:
    """The map (9, m) from a model's parameters to those of the full one.

    >>> reduction("sphere")[3:, 3].tolist()
    [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    """
    return np.asarray(np.linalg.lstsq(_BASIS, model_basis(model), rcond=None)[0].round(12))


def add(
    sums: Sums,
    stretch: int,
    columns: Columns,
    frame: Frame,
    params: Array,
    noise: Assumed,
    *,
    compiled: bool = True,
) -> None:
    """Add readings that belong to one stretch.

    Parameters: columns x, y, z (n,) of readings; params (9,) of the full model, and noise, both of
    the points; compiled asks for numba, used where it is installed.
    """
    run = (sweep.compile_sweep() if compiled else None) or _by_blocks
    run(
        *columns,
        frame.factor,
        frame.centre,
        frame.size,
        params,
        noise.sd,
        TUKEY if noise.robust else 0.0,
        sums.facts,
        sums.curved[stretch],
        sums.score[stretch],
        sums.grown[stretch],
    )


def _by_blocks(
    x: Array,
    y: Array,
    z: Array,
    factor: float,
    centre: Array,
    size: float,
    params: Array,
    sd: float,
    reach: float,
    facts: Array,
    curved: Array,
    score: Array,
    grown: Array,
) -> None:
    bias, matrix = split(_BASIS @ params)
    loss = tukey(reach) if reach else squares()
    for start in range(0, len(x), _ROWS):
        rows = slice(start, start + _ROWS)
        points = np.stack([x[rows], y[rows], z[rows]]).T * factor
        points = (points - centre) / size
        r, jacobian = magnitude_residual(points, bias, matrix, 1.0, sd)
        full = _BASIS.T @ jacobian.T
        pull = r / sd
        q = pull * pull
        weights, bends = loss.weight(q), loss.curvature(q)
        # what r is less than the distance goes with σ²: ∂z/∂ln σ = (r − 2 distance)/σ
        growing = (r - 2.0 * _find_distance(points, bias, matrix)) / sd
        scatter, power = float(weights * weights @ q), float(weights @ q)
        plain = loss.value(q).sum(), weights.sum(), bends.sum(), scatter, power, len(r)
        facts[:6] += np.array(plain)
        facts[6] += np.count_nonzero(weights == 0.0)
        facts[7] = max(facts[7], float(np.sqrt(q.max(initial=0.0))))
        bent = full * bends
        curved += bent @ full.T
        score += full @ (weights * pull)
        grown += bent @ growing


def _find_distance(points: Array, bias: Array, matrix: Array) -> Array:
    """The residual (n,) of points (n, 3) without what noise does to it: (|u| − 1)/|s|."""
    u = matrix @ (points - bias).T
    size = np.sqrt((u * u).sum(axis=0))
    return np.asarray((size - 1.0) * size / np.linalg.norm(matrix.T @ u, axis=0))
