"""What a vehicle's parts do to the field at places on board, in vehicles built after one list.

At a place and in a field B (in the axes of the vehicle) what is added is

    d = h + S B + Σ g I,   h = μ₀/4π Σ T(r − p) m,   S = Σ T(r − p) α / 4π

of hard iron m, soft iron α and currents I, with g by the law of Biot and Savart. That parts
magnetise each other is left out: it is of second order in α/r³.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.maths.magnetostatics import NT_M_A, dipole_tensor, wire_field
from agonic.maths.rotations.attitude import rot_nb
from agonic.placement.layout import Layout


class Vehicles(NamedTuple):
    """Vehicles (k) built after a list, which differ as its standard deviations let them: dipoles at
    `positions` (k, p, 3) with `moments` and `induced` (k, p, 3), wires (w) moved by `shifts`
    (k, w, 3), and magnetometers by `mounting` (k, 2, 3) from where they should sit."""

    positions: Array
    moments: Array
    induced: Array
    shifts: Array
    mounting: Array


class Disturbance(NamedTuple):
    """At places (p) in vehicles (k): `hard` (k, p, 3), nT; `soft` (k, p, 3, 3); `per_ampere`
    (k, p, c, 3) of the currents in the order of `Layout.currents`, nT/A; of one place without p."""

    hard: Array
    soft: Array
    per_ampere: Array

    def add_up(self, field_b: Array, currents: Array) -> Array:
        """What is added, nT, in a field (k, 3) and with currents (k, c), A: (k, p, 3) at places;
        at one place in each of these fields (n, 3) and with each of the currents, (n, k, 3)."""
        induced = np.einsum("...ij,...j->...i", self.soft, field_b[:, None])
        driven = np.einsum("...ci,...c->...i", self.per_ampere, currents[:, None])
        return np.asarray(self.hard + induced + driven)


class Service(NamedTuple):
    """Moments of service (k): `rot_nb` (k, 3, 3), the field in the axes of the vehicle `field_b`
    (k, 3), nT, and the `currents` (k, c), A."""

    rot_nb: Array
    field_b: Array
    currents: Array


def draw_vehicles(layout: Layout, n: int, rng: np.random.Generator) -> Vehicles:
    """Vehicles (n) as the standard deviations of a list let them be; the list itself for n = 0."""
    many = max(n, 1)
    scale = float(n > 0)

    def vary(values: Sequence[ArrayLike], sds: list[float]) -> Array:
        rows = [np.broadcast_to(np.asarray(one, dtype=float), 3) for one in values]
        middle = np.reshape(rows, (-1, 3))
        apart = rng.standard_normal((many, *middle.shape))
        return np.asarray(middle + scale * np.reshape(sds, (-1, 1)) * apart)

    parts, wires = layout.parts, layout.wires
    return Vehicles(
        vary([part.position_m for part in parts], [part.position_sd_m for part in parts]),
        vary([part.moment_A_m2 for part in parts], [part.moment_sd_A_m2 for part in parts]),
        vary([part.induced_m3 for part in parts], [part.induced_sd_m3 for part in parts]),
        vary([0.0 for _ in wires], [wire.position_sd_m for wire in wires]),
        vary([0.0, 0.0], [layout.sensor.position_sd_m] * 2),
    )


def draw_service(
    layout: Layout, n: int, rng: np.random.Generator, calibrated: bool = False
) -> Service:
    """Moments of service (n): headings evenly all round, roll, pitch and currents evenly within
    their ranges; of the currents less their mean for `calibrated` magnetometers."""
    low, high = layout.current_limits
    strata = np.tile((np.arange(n) + 0.5) / n, (2 + len(low), 1))  # a Latin hypercube
    shares = rng.permuted(strata, axis=1)
    roll, pitch = layout.service.tilt_deg * (2 * shares[:2] - 1)
    currents = low + shares[2:].T * (high - low) - calibrated * (low + high) / 2
    return steer(layout, (roll, pitch, 360.0 * strata[0]), currents)


def steer(layout: Layout, attitude: tuple[Array, Array, Array], currents: Array) -> Service:
    """Moments at roll, pitch and heading (k), degrees, in the field of a list."""
    turn = rot_nb(*attitude)
    return Service(turn, np.einsum("kij,i->kj", turn, layout.field_n), currents)


def disturb(
    layout: Layout, vehicles: Vehicles, places: Array, calibrated: bool = False
) -> Disturbance:
    """What the parts do at places (p, 3), or (k, p, 3) of each vehicle, m; of `calibrated`
    magnetometers nothing of hard and soft iron is left, nor of the currents' mean, which
    `draw_service` takes off."""
    places = np.broadcast_to(places, (len(vehicles.positions), *np.shape(places)[-2:]))
    tensors = dipole_tensor(places[:, :, None] - vehicles.positions[:, None])
    hard = NT_M_A * np.einsum("kpqij,kqj->kpi", tensors, vehicles.moments)
    soft = np.einsum("kpqij,kqj->kpij", tensors, vehicles.induced) / (4 * np.pi)
    names = list(layout.currents)
    per_ampere = np.zeros((*places.shape[:2], len(names), 3))
    for w, wire in enumerate(layout.wires):
        moved = places - vehicles.shifts[:, None, w]
        per_ampere[:, :, names.index(wire.name)] += wire.turns * wire_field(
            np.array(wire.points_m), moved
        )
    iron = 0.0 if calibrated else 1.0
    return Disturbance(iron * hard, iron * soft, per_ampere)


def deviate(service: Service, added: Array, horizontal: float) -> Array:
    """Heading error, magnetic less compass (k, …), degrees, of a tilt-compensated compass to whose
    field is added (k, …, 3), nT; the level field is `horizontal`."""
    level = np.einsum("kij,k...j->k...i", service.rot_nb[:, :2], added)
    return np.asarray(np.degrees(np.arctan2(level[..., 1], horizontal + level[..., 0])))
