"""Change points: the stretch of rows with another bias that explains the most."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.estimation.noise.batch_means import compute_scatter
from agonic.maths.estimation.noise.residuals import MAD_TO_SD, correlation_length
from agonic.maths.one_pass import median

_BLOCKS = 64  # edges are sought on this grid
_SHORTEST = 2  # blocks, of the stretch and of what is left
_STRETCHES = 512  # that pulls are summed up in
_FEWEST = 8  # batches that tell how they scatter
_OUTLYING = 4.0  # median distances beyond which a residual counts no more than this
_UNTOLD = 1e-10  # of the mean information about a move: less is told by rounding


class BiasChange(NamedTuple):
    """Rows start…stop have their bias elsewhere; stop is n when it never came back.

    `shift` how far, as seen from the directions there: √3 times the rms of the residuals that it
    makes; `seen` what is left of it where the ellipsoid follows it as well as it can; `noise` the
    scatter that is left; `significance` how much Σr² falls in units of that scatter, per
    independent reading (for white noise a χ² with three degrees of freedom).
    """

    start: int
    stop: int
    shift: float
    seen: float
    noise: float
    significance: float


def find_bias_change(residuals: Array, normals: Array, places: Array) -> BiasChange | None:
    """The best stretch [start, stop) with a bias of its own, all else of the ellipsoid refitted.

    r = J δ + 1[start ≤ i < stop] n·shift, J the nine ways in which an ellipsoid can move (n, and
    n_i p_j for a symmetric change of shape): Lagrange multiplier test with two unknown edges
    (Andrews 1993). Residuals are drawn in to a few median distances, so that outliers do not
    decide.

    Parameters: residuals (n,) distances from the ellipsoid in time order, normals (n, 3) there,
    places (n, 3) the foot points on it relative to its centre, over its radius. None where there
    are too few rows to tell.
    """
    n = len(residuals)
    blocks = min(_BLOCKS, n // 6)
    reach = _OUTLYING * median(np.abs(residuals))
    if blocks < 4 * _SHORTEST or reach == 0.0:
        return None
    moves = _moves(normals, places)
    drawn_in = np.clip(residuals, -reach, reach)
    start, stop, gain = _find_stretch(drawn_in, moves, blocks)
    inside = np.zeros(n, dtype=bool)
    inside[start:stop] = True
    away, left = _refit(residuals, moves, inside)
    shift = float(np.sqrt(3 * np.mean(away[inside] ** 2)))
    seen = _see(away, moves, inside)
    noise = MAD_TO_SD * median(np.abs(left))
    scatter = np.clip(left, -_OUTLYING * noise, _OUTLYING * noise)
    independent = float(scatter @ scatter) / n * _memory(scatter, normals)
    if start == 0:  # before and after are the same thing
        start, stop = stop, n
    return BiasChange(
        start, stop, shift, seen, noise, gain / max(independent, np.finfo(float).tiny)
    )


def _memory(residuals: Array, normals: Array) -> float:
    """How many readings count as one for a bias.

    Slow errors that stand in the sensor's axes change sign in the residuals (n,) as the field
    turns, but not in their pulls r n on a bias, by which a shift is found. Their batches tell.
    """
    n = len(residuals)
    pulls = residuals[:, None] * normals
    starts = np.unique(np.linspace(0, n, min(n, _STRETCHES), endpoint=False).astype(int))
    white = float(residuals @ residuals) * (normals.T @ normals) / n
    lasting = compute_scatter(np.add.reduceat(pulls, starts), white, fewest=_FEWEST).correlation
    return max(correlation_length(residuals, np.ones(n)), lasting)


def refit_residuals(residuals: Array, normals: Array, places: Array) -> Array:
    """What is left of residuals (n,) when the ellipsoid moves and bends to make them least.

    Parameters as in `find_bias_change`: a fit of a smaller model does not tell what a full one
    leaves.
    """
    return _refit(residuals, _moves(normals, places), np.zeros(len(residuals), dtype=bool))[1]


def find_seen_shift(residuals: Array, normals: Array, places: Array, changed: Mask) -> float:
    """How far the bias of rows `changed` (n,) lies from that of the others, as far as readings show
    it: √(3 Σa²/k), a what no move of the whole ellipsoid makes of it and k = n₁n₂/n.

    A stretch that saw few directions fits a bias far away as well as one nearby, together with
    another ellipsoid for all rows. Parameters as in `find_bias_change`.
    """
    moves = _moves(normals, places)
    return _see(_refit(residuals, moves, changed)[0], moves, changed)


def _see(away: Array, moves: Array, changed: Mask) -> float:
    own = away - moves @ (_invert(moves.T @ moves) @ (away @ moves))
    return float(np.sqrt(3 * (own @ own) / (len(away) * changed.mean() * (1 - changed.mean()))))


def _moves(normals: Array, places: Array) -> Array:
    """The distances (n, 9) by which unit changes of bias and shape move the surface."""
    a, b, c = normals.T
    x, y, z = places.T
    shape = (a * x, b * y, c * z, a * y + b * x, a * z + c * x, b * z + c * y)
    return np.stack([a, b, c, *shape], axis=1)


def _invert(information: Array) -> Array:
    """The inverse of what rows tell of moves (m, m), each held as if by 1e-10 of it.

    Moves by as much as the field that shift readings by less than a hundred-thousandth of it,
    0.5 nT of 50 µT, are no moves that a calibration makes. A vehicle that stays level shows some
    of them by the rounding of its readings only, which a rank, a yes or no, would go by.
    """
    hold = _UNTOLD * np.trace(information) / len(information)
    return np.asarray(np.linalg.inv(information + hold * np.eye(len(information))))


def _find_stretch(residuals: Array, moves: Array, blocks: int) -> tuple[int, int, float]:
    """First row, row after the last, and fall of Σr², over all pairs of edges.

    With S the stretch and G = JᵀJ, g = Jᵀr: fall = tᵀA⁻¹t with t = X_Sᵀ(r − J G⁻¹g) and
    A = X_SᵀX_S − X_SᵀJ G⁻¹JᵀX_S, X_S the rows of the normals in S; the sums add over blocks.
    """
    edges = np.linspace(0, len(residuals), blocks + 1).astype(int)
    products = _sum_products(np.column_stack([moves, residuals]), edges)
    outer, score = products[:, :9, :9], products[:, 9, :9]
    first, last = np.triu_indices(blocks + 1, _SHORTEST)
    enough = last - first <= blocks - _SHORTEST
    first, last = first[enough], last[enough]
    inverse = _invert(outer[-1])
    cross = outer[last, :3] - outer[first, :3]
    taken = (cross.reshape(-1, 9) @ inverse).reshape(cross.shape)
    own = cross[:, :, :3] - taken @ np.swapaxes(cross, 1, 2)
    own += 1e-2 * len(residuals) / blocks * np.eye(3)  # a shift that hardly shows is no evidence
    towards = score[last, :3] - score[first, :3] - cross @ (inverse @ score[-1])
    fall = _weigh(towards, own)
    best = int(np.argmax(fall))
    return int(edges[first[best]]), int(edges[last[best]]), float(fall[best])


def _sum_products(columns: Array, edges: Index) -> Array:
    """CᵀC of the rows of columns (n, k) before each of the edges (b + 1,), (b + 1, k, k)."""
    longest = int(np.diff(edges).max())
    rows = edges[:-1, None] + np.arange(longest)
    blocks = columns[np.minimum(rows, edges[-1] - 1)]
    blocks[rows >= edges[1:, None]] = 0.0
    sums = np.zeros((len(edges), *2 * columns.shape[1:]))
    np.cumsum(blocks.transpose(0, 2, 1) @ blocks, axis=0, out=sums[1:])
    return sums


def _weigh(vectors: Array, matrices: Array) -> Array:
    """vᵀA⁻¹v of vectors (k, 3) and symmetric positive matrices (k, 3, 3), by elimination: all k at
    once, where a call of LAPACK for each takes ten times as long."""
    (a, b, c), (_, d, e), (_, _, f) = matrices.transpose(1, 2, 0)
    x, y, z = vectors.T
    by, cy = b / a, c / a
    y, d, e = y - by * x, d - by * b, e - by * c
    cz = e / d
    z, f = z - cy * x - cz * y, f - cy * c - cz * e
    return np.asarray(x * x / a + y * y / d + z * z / f)


def _refit(residuals: Array, moves: Array, changed: Mask) -> tuple[Array, Array]:
    """What the shift of the changed rows makes of the residuals, and what is left of them.

    Least squares with residuals drawn in to a few median distances, step by step (Huber 1981).
    """
    own = moves[:, :3] * changed[:, None]
    design = np.hstack([own, moves])
    solve = _invert(design.T @ design) @ design.T
    estimate, left = np.zeros(design.shape[1]), residuals
    for _ in range(10):
        reach = _OUTLYING * median(np.abs(left))
        estimate = estimate + solve @ np.clip(left, -reach, reach)
        left = residuals - design @ estimate
    return own @ estimate[:3], left
