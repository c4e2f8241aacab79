"""W(T) and b(T) where the field's components are known at every reading, as in a coil.

    raw = b(x) + W(x)⁻¹ field + l dT/dt + D(t) u,   b(x) = Σ b_k xᵏ,   W(x) = Σ W_k xᵏ

The residual is in the space of the readings where their noise is, so noise does not pull the gains
towards zero. At the footpoints v = W⁻¹ field, with A = W_0⁻¹, an increment of W_k moves readings by
−A dW_k v xᵏ: so one design [1, v]·xᵏ, dT/dt, D serves all three axes, and everything that is asked
is algebra on its cross-products by blocks of time. Points are scaled to about one, as are fields.

What a model lacks in a known field: would hysteresis or a network foretell unseen readings?

Columns stand beside the design of the fit, so that every alternative is algebra on cross-products
by blocks, and no fit. Hysteresis is the play operator (backlash) of the temperature, or of the
field's components: it follows its input at a distance, and its distance tells from which side the
input came. The network has one hidden layer of fixed random weights (Huang, Zhu & Siew 2006), of
which only the output is fitted.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.estimation.noise.residuals import robust_scale

BLOCKS = 10
"""Blocks of readings, in their order, each of which a fit is tried on that has not seen it."""
_DOUBTED = 0.2  # weight of an outlier
_GROSS = 6.0  # standard deviations: what no fit foretells says nothing of either
_FIRM = 1e-12  # of a column's own square


class KnownFieldProblem(NamedTuple):
    """Points and fields (n, 3), powers of x (n, d + 1), and further columns (n, h) of every axis:
    the pace of the temperature where it is known, then what else may have been there."""

    points: Array
    fields: Array
    powers: Array
    others: Array

    @property
    def orders(self) -> int:
        """How many columns the powers have."""
        return 4 * int(self.powers.shape[1])

    def blocks(self) -> list[slice]:
        """The rows of each of `BLOCKS` blocks."""
        edges = np.linspace(0, len(self.points), BLOCKS + 1).astype(int)
        return [slice(a, b) for a, b in pairwise(edges.tolist())]

    def expand(self, footpoints: Array, rows: slice = slice(None)) -> Array:
        """The design (n, m) at footpoints (n, 3): four columns a power, then the others."""
        ones = np.concatenate([np.ones((len(footpoints), 1)), footpoints], axis=1)
        by = (self.powers[rows, :, None] * ones[:, None]).reshape(len(footpoints), -1)
        return np.concatenate([by, self.others[rows]], axis=1)


class Linearised(NamedTuple):
    """What each reading would be by a design, less its constants: design (n, m), targets (n, 3),
    residuals (n, 3)."""

    design: Array
    targets: Array
    residuals: Array

    def sum_up(self, weights: Array, blocks: list[slice], more: Array | None = None) -> Array:
        """Cross-products (blocks, …) of design, `more` columns, and targets, by weight (n,)."""
        parts = [self.design, self.targets] if more is None else [self.design, more, self.targets]
        whole = np.concatenate(parts, axis=1) * np.sqrt(weights)[:, None]
        return np.stack([whole[rows].T @ whole[rows] for rows in blocks])


def find_start(problem: KnownFieldProblem) -> tuple[Array, Array]:
    """Unknowns (m, 3) that do not change with temperature, by linear least squares, and W_0⁻¹."""
    rows = problem.expand(problem.fields)[:, :4]
    solution = np.linalg.lstsq(rows, problem.points, rcond=None)[0]
    found = np.zeros((problem.orders + problem.others.shape[1], 3))
    found[0], found[1:4] = solution[0], -np.eye(3)
    return found, np.asarray(solution[1:].T)


def make_matrices(unknowns: Array, response: Array, orders: int) -> Array:
    """W_k (d + 1, 3, 3) of unknowns (m, 3) = (b_k, −(A W_k)ᵀ, …), with A the `response` (3, 3)."""
    tilted = unknowns[:orders].reshape(-1, 4, 3)[:, 1:]
    return -np.linalg.inv(response) @ np.swapaxes(tilted, 1, 2)


def linearise(problem: KnownFieldProblem, unknowns: Array, response: Array) -> Linearised:
    """The readings about unknowns (m, 3)."""
    matrices = make_matrices(unknowns, response, problem.orders)
    each = (problem.powers @ matrices.reshape(len(matrices), 9)).reshape(-1, 3, 3)
    footpoints = np.linalg.solve(each, problem.fields[:, :, None])[:, :, 0].astype(np.float64)
    design = problem.expand(footpoints)
    moved = unknowns.copy()
    moved[: problem.orders].reshape(-1, 4, 3)[:, 1:] = 0.0  # these are in the footpoints
    residuals = problem.points - footpoints - design @ moved
    return Linearised(design, residuals + design @ unknowns, residuals)


def map_to_coefficients(response: Array, degree: int, rate: bool) -> Array:
    """From the unknowns of the axes, one axis after the other (3 m,), to the coefficients (a,) of a
    calibration: bias x y z, xx yy zz xy xz yz yx zx zy, each with its powers, then the rates."""
    p, m = degree + 1, 4 * (degree + 1) + rate
    entries = model_basis("full", FREE)[3:, 3:]  # (9 local, 9 named)
    onto = np.zeros((12 * p + 3 * rate, 3, m))
    back = -np.linalg.inv(response)
    for power in range(p):
        for axis in range(3):
            onto[axis * p + power, axis, 4 * power] = 1.0
            for j in range(3):
                local = np.zeros((3, 3))
                local[:, j] = back[:, axis]
                named = (3 + np.arange(9)) * p + power
                onto[named, axis, 4 * power + 1 + j] = local.ravel() @ entries
    if rate:
        onto[12 * p + np.arange(3), np.arange(3), -1] = 1.0
    return onto.reshape(len(onto), -1)


def predict_unseen(
    sums: Array, columns: Index, ridge: Array, gone: Array | None = None
) -> tuple[Array, Array]:
    """Unknowns (blocks, c, 3) of `columns` without each block, and the squares (blocks,) that they
    leave of it.

    Parameters: cross-products (blocks, m + 3, m + 3), the precision (c,) of each column's prior.
    """
    whole = sums.sum(axis=0)
    rest = (whole - sums)[:, columns][:, :, columns] + np.diag(ridge)
    size = np.sqrt(np.maximum(np.einsum("bii->bi", rest), 1e-300))
    scaled = rest / (size[:, :, None] * size[:, None]) + _FIRM * np.eye(len(columns))
    right = (whole - sums)[:, columns, -3:] / size[:, :, None]
    found = np.linalg.solve(scaled, right) / size[:, :, None]
    own = sums[:, columns][:, :, columns]
    left = np.einsum("bii->b", sums[:, -3:, -3:])
    squares = found * (own @ found - 2 * sums[:, columns, -3:])
    return found, left + squares.sum(axis=(1, 2))


def measure_clustering(weights: Array) -> float:
    """The share of the readings that were taken for outliers that stand beside another such."""
    out = weights < _DOUBTED
    beside = np.concatenate([[False], out[:-1]]) | np.concatenate([out[1:], [False]])
    return float(beside[out].mean()) if out.any() else 0.0


def compare_unseen(one: Array, other: Array) -> float:
    """The rms of what is left unseen (n, 3); no reading counts for more than what is gross to the
    other."""
    limit = _GROSS * robust_scale(other.ravel())
    return float(np.sqrt(np.mean(np.minimum(np.abs(one), limit) ** 2)))


WIDTHS = (0.05, 0.15, 0.4)
"""Distances of the play operator that are tried, of half the range of its input."""
UNITS = 64
TEMPERATURE, FIELD = "thermal hysteresis", "magnetic hysteresis"
NETWORK = "a network"
MOST = 100_000
"""Readings above which nothing is compared."""
_FEWEST = 8.0
"""Residuals for every number that is fitted."""
_RIDGES = (1e-5, 1e-3)
"""What is added to the information of each feature, as a share of it: against overfitting."""


def compare_alternatives(
    problem: KnownFieldProblem, fitted: Linearised, weights: Array, x: Array
) -> dict[str, float]:
    """Hysteresis and a network, each with its rms on the blocks that it has not seen over that of
    the fit without it; empty where the readings are too few, or too many.

    Parameters: readings in the order in which they were taken, about the solution, the weight (n,)
    of each, the temperatures (n,) as −1…1.
    """
    n, m = fitted.design.shape
    if n > MOST or 3 * n < _FEWEST * 3 * (m + UNITS):
        return {}
    footpoints = fitted.design[:, 1:4]
    features = {
        TEMPERATURE: [play(x[:, None], width) for width in WIDTHS],
        FIELD: [play(footpoints, width) for width in WIDTHS],
        NETWORK: [_respond(footpoints, x)],
    }
    made = [each for tried in features.values() for each in tried]
    sums = fitted.sum_up(weights, problem.blocks(), np.hstack(made))
    squares = np.diag(sums.sum(axis=0))
    plain, at, least = _measure(sums, np.arange(m), squares[:0]), m, dict[str, float]()
    for name, tried in features.items():
        for each in tried:
            own = np.arange(at, at := at + each.shape[1])
            left = _measure(sums, np.append(np.arange(m), own), squares[own])
            least[name] = min(left, least.get(name, np.inf))
    return {name: float(np.sqrt(left / plain)) for name, left in least.items()}


def play(values: Array, width: float) -> Array:
    """How far the play operator of each column stands from it, −1…1.

    Every input clips where the operator stands, and clips joined are a clip: so that it follows a
    record in log₂ n steps.
    """
    reach = width * np.maximum(np.ptp(values, axis=0) / 2, 1e-300)
    low, high = values - reach, values + reach
    low[0] = high[0] = values[0]
    step = 1
    while step < len(values):
        after = low[step:], high[step:]
        low[step:], high[step:] = (np.clip(of[:-step], *after) for of in (low, high))
        step *= 2
    return np.asarray((low - values) / reach)


def _respond(field: Array, x: Array) -> Array:
    """What hidden units with random weights make of field and temperature, (n, UNITS)."""
    drawn = np.random.default_rng(20).standard_normal((5, UNITS))
    return np.asarray(np.tanh(np.column_stack([field, x, np.ones(len(x))]) @ drawn))


def _measure(sums: Array, columns: Index, squares: Array) -> float:
    """The squares that fits of `columns` leave of blocks that they have not seen; the last of them
    are features, with their sums of squares."""
    none = np.zeros(len(columns) - len(squares))
    ridges = [np.concatenate([none, ridge * squares]) for ridge in _RIDGES]
    return min(float(predict_unseen(sums, columns, ridge)[1].sum()) for ridge in ridges)
