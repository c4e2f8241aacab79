"""`plan_placement`: the best places of two magnetometers, and the deviation to expect there."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Annotated

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations import deviation
from agonic.placement.disturbance import (
    Disturbance,
    Service,
    deviate,
    disturb,
    draw_service,
    draw_vehicles,
    steer,
)
from agonic.placement.layout import Layout
from agonic.placement.search import Ensemble, score, search
from agonic.readable import Shown

SWING = tuple(product((0.0, 10.0, -10.0), repeat=2))
"""Roll and pitch of the swing, degrees: the heel at which handbooks take the heeling deviation
(NGA 2004)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ExpectedCompass:
    """What is to be expected of a compass: the mean over vehicles built after the list, and the
    standard deviation of one of them.

    Parameters
    ----------
    coefficients : A to E, degrees, then heeling deviation, degrees per degree, (9,) in the order of
        `maths.rotations.deviation`, with all currents at their mean; sd likewise.
    heading_deg : the heading's error in service, rms, noise among it.
    interference : what each current adds from its least to its most, nT (c,).
    interference_deg : error of the heading, rms, by currents that differ from their mean.
    """

    name: Annotated[str, Shown("Compass")]
    coefficients: Annotated[Array, Shown(key="coefficients_deg")]
    coefficients_sd: Annotated[Array, Shown(key="coefficients_sd_deg")]
    heading_deg: Annotated[float, Shown("Heading error", "°", sd="heading_sd_deg")]
    heading_sd_deg: Annotated[float, Shown()]
    interference: Annotated[Array, Shown(key="interference_nT")]
    interference_sd: Annotated[Array, Shown(key="interference_sd_nT")]
    interference_deg: Annotated[float, Shown("By currents", "°", sd="interference_sd_deg")]
    interference_sd_deg: Annotated[float, Shown()]


@dataclass(frozen=True, kw_only=True, eq=False)
class Placement:
    """Where magnetometers should sit on a vehicle.

    Parameters
    ----------
    alone : the best place of one, m. first, second : the best places of two, whose readings are
        mixed by raw₁ − G (raw₂ − raw₁) with G = `mix` (3, 3).
    compasses : what to expect of one alone, of the first and the second by themselves, of their
        mix, and of their mean (G = −½).
    """

    layout: Layout
    ensemble: Ensemble
    alone: Annotated[Array, Shown(key="alone_m")]
    first: Annotated[Array, Shown(key="first_m")]
    second: Annotated[Array, Shown(key="second_m")]
    mix: Annotated[Array, Shown(key="matrix")]
    compasses: Annotated[tuple[ExpectedCompass, ...], Shown()]

    def map_error_deg(self, at: Array) -> Array:
        """Heading error of one magnetometer alone at places (p, 3), m; rms in service, degrees."""
        parts = np.array_split(at, max(len(at) // 10, 1))
        return np.concatenate([np.diag(score(self.ensemble, part)[0]) for part in parts])


def plan_placement(
    layout: Layout, *, calibrated: bool = False, vehicles: int = 300, seed: int = 0
) -> Placement:
    """The places of two magnetometers whose mix errs least in service, and what to expect there.

    The error of a heading is averaged over headings, tilts and currents in service, and over
    vehicles that differ from the list as its standard deviations let them. What is expected of the
    places that were found comes from vehicles that the search has not seen.

    Source: Kharchenko, Larin & Shinkarenko (document 001): a second sensor where disturbances are
    equal and opposite; here by the best linear unbiased combination of the two.
    """
    rng = np.random.default_rng(seed)
    ensemble = Ensemble(
        layout,
        draw_vehicles(layout, vehicles, rng),
        draw_service(layout, vehicles, rng, calibrated),
        calibrated,
    )
    alone, pair, mix = search(ensemble)
    built = draw_vehicles(layout, vehicles, rng)
    service = draw_service(layout, 720, rng, calibrated)  # an rms is good to 1/√(2 · 720)

    def expect(name: str, at: Array, mix: Array) -> ExpectedCompass:
        made = disturb(layout, built, at + built.mounting, calibrated)
        middle = np.mean(layout.current_limits, axis=0) * (not calibrated)
        return expect_compass(name, layout, mix_places(made, mix), service, mix, middle)

    single, swapped, mean = np.zeros((3, 3)), -np.eye(3), -np.eye(3) / 2
    return Placement(
        layout=layout,
        ensemble=ensemble,
        alone=alone,
        first=pair[0],
        second=pair[1],
        mix=mix,
        compasses=(
            expect("one alone", np.stack([alone, alone]), single),
            expect("first by itself", pair, single),
            expect("second by itself", pair, swapped),
            expect("both mixed", pair, mix),
            expect("mean of both", pair, mean),
        ),
    )


def mix_places(made: Disturbance, mix: Array) -> Disturbance:
    """What two places make of a mix: d₁ − G (d₂ − d₁), as at one place (k, …)."""
    own, other = np.eye(3) + mix, -mix
    return Disturbance(
        made.hard[:, 0] @ own.T + made.hard[:, 1] @ other.T,
        own @ made.soft[:, 0] + other @ made.soft[:, 1],
        made.per_ampere[:, 0] @ own.T + made.per_ampere[:, 1] @ other.T,
    )


def expect_compass(
    name: str, layout: Layout, made: Disturbance, service: Service, mix: Array, middle: Array
) -> ExpectedCompass:
    """What to expect of a compass in vehicles (k) that disturb it by `made`.

    Every vehicle is swung, level and heeled, with its currents at their mean, `middle` (c,), A, and
    the nine coefficients are those of least squares; then it goes through all of `service`.
    """
    horizontal = layout.horizontal
    low, high = layout.current_limits
    coefficients = swing(layout, made, middle)
    error = deviate(service, made.add_up(*service[1:]), horizontal)
    changed = error - deviate(service, made.add_up(service.field_b, middle[None]), horizontal)
    east = service.rot_nb[:, 1]
    gains = np.square(east @ (np.eye(3) + mix)).sum(axis=1) + np.square(east @ mix).sum(axis=1)
    noise_deg = np.degrees(layout.sensor.noise_nT * np.sqrt(gains.mean()) / horizontal)
    heading = np.hypot(np.sqrt(np.square(error).mean(axis=0)), noise_deg)
    added = np.linalg.norm(made.per_ampere, axis=2) * (high - low)
    by_current = np.sqrt(np.square(changed).mean(axis=0))
    return ExpectedCompass(
        name=name,
        coefficients=coefficients.mean(axis=0),
        coefficients_sd=coefficients.std(axis=0),
        heading_deg=float(heading.mean()),
        heading_sd_deg=float(heading.std()),
        interference=added.mean(axis=0),
        interference_sd=added.std(axis=0),
        interference_deg=float(by_current.mean()),
        interference_sd_deg=float(by_current.std()),
    )


def swing(layout: Layout, made: Disturbance, currents: Array) -> Array:
    """A to E and heeling deviation (k, 9) of vehicles (k), swung round at every tilt of `SWING`."""
    tilts = np.array(SWING)
    heading = np.tile(np.arange(0.0, 360.0, 15.0), len(tilts))
    roll, pitch = np.repeat(tilts, len(heading) // len(tilts), axis=0).T
    steered = steer(layout, (roll, pitch, heading), currents[None])
    error = deviate(steered, made.add_up(*steered[1:]), layout.horizontal)
    rows = deviation.basis(heading - error.T, roll, pitch)
    normal = np.einsum("kni,knj->kij", rows, rows)
    pull = np.einsum("kni,nk->ki", rows, error)
    return np.asarray(np.linalg.solve(normal, pull[..., None])[..., 0])
