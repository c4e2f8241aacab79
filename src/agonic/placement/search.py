"""The best places of two magnetometers: every pair of a grid, then finer grids about the best."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.errors import AgonicError
from agonic.placement.disturbance import Service, Vehicles, disturb, remove_constant
from agonic.placement.layout import Layout


class Ensemble(NamedTuple):
    """Vehicles in service (k), one moment each, over which a heading's error is averaged; with
    `calibrated` magnetometers only what currents change of their mean is an error."""

    layout: Layout
    vehicles: Vehicles
    service: Service
    calibrated: bool = False

    def disturb(self, at: Array) -> Array:
        """What is added to the field at places (p, 3), nT (k, p, 3)."""
        made = disturb(self.layout, self.vehicles, at)
        return remove_constant(made, self.calibrated).add_up(*self.service[1:])


class Places(NamedTuple):
    """Candidates (p): the `region` of each, its coordinates there (p, 3), 0…1, and `at` (p, 3)."""

    region: Index
    inside: Array
    at: Array

    def take(self, rows: Index) -> Places:
        return Places(self.region[rows], self.inside[rows], self.at[rows])


class Scores(NamedTuple):
    """Of candidates (p): `error_deg` (p, p) the expected heading error, rms, of the best mix of a
    pair, of one alone on the diagonal, infinite where the two are too close; `mixes` (p, p, 3, 3)
    its G for first (row) and second (column)."""

    error_deg: Array
    mixes: Array


def score(ensemble: Ensemble, at: Array) -> Scores:
    """The mix of every pair of places (p, 3) that leaves the least error of a heading.

    The mix u = d₁ − G (d₂ − d₁) keeps the field. With n the direction of magnetic east in the axes
    of the vehicle, the heading's error is n·u over the level field, linear in G: with x = n ⊗ d,
    g = vec G, i = vec 1 and M the mean of x xᵀ, the noise σ² n nᵀ ⊗ 1 of each among it,

        E (n·u)² = (i + g)ᵀ M₁₁ (i + g) − 2 (i + g)ᵀ M₁₂ g + gᵀ M₂₂ g

    is least where (M₁₁ + M₂₂ − M₁₂ − M₂₁) g = −(M₁₁ − M₂₁) i: the best linear unbiased combination
    (Gauss–Markov) for a heading. Opposite and equal disturbances have G = −½, the mean of the two.
    """
    layout, added = ensemble.layout, ensemble.disturb(at)
    east, p = ensemble.service.rot_nb[:, 1], len(at)
    x = np.einsum("ki,kpj->kpij", east, added).reshape(len(east), -1)
    moments = (x.T @ x / len(east)).reshape(p, 9, p, 9).swapaxes(1, 2)
    noise = layout.sensor.noise_nT**2 * np.kron(east.T @ east / len(east), np.eye(3))
    own = moments[range(p), range(p)] + noise
    one, two = np.triu_indices(p, 1)
    across = moments[one, two]
    ridge = 1e-9 * np.trace(noise) * np.eye(9) + np.finfo(float).tiny * np.eye(9)
    apart = own[one] + own[two] - across - across.swapaxes(1, 2) + ridge
    whole = np.eye(3).ravel()
    pull = (own[one] - across.swapaxes(1, 2)) @ whole
    g = -np.linalg.solve(apart, pull[..., None])[..., 0]
    left = own[one] @ whole @ whole + np.einsum("pi,pi->p", pull, g)
    left[np.linalg.norm(at[one] - at[two], axis=1) < layout.sensor.separation_m] = np.inf
    square = np.diag(np.einsum("i,pij,j->p", whole, own, whole))
    square[one, two] = square[two, one] = np.maximum(left, 0.0)
    mixes = np.zeros((p, p, 3, 3))
    mixes[one, two] = g.reshape(-1, 3, 3)
    mixes[two, one] = -np.eye(3) - mixes[one, two]
    return Scores(np.degrees(np.sqrt(square) / layout.horizontal), mixes)


def search(ensemble: Ensemble, *, most: int = 240, starts: int = 4) -> tuple[Array, Array, Array]:
    """The best place alone (3,), the best pair (2, 3), m, and its mix G (3, 3).

    A grid of at most so many places over all regions is tried pair by pair. About the best pairs
    that lie apart grids of half the step follow, within the regions, until the step is a
    thousandth of a region. Raises `AgonicError` where no place, or no pair, is allowed.

    Parameters: `most` places of the grid; `starts` pairs that are followed.
    """
    layout = ensemble.layout
    grid, steps = lay_grid(layout, most)
    first = score(ensemble, grid.at)
    if (
        len(grid.at) < 2
        or not np.isfinite(first.error_deg[~np.eye(len(grid.at), dtype=bool)]).any()
    ):
        raise AgonicError(
            f"no two allowed places are {layout.sensor.separation_m:g} m apart; widen a "
            "[[region]], or lower separation_m"
        )
    alone = grid.at[int(np.argmin(np.diag(first.error_deg)))]
    found = []
    for pair in _list_starts(first.error_deg, grid.at, starts):
        found.append(_refine(ensemble, grid.take(np.array(pair)), steps))
    return alone, *min(found, key=lambda one: one[0])[1:]


def _list_starts(error_deg: Array, at: Array, most: int) -> list[tuple[int, int]]:
    """The best pairs, each with a place that those before do not have nearby."""
    one, two = np.triu_indices(len(at), 1)
    order = np.argsort(error_deg[one, two], kind="stable")
    size = np.ptp(at, axis=0).max() / 8
    chosen: list[tuple[int, int]] = []
    for k in order:
        pair = (int(one[k]), int(two[k]))
        if not np.isfinite(error_deg[pair]) or len(chosen) == most:
            break
        near = (np.abs(at[list(pair)] - at[list(other)]).max() < size for other in chosen)
        if not any(near):
            chosen.append(pair)
    return chosen


def _refine(ensemble: Ensemble, pair: Places, steps: Array) -> tuple[float, Array, Array]:
    """The error, the places (2, 3) and the mix of the best pair near one, by finer grids."""
    steps = steps.copy()
    while True:
        near = [_list_near(ensemble.layout, pair.take(np.array([k])), steps) for k in (0, 1)]
        scores, split = score(ensemble, _join(*near).at), len(near[0].at)
        across = scores.error_deg[:split, split:]
        one, two = np.unravel_index(int(np.argmin(across)), across.shape)
        pair = _join(near[0].take(np.array([one])), near[1].take(np.array([two])))
        if steps.max() < 1e-3:
            return float(across[one, two]), pair.at, scores.mixes[one, split + two]
        steps /= 2


def _join(one: Places, two: Places) -> Places:
    """The candidates of both, one after the other."""
    region = np.concatenate([one.region, two.region])
    return Places(region, *(np.concatenate([a, b]) for a, b in zip(one[1:], two[1:], strict=True)))


def lay_grid(layout: Layout, most: int) -> tuple[Places, Array]:
    """At most so many allowed places evenly over all regions, and the step (r, 3) in each, 0…1.

    Raises `AgonicError` where no place is far enough from parts and wires.
    """
    sizes = [np.linalg.norm(region.edges_m, axis=1) for region in layout.regions]
    step = max((size.max(initial=0.0) for size in sizes), default=0.0) or 1.0
    while sum(np.prod(np.ceil(size / step) + 1) for size in sizes) <= most and step > 1e-3:
        step /= 1.1
    counts = [np.ceil(size / (1.1 * step)).astype(int) + 1 for size in sizes]
    inside = [
        np.array(list(product(*(np.linspace(0, 1, n) for n in many)))).reshape(-1, len(many))
        for many in counts
    ]
    region = np.repeat(range(len(sizes)), [len(one) for one in inside])
    flat = np.concatenate([np.pad(one, ((0, 0), (0, 3 - one.shape[1]))) for one in inside])
    steps = np.zeros((len(sizes), 3))
    for k, many in enumerate(counts):
        steps[k, : len(many)] = 0.5 / (many - 1)
    places = _place(layout, region, flat)
    if not len(places.at):
        raise AgonicError(
            f"no place in {', '.join(r.name for r in layout.regions)} is "
            f"{layout.sensor.clearance_m:g} m from all parts and wires; move a [[region]], "
            "or lower clearance_m"
        )
    return places, steps


def _list_near(layout: Layout, one: Places, steps: Array) -> Places:
    """A place and those a step to each side of it, within its region."""
    moves = np.array(list(product((0.0, -1.0, 1.0), repeat=3))) * steps[one.region[0]]
    inside = np.unique(np.clip(one.inside + moves, 0.0, 1.0), axis=0)
    return _place(layout, np.repeat(one.region, len(inside)), inside)


def _place(layout: Layout, region: Index, inside: Array) -> Places:
    """Candidates by their coordinates in regions, without those that are too close to a part."""
    edges = np.array([np.pad(r.edges_m, ((0, 3 - len(r.edges_m)), (0, 0))) for r in layout.regions])
    corners = np.array([r.corner_m for r in layout.regions])
    at = corners[region] + np.einsum("pe,pei->pi", inside, edges[region])
    clear = measure_clearance(layout, at) >= layout.sensor.clearance_m
    return Places(region, inside, at).take(np.flatnonzero(clear))


def measure_clearance(layout: Layout, at: Array) -> Array:
    """Distances (p,) of places (p, 3) from the nearest part or wire, m."""
    nearest = np.full(len(at), np.inf)
    for part in layout.parts:
        nearest = np.minimum(nearest, np.linalg.norm(at - np.array(part.position_m), axis=1))
    for wire in layout.wires:
        start, piece = np.array(wire.points_m)[:-1], np.diff(wire.points_m, axis=0)
        away = at[:, None] - start
        share = np.einsum("psi,si->ps", away, piece) / np.maximum((piece**2).sum(axis=1), 1e-30)
        foot = away - np.clip(share, 0.0, 1.0)[..., None] * piece
        nearest = np.minimum(nearest, np.linalg.norm(foot, axis=2).min(axis=1))
    return nearest
