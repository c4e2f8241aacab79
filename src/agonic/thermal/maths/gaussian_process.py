"""Slow changes of the field while stations are recorded, as a Gaussian process.

The change is a stationary process of the time, the same on all axes, followed within a station as
far as polynomials of sixth order go, and from station to station by its correlation. It is smooth,
of Matérn's covariance (1 + a + a²/3) exp(−a), a = √5 Δ/length, or rough, (1 + a) exp(−a),
a = √3 Δ/length. (A Gaussian bell would extrapolate from one station to the next more surely than
fields do.) It is no parameter: the residuals are whitened with it, so a size near zero costs
nothing. Kind, size and length are those of the largest restricted likelihood (Patterson & Thompson
1971), in which every parameter takes its degrees of freedom; a process so long that it ties
stations together is thought less likely at first.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from agonic.arrays import Array, Index

Kind = tuple[str, float]

ORDER = 6
STEADY: Kind = ("steady", 0.0)
"""Another constant at each station: what stands beside the box there, or a bias that ages."""
KINDS: tuple[Kind, ...] = (
    STEADY,
    *(("smooth", length) for length in (0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0)),
    *(("rough", length) for length in (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)),
)
"""Smooth or rough, and the length in halves of a station's recording."""
LONG, UNLIKELY = 2.0, 6.0
"""Processes longer than this count as less likely: twice the logarithm of how much less."""
CHANCE = 2.0
"""What chance makes of twice the logarithm of the likelihood: changes that gain less are none."""
LARGEST = 0.02
"""The largest size that is looked for, in fields; no chamber changes by more of itself."""
_GRID = np.log(np.geomspace(2e-6, LARGEST, 11))
_FINER, _POINTS_FINER = 3, 9  # grids within one another, the last in steps of half a per cent
_POINTS = 3 * (ORDER + 1)  # of a station, at which the covariance is taken


class GaussianProcess(NamedTuple):
    """How large the changes are (standard deviation), their kind, and how surely they are there:
    twice the logarithm of the restricted likelihood over that without any.
    """

    sd: float = 0.0
    kind: Kind = KINDS[0]
    gain: float = 0.0


class TimeBasis(NamedTuple):
    """The times of the means: the first Legendre polynomials within each station (m, s), and the
    times of the stations (k, points) in halves of a recording; `covariances` by kind, as far as
    they were computed.
    """

    functions: Array
    times: Array
    covariances: dict[Kind, Array]


class StationSpaces(NamedTuple):
    """What slow changes look like in the whitened residuals.

    Of each station `rows` (n,) are the residuals, `bases` (n, c) is orthonormal, and
    `bases @ triangles` (n, a·s) are the changes by the functions, an axis after the other; `cells`
    are the means.
    """

    course: TimeBasis
    cells: tuple[Index, ...]
    rows: tuple[Index, ...]
    bases: tuple[Array, ...]
    triangles: tuple[Array, ...]

    def within(self, values: Array) -> Array:
        """Residuals (n,) or a Jacobian (n, p) in the bases, station after station."""
        return np.concatenate(
            [q.T @ values[rows] for q, rows in zip(self.bases, self.rows, strict=True)]
        )

    def expand(self, values: Array) -> Array:
        """Residuals (n,) or a Jacobian (n, p) of their parts (c, …) in the bases."""
        out = np.zeros((sum(map(len, self.rows)), *values.shape[1:]))
        for at, rows, basis in zip(self.parts, self.rows, self.bases, strict=True):
            out[rows] = basis @ values[at]
        return out

    @property
    def parts(self) -> list[slice]:
        """Where each station is in the bases."""
        edges = np.cumsum([0, *(q.shape[1] for q in self.bases)])
        return [slice(a, b) for a, b in pairwise(edges.tolist())]


def list_near_kinds(process: GaussianProcess) -> tuple[Kind, ...]:
    """The kinds near one that was found; every other where none was."""
    if process.sd == 0.0:
        return (STEADY, *KINDS[1::2])
    at = KINDS.index(process.kind)
    near = KINDS[max(at - 2, 0) : at + 3]
    return near if STEADY in near else (STEADY, *near)


