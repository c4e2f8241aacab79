"""Which rows of a log had one bias, which another, and which neither: the moments of a change.

A search over a coarse grid says that there was a change and roughly when. From there two steps are
taken in turn until the rows stay where they are: two spheroids of one shape and two centres through
the readings of either state, and the path through the states that fits the readings best, where
each switch has a price (Viterbi 1967).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.maths.equation.crowding import find_spread_rows
from agonic.maths.estimation.changes.hidden_states import find_path
from agonic.maths.estimation.noise.residuals import MAD_TO_SD, correlation_length
from agonic.maths.estimation.robust.least_median import fit_least_median_sphere
from agonic.maths.one_pass import median

NEITHER = 2
_PRICE = 15.0  # of a switch, in log-likelihood: by chance one in e¹⁵ rows
_STRANGE = 4.0  # standard deviations from either spheroid that are as likely as belonging to none
_SHAPE_SD = 0.1
_ROUNDS, _STEPS = 8, 8
_FITTED = 4000  # rows, spread over directions
_FEWEST = 12
_ALIKE = 0.7
_SUBSETS = 1200
_SETTLED = 1e-5


class Spheroid(NamedTuple):
    """|S (p − c)| = ρ: the centre (3,), the shape (3, 3) of trace three, and the radius."""

    centre: Array
    shape: Array
    radius: float

    def measure(self, points: Array) -> tuple[Array, Array, Array]:
        """Of points (n, 3) the distances (n,), normals (n, 3), and feet (n, 3) over the radius."""
        field = (points - self.centre) @ self.shape
        size = np.maximum(np.linalg.norm(field, axis=1), 1e-9)
        normals = field / size[:, None]
        return size - self.radius, normals, normals


class BiasStates(NamedTuple):
    """The state (n,) of each row, 0, 1 or NEITHER; how far the biases are apart; the noise.

    `misfit` (n,) is the distance from the spheroid of each row's state, `spheroids` are the two.
    """

    state: NDArray[np.int8]
    shift: float
    noise: float
    misfit: Array
    spheroids: tuple[Spheroid, Spheroid]

    @property
    def changed(self) -> Mask:
        """The rows that do not have the bias that most rows have."""
        return np.asarray(self.state != self._common)

    @property
    def most(self) -> Spheroid:
        """The spheroid of the bias that most rows have."""
        return self.spheroids[self._common]

    @property
    def _common(self) -> int:
        return int(np.count_nonzero(self.state == 1) > np.count_nonzero(self.state == 0))


class _Pair(NamedTuple):
    """Two centres (2, 3), and the one shape (3, 3), of trace three, and radius of both."""

    centres: Array
    shape: Array
    radius: float


def find_bias_states(points: Array, second: Mask, *, seed: int = 0) -> BiasStates | None:
    """The states of readings in time order, from a guess of the rows of the second.

    The rows that one sphere through many of the readings leaves over are another guess; what
    explains the readings better is kept. Parameters: points (n, 3) over their radius; `second` (n,)
    the guess. None where either state has too few rows.
    """
    found = [_alternate(points, guess, seed) for guess in (second, _leave_over(points, seed))]
    told = [states for states in found if states is not None]
    if not told:
        return None
    noise = _STRANGE * min(states.noise for states in told)
    return min(told, key=lambda states: float(np.minimum(states.misfit, noise).mean()))


def _leave_over(points: Array, seed: int) -> Mask:
    """The rows in succession that are far from a sphere through many of all."""
    centre, gain = _sphere(points, np.arange(len(points)), seed, quantile=0.3)
    off = np.linalg.norm(points - centre, axis=1) * gain - 1
    noise = max(float(np.quantile(np.abs(off), 0.3)) / 0.385, 1e-9)
    return np.asarray(
        _find_path(np.stack([off, np.full(len(off), np.inf)]) / noise, 1.0) == NEITHER
    )


def _alternate(points: Array, second: Mask, seed: int) -> BiasStates | None:
    """The states after fits and paths in turn."""
    state, noise = second.astype(np.int8), 0.0
    if not _both(state):
        return None
    model = _start(points, ~second, seed)
    off = np.zeros((2, len(points)))
    for k in range(_ROUNDS):
        if not _both(state):
            return None
        model = _fit(points, state, model)
        off = _distances(points, model)
        own = np.where(state == 1, off[1], off[0])[state != NEITHER]
        noise = max(MAD_TO_SD * median(np.abs(own)), 1e-9)
        clipped = np.clip(own, -_STRANGE * noise, _STRANGE * noise)
        # what a wrong guess leaves is correlated as well
        correlation = correlation_length(clipped, np.ones(len(clipped))) if k else 1.0
        before, state = state, _find_path(off / noise, correlation)
        if np.array_equal(before, state):
            break
    shift = float(np.linalg.norm(model.centres[1] - model.centres[0]))
    left = np.abs(np.where(state == 1, off[1], off[0]))
    first, other = (Spheroid(centre, model.shape, model.radius) for centre in model.centres)
    return BiasStates(state, shift, noise, left, (first, other))


def _both(state: NDArray[np.int8]) -> bool:
    """Whether either state has rows enough."""
    return bool(min(np.count_nonzero(state == 0), np.count_nonzero(state == 1)) >= _FEWEST)


def _start(points: Array, first: Mask, seed: int) -> _Pair:
    """Spheres of one radius: through most of the first readings, and of the second if they can."""
    centre, gain = _sphere(points, np.flatnonzero(first), seed)
    other, other_gain = _sphere(points, np.flatnonzero(~first), seed)
    alike = _ALIKE < gain / other_gain < 1 / _ALIKE
    return _Pair(np.stack([centre, other if alike else centre]), np.eye(3), 1 / gain)


def _sphere(points: Array, rows: Index, seed: int, quantile: float = 0.5) -> tuple[Array, float]:
    """Centre and gain of a sphere through many of some rows, spread over directions."""
    rows = _spread(points, rows)
    middle = points[rows].mean(axis=0)
    centre, gain = fit_least_median_sphere(
        points[rows] - middle, np.ones(1), quantile=quantile, subsets=_SUBSETS, seed=seed
    )
    return centre + middle, gain


def _fit(points: Array, state: NDArray[np.int8], start: _Pair) -> _Pair:
    """Both centres, shape and radius: |S (p − c_k)| − ρ by Gauss–Newton, residuals drawn in.

    The priors, worth a reading each, hold what few orientations leave open: S near one, the centres
    near each other.
    """
    rows = np.concatenate([_spread(points, np.flatnonzero(state == k)) for k in (0, 1)])
    p, second = points[rows], state[rows] == 1
    params = np.concatenate([start.centres.ravel(), np.zeros(5), [start.radius]])
    prior = np.zeros((8, 12))
    prior[:5, 6:11] = np.eye(5) / _SHAPE_SD
    prior[5:, :3], prior[5:, 3:6] = -np.eye(3), np.eye(3)
    params[6:11] = _pack(start.shape)
    for _ in range(_STEPS):
        shape = _unpack(params[6:11])
        apart = p - np.where(second[:, None], params[3:6], params[:3])
        field = apart @ shape
        size = np.maximum(np.linalg.norm(field, axis=1), 1e-9)
        n, off = field / size[:, None], size - params[11]
        (a, b, c), (x, y, z) = n.T, apart.T
        bends = (a * x - c * z, b * y - c * z, a * y + b * x, a * z + c * x, b * z + c * y)
        moves = -n @ shape
        design = np.column_stack(
            [moves * ~second[:, None], moves * second[:, None], *bends, -np.ones(len(p))]
        )
        reach = _STRANGE * MAD_TO_SD * median(np.abs(off)) + 1e-12
        weight = np.minimum(1.0, reach / np.maximum(np.abs(off), 1e-12))
        one = (reach / _STRANGE) ** 2
        weighted = design * weight[:, None]
        normal = weighted.T @ design + one * prior.T @ prior
        pull = weighted.T @ off + one * prior.T @ (prior @ params)
        step = np.linalg.solve(normal + 1e-12 * np.trace(normal) * np.eye(12), pull)
        params = params - step
        if np.abs(step).max() < _SETTLED:
            break
    return _Pair(params[:6].reshape(2, 3), _unpack(params[6:11]), float(params[11]))


def _unpack(bent: Array) -> Array:
    """The symmetric shape (3, 3) of trace three from its xx − 1, yy − 1, xy, xz, yz."""
    xx, yy, xy, xz, yz = bent
    return np.array([[1 + xx, xy, xz], [xy, 1 + yy, yz], [xz, yz, 1 - xx - yy]])


def _pack(shape: Array) -> Array:
    return np.asarray(shape[[0, 1, 0, 0, 1], [0, 1, 1, 2, 2]] - (1.0, 1.0, 0.0, 0.0, 0.0))


def _spread(points: Array, rows: Index) -> Index:
    return rows[find_spread_rows(points[rows], most=_FITTED // 2)]


def _distances(points: Array, model: _Pair) -> Array:
    """Distances (2, n) from the two spheroids."""
    field = (points[None] - model.centres[:, None]) @ model.shape
    return np.asarray(np.linalg.norm(field, axis=2) - model.radius)


def _find_path(off: Array, correlation: float) -> NDArray[np.int8]:
    """The likeliest states (n,), by distances (2, n) over the noise."""
    far = np.full((1, off.shape[1]), _STRANGE**2 / 2)
    cost = np.concatenate([np.minimum(off**2 / 2, _STRANGE**2), far])
    return find_path(cost / correlation, _PRICE)
