"""Readings in a room with known truth: iron in and behind its walls, or inside a coil."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.maths.magnetostatics import NT_M_A, dipole_tensor

EARTH = np.array([18_000.0, 1_000.0, 44_000.0])
"""nT, north, east and down, of central Europe."""


class SimulatedRoom(NamedTuple):
    """Readings `field` (n, 3), nT, at `position` (n, 3), m, in a room of `size` (3,), m; of the
    iron around it the places `sources` (k, 3) and `moments` (k, 3), A m²."""

    position: np.ndarray
    field: np.ndarray
    size: np.ndarray
    sources: np.ndarray
    moments: np.ndarray

    def compute_truth(self, at: np.ndarray) -> np.ndarray:
        """The field (n, 3), nT, at places (n, 3), m."""
        tensors = dipole_tensor(at[:, None] - self.sources)
        return np.asarray(EARTH + NT_M_A * np.einsum("nsij,sj->ni", tensors, self.moments))


def simulate_room(
    n: int = 150, *, noise: float = 20.0, clear_m: float = 0.5, moment: float = 10.0, seed: int = 0
) -> SimulatedRoom:
    """Readings at random places of a room of 4 × 3 × 2 m with 10 to 40 dipoles around it.

    Parameters: `n` readings; `noise` on an axis, nT; dipoles at least `clear_m` away from the
    room, of components of `moment`, A m²; `seed` of everything random.
    """
    rng = np.random.default_rng(seed)
    size = np.array([4.0, 3.0, 2.0])
    tried = rng.uniform(-1.5, size + 1.5, (2000, 3))
    outside = np.linalg.norm(np.maximum(np.maximum(-tried, tried - size), 0), axis=1) > clear_m
    sources = tried[outside][: rng.integers(10, 41)]
    made = SimulatedRoom(
        position=rng.uniform(0, 1, (n, 3)) * size,
        field=np.zeros((n, 3)),
        size=size,
        sources=sources,
        moments=moment * rng.normal(size=sources.shape),
    )
    return made._replace(field=made.compute_truth(made.position) + rng.normal(0, noise, (n, 3)))