def make_time_basis(time: Array, station: Index) -> TimeBasis:
    """The course of means at times (m,) at stations (m,) 0…k−1."""
    numbers = np.unique(station)
    low = np.array([time[station == k].min() for k in numbers])
    half = np.array([max(float(np.ptp(time[station == k])), 1e-9) / 2 for k in numbers])
    at = np.searchsorted(numbers, station)
    s = (time - low[at]) / half[at] - 1
    grid = np.linspace(-1.0, 1.0, _POINTS)
    times = (low[:, None] - low.min() + (grid + 1) * half[:, None]) / float(np.median(half))
    return TimeBasis(np.polynomial.legendre.legvander(s, ORDER).astype(np.float64), times, {})


def compute_covariance(basis: TimeBasis, kind: Kind) -> Array:
    """Covariance (k, s, k, s) of the polynomials' coefficients, for a process of unit variance."""
    if kind not in basis.covariances:
        basis.covariances[kind] = _project_process(basis, kind)
    return basis.covariances[kind]


def _project_process(basis: TimeBasis, kind: Kind) -> Array:
    shape, length = kind
    k = len(basis.times)
    if shape == "steady":
        blocks = np.zeros((k, ORDER + 1, k, ORDER + 1))
        blocks[range(k), 0, range(k), 0] = 1.0
        return blocks
    flat = basis.times.ravel()
    away = np.abs(flat[:, None] - flat) / length
    if shape == "smooth":
        a = np.sqrt(5.0) * away
        process = (1 + a + a**2 / 3) * np.exp(-a)
    else:
        a = np.sqrt(3.0) * away
        process = (1 + a) * np.exp(-a)
    grid = np.linspace(-1.0, 1.0, _POINTS)
    project = np.linalg.pinv(np.polynomial.legendre.legvander(grid, ORDER))
    blocks = process.reshape(k, _POINTS, k, _POINTS)
    return np.asarray(np.einsum("ia,kalb,jb->kilj", project, blocks, project, optimize=True))


def project_on_stations(by_field: Array, basis: TimeBasis, station: Index) -> StationSpaces:
    """The spaces of all stations.

    Parameters: by_field (m, a, a), the whitened residuals by the field at each mean, in the axes in
    which it changes, the residuals ordered an axis after the other; the station (m,) of each mean.
    """
    m, axes, _ = by_field.shape
    cells = tuple(np.flatnonzero(station == k) for k in np.unique(station))
    rows = tuple((np.arange(axes)[:, None] * m + c).ravel() for c in cells)
    split = [
        np.linalg.qr(
            np.einsum("mij,ms->imjs", by_field[c], basis.functions[c]).reshape(axes * len(c), -1)
        )
        for c in cells
    ]
    return StationSpaces(basis, cells, rows, tuple(q for q, _ in split), tuple(r for _, r in split))


def whiten(spaces: StationSpaces, sd: float, axes: tuple[Array, Array], values: Array) -> Array:
    """Residuals (n,) or a Jacobian (n, p) over the noise and the changes together.

    `axes` are those of `principal`.
    """
    size, axis = axes
    less = 1 - 1 / np.sqrt(1 + sd**2 * size)
    return values - spaces.expand(axis @ (less * (axis.T @ spaces.within(values)).T).T)


def find_principal_axes(spaces: StationSpaces, kind: Kind) -> tuple[Array, Array]:
    """Variances (c,) of a process of unit variance in the bases, and their directions (c, c)."""
    blocks = compute_covariance(spaces.course, kind)
    k, s = blocks.shape[:2]
    axes = spaces.triangles[0].shape[1] // s
    total = np.zeros((spaces.parts[-1].stop,) * 2)
    for a in range(axes):
        own = [r[:, a * s : (a + 1) * s] for r in spaces.triangles]
        wide = np.zeros((sum(map(len, own)), k * s))
        for n, (at, r) in enumerate(zip(spaces.parts, own, strict=True)):
            wide[at, n * s : (n + 1) * s] = r
        total += wide @ blocks.reshape(k * s, k * s) @ wide.T
    size, axis = eigh(total, check_finite=False, driver="evd")
    return np.maximum(size, 0.0), axis


