"""The best places of two magnetometers: every pair of a grid, then finer grids about the best."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.placement.disturbance import Service, Vehicles, disturb
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
        made = disturb(self.layout, self.vehicles, at, self.calibrated)
        return made.add_up(*self.service[1:])


def score(ensemble: Ensemble, at: Array) -> tuple[Array, Array]:
    """Of places (p, 3) the expected heading error, rms, degrees, of the best mix of every pair
    (p, p), of one alone on the diagonal, infinite where the two are too close; and the mixes
    (p, p, 3, 3) of first (row) and second (column)."""
    layout, east = ensemble.layout, ensemble.service.rot_nb[:, 1]
    x = np.einsum("ki,kpj->kpij", east, ensemble.disturb(at)).reshape(len(east), -1)
    noise = np.full(len(at), layout.sensor.noise_nT)
    square, mixes = combine(x.T @ x / len(east), east.T @ east / len(east), noise, ridge=1e-9)
    apart = np.linalg.norm(at[:, None] - at, axis=2)
    square[(apart < layout.sensor.separation_m) & ~np.eye(len(at), dtype=bool)] = np.inf
    return np.degrees(np.sqrt(square) / layout.horizontal), mixes


def combine(moments: Array, east: Array, noise: Array, ridge: float = 0.0) -> tuple[Array, Array]:
    """The mix of every pair of places (p) that leaves the least error along a direction.

    The mix u = d₁ − G (d₂ − d₁) keeps the field. With n the direction, as magnetic east in the axes
    of the vehicle, the error is n·u, linear in G: with x = n ⊗ d, g = vec G, i = vec 1 and M the
    mean of x xᵀ, the noise σ² n nᵀ ⊗ 1 of each among it,

        E (n·u)² = (i + g)ᵀ M₁₁ (i + g) − 2 (i + g)ᵀ M₁₂ g + gᵀ M₂₂ g

    is least where (M₁₁ + M₂₂ − M₁₂ − M₂₁) g = −(M₁₁ − M₂₁) i: the best linear unbiased combination
    (Gauss–Markov). Opposite and equal disturbances have G = −½, the mean of the two, at 0.71 of the
    noise; where both see the same, nothing cancels.
    """
    p, whole = len(noise), np.eye(3).ravel()
    blocks = moments.reshape(p, 9, p, 9).swapaxes(1, 2)
    noises = np.multiply.outer(noise**2, np.kron(east, np.eye(3)))
    own = blocks[range(p), range(p)] + noises
    one, two = np.triu_indices(p, 1)
    across = blocks[one, two].swapaxes(1, 2)
    apart = own[one] + own[two] - across - across.swapaxes(1, 2)
    apart = apart + (ridge * np.trace(noises[0]) + np.finfo(float).tiny) * np.eye(9)
    pull = (own[one] - across) @ whole
    g = -np.linalg.solve(apart, pull[..., None])[..., 0]
    square = np.diag(own @ whole @ whole)
    left = own[one] @ whole @ whole + np.einsum("pi,pi->p", pull, g)
    square[one, two] = square[two, one] = np.maximum(left, 0.0)
    mixes = np.zeros((p, p, 3, 3))
    mixes[one, two] = g.reshape(-1, 3, 3)
    mixes[two, one] = -np.eye(3) - mixes[one, two]
    return square, mixes


def search(ensemble: Ensemble, *, most: int = 240, starts: int = 4) -> tuple[Array, Array, Array]:
    """The best place alone (3,), the best pair (2, 3), m, and its mix G (3, 3).

    A grid of at most so many places over all regions is tried pair by pair. About the best pairs
    that lie apart grids of half the step follow, within the regions, until the step is a
    thousandth of a region. Raises `AgonicError` where no place, or no pair, is allowed.
    """
    layout = ensemble.layout
    grid, steps = lay_grid(layout, most)
    at = locate(layout, grid)
    error_deg, _ = score(ensemble, at)
    pairs = _list_starts(error_deg, at, starts)
    if not pairs:
        raise AgonicError(
            f"no two allowed places are {layout.sensor.separation_m:g} m apart; widen a "
            "[[region]], or lower separation_m"
        )
    found = [_refine(ensemble, grid[pair], steps) for pair in pairs]
    return at[np.diag(error_deg).argmin()], *min(found, key=lambda one: one[0])[1:]


def _list_starts(error_deg: Array, at: Array, most: int) -> list[list[int]]:
    """The best pairs, each with a place that those before do not have nearby."""
    one, two = np.triu_indices(len(at), 1)
    allowed = np.isfinite(error_deg[one, two])
    order = np.argsort(error_deg[one, two], kind="stable")[: allowed.sum()]
    size = np.ptp(at, axis=0).max() / 8
    chosen: list[list[int]] = []
    for pair in np.stack([one, two], axis=1)[order].tolist():
        if all(np.abs(at[pair] - at[other]).max() >= size for other in chosen):
            chosen.append(pair)
        if len(chosen) == most:
            break
    return chosen


def _refine(ensemble: Ensemble, pair: Array, steps: Array) -> tuple[float, Array, Array]:
    """The error, the places (2, 3) and the mix of the best pair near one, by finer grids."""
    layout = ensemble.layout
    moves = np.array(list(product((0.0, -1.0, 1.0), repeat=3)))
    while True:
        near = []
        for region, *inside in pair.tolist():
            moved = np.clip(inside + moves * steps[int(region)], 0.0, 1.0)
            near.append(_keep_clear(layout, np.insert(np.unique(moved, axis=0), 0, region, axis=1)))
        tried, split = np.concatenate(near), len(near[0])
        error_deg, mixes = score(ensemble, locate(layout, tried))
        across = error_deg[:split, split:]
        one, two = np.unravel_index(int(np.argmin(across)), across.shape)
        pair = tried[[one, split + two]]
        if steps.max() < 1e-3:
            return float(across[one, two]), locate(layout, pair), mixes[one, split + two]
        steps = steps / 2


def lay_grid(layout: Layout, most: int) -> tuple[Array, Array]:
    """At most so many allowed candidates (p, 4) evenly over all regions, and the step (r, 3) in
    each, 0…1. A candidate is the number of its region and its coordinates there, 0…1."""
    sizes = np.linalg.norm(_pad_edges(layout), axis=2)
    step = sizes.max() or 1.0
    while np.prod(np.ceil(sizes / step) + 1, axis=1).sum() <= most and step > 1e-3:
        step /= 1.1
    counts = np.ceil(sizes / (1.1 * step)).astype(int) + 1
    grids = (product([k], *(np.linspace(0, 1, n) for n in many)) for k, many in enumerate(counts))
    places = _keep_clear(layout, np.array([row for grid in grids for row in grid]))
    if not len(places):
        raise AgonicError(
            f"no place in {', '.join(r.name for r in layout.regions)} is "
            f"{layout.sensor.clearance_m:g} m from all parts and wires; move a [[region]], "
            "or lower clearance_m"
        )
    return places, np.where(counts > 1, 0.5 / np.maximum(counts - 1, 1), 0.0)


def locate(layout: Layout, candidates: Array) -> Array:
    """The places (p, 3), m, of candidates (p, 4)."""
    region = candidates[:, 0].astype(int)
    corners = np.array([r.corner_m for r in layout.regions])
    inside = np.einsum("pe,pei->pi", candidates[:, 1:], _pad_edges(layout)[region])
    return np.asarray(corners[region] + inside)


def _pad_edges(layout: Layout) -> Array:
    """The edges of all regions as (r, 3, 3), those that a line or a plate lacks without length."""
    return np.array([np.pad(r.edges_m, ((0, 3 - len(r.edges_m)), (0, 0))) for r in layout.regions])


def _keep_clear(layout: Layout, candidates: Array) -> Array:
    """The candidates that are not too close to a part."""
    clearance = measure_clearance(layout, locate(layout, candidates))
    return candidates[clearance >= layout.sensor.clearance_m]


def measure_clearance(layout: Layout, at: Array) -> Array:
    """Distances (p,) of places (p, 3) from the nearest part or wire, m."""
    lines = [*([part.position_m] * 2 for part in layout.parts), *(w.points_m for w in layout.wires)]
    start = np.concatenate([line[:-1] for line in lines])
    piece = np.concatenate([np.diff(line, axis=0) for line in lines])
    away = at[:, None] - start
    share = np.einsum("psi,si->ps", away, piece) / np.maximum((piece**2).sum(axis=1), 1e-30)
    foot = away - np.clip(share, 0.0, 1.0)[..., None] * piece
    return np.asarray(np.linalg.norm(foot, axis=2).min(axis=1))