def predict_changes(
    spaces: StationSpaces, process: GaussianProcess, axes: tuple[Array, Array], z: Array, m: int
) -> tuple[Array, float]:
    """The most probable changes (m, a) behind the residuals, and how many numbers they took.

    `axes` are those of `principal`.
    """
    many = len(z) // m
    changes = np.zeros((m, many))
    if process.sd == 0.0:
        return changes, 0.0
    size, axis = axes
    share = 1 / (1 + process.sd**2 * size)
    seen = axis @ (share * (axis.T @ spaces.within(z)))
    blocks = compute_covariance(spaces.course, process.kind)
    s = blocks.shape[1]
    pulled = np.array(
        [
            (r.T @ seen[at]).reshape(many, s)
            for at, r in zip(spaces.parts, spaces.triangles, strict=True)
        ]
    )
    coefficients = -(process.sd**2) * np.einsum("kilj,laj->kai", blocks, pulled)
    for cells, c in zip(spaces.cells, coefficients, strict=True):
        changes[cells] = spaces.course.functions[cells] @ c.T
    return changes, float(np.sum(1 - share))


def estimate_process(
    spaces: StationSpaces,
    z: Array,
    jacobian: Array,
    prior: tuple[Array, Array],
    kinds: tuple[Kind, ...] = KINDS,
) -> tuple[GaussianProcess, tuple[Array, Array]]:
    """The changes that residuals (n,) call for, with their Jacobian (n, p) and prior of unit sd.

    With C the covariance of the residuals, and A = JᵀC⁻¹J, b = JᵀC⁻¹z (prior among them), twice
    the negative logarithm of the restricted likelihood is

        ln|C| + ln|A| + zᵀC⁻¹z − bᵀA⁻¹b

    C differs from one in the stations' spaces only; the rest is added up once. Returns the changes
    and the axes (`principal`) of their kind.
    """
    own_z, own = spaces.within(z), spaces.within(jacobian)
    rest = _Rest(
        jacobian.T @ jacobian - own.T @ own + prior[1].T @ prior[1],
        jacobian.T @ z - own.T @ own_z + prior[1].T @ prior[0],
    )
    none = float(_compute_costs(rest, np.zeros(len(own_z)), own_z, own, np.zeros(1))[0])
    tried = []
    for kind in kinds:
        size, axis = find_principal_axes(spaces, kind)
        turned = (size, axis.T @ own_z, axis.T @ own, axis)
        costs = _compute_costs(rest, *turned[:3], np.exp(_GRID))
        unlikely = UNLIKELY if kind[1] > LONG else 0.0
        tried.append((float(costs.min()) + unlikely, int(np.argmin(costs)), kind, turned))
    _, k, kind, turned = min(tried, key=lambda each: each[0])
    grid, costs = _GRID, np.empty(0)
    for _ in range(_FINER):
        low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        grid = np.linspace(low, high, _POINTS_FINER)
        costs = _compute_costs(rest, *turned[:3], np.exp(grid))
        k = int(np.argmin(costs))
    gain = none - float(costs[k]) - (UNLIKELY if kind[1] > LONG else 0.0)
    by = (
        GaussianProcess(float(np.exp(grid[k])), kind, gain)
        if gain > CHANCE
        else GaussianProcess(kind=kind)
    )
    return by, (turned[0], turned[3])


class _Rest(NamedTuple):
    """Information (p, p) and gradient (p,) outside of the stations' spaces."""

    information: Array
    gradient: Array


def _compute_costs(rest: _Rest, size: Array, y: Array, x: Array, sds: Array) -> Array:
    """Twice the negative logarithm of the restricted likelihood, but for a constant, by size (s,).

    Parameters: in the stations' spaces the variances (c,) of a process of unit variance, the
    residuals (c,), and the Jacobian (c, p); the sizes (s,).
    """
    weight = 1 / (1 + sds[:, None] ** 2 * size)
    information = rest.information + (weight[:, None] * x.T) @ x
    b = rest.gradient + (weight * y) @ x
    scale = np.sqrt(np.maximum(np.diagonal(information, axis1=1, axis2=2), 1e-300))
    scaled = information / (scale[:, :, None] * scale[:, None]) + 1e-13 * np.eye(len(rest.gradient))
    lower = np.linalg.cholesky(scaled)
    pulled = np.linalg.solve(lower, (b / scale)[..., None])[..., 0]
    sizes = scale * np.diagonal(lower, axis1=1, axis2=2)
    logs = 2 * np.log(sizes).sum(axis=1) - np.log(weight).sum(axis=1)
    return np.asarray(logs + (weight * y * y).sum(axis=1) - (pulled * pulled).sum(axis=1))
