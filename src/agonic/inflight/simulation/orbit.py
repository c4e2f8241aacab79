"""`simulate_orbit`: a magnetometer on a small satellite, with all that moves its bias."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, check_choice
from agonic.field.decimal_year import decimal_year
from agonic.field.place import choose_model
from agonic.inflight.simulation import aboard
from agonic.inflight.simulation.kepler import Orbit
from agonic.maths.rotations.attitude import angles_deg
from agonic.readable import Readable
from agonic.samples import Samples
from agonic.simulation.draws import draw_directions
from agonic.simulation.thermal import random_drifting
from agonic.units import RAW


def simulate_ground(
    made: SimulatedOrbit, *, n: int = 4000, noise: float = 100.0, seed: int = 0
) -> tuple[Samples, Array]:
    """`n` readings of the same sensor in a coil, one a second, and the field (n, 3), body axes, nT:
    in all directions with the magnitudes of an orbit, between −30 and 50 °C and back in ten
    minutes."""
    rng = np.random.default_rng((seed, 7))
    time = np.arange(float(n))
    low, high = RANGE_C
    temperature = (low + high) / 2 - (high - low) / 2 * np.cos(2 * np.pi * time / 600.0)
    # fields of the coil, nT: those that an orbit meets
    field_m = draw_directions(rng, n) * rng.uniform(20_000.0, 55_000.0, (n, 1))
    raw = _simulate_readings(made.ground, field_m, temperature)
    samples = Samples(
        time=time,
        field=raw + noise * rng.standard_normal((n, 3)),
        unit="nT",
        temperature=temperature,
        name=made.samples.name,
        notes=("simulated",),
    )
    return samples, np.asarray(made.rot_bm.apply(field_m))


POINTINGS = ("nadir", "tumble")
DIPOLES = ("torquer_x_Am2", "torquer_y_Am2", "torquer_z_Am2")
RANGE_C = (-30.0, 50.0)
"""Temperatures between which a drawn sensor's bias changes by as much as was asked."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedOrbit(Readable):
    """The readings of a satellite's magnetometer and the truth behind them.

    `samples` what was recorded; `ground` the calibration as it was on the ground, and `truth` as
    it is in flight before it drifts, both from readings to the field in the sensor's own axes and
    with the temperature, their covariance unknown; `bias` (n, 3) nT in each row, the drift and
    the jump included; `rot_bm` from sensor to body axes; `rot_nb` the true attitude; `field_n`
    (n, 3) the field met, `external_n` the part of it that no model of the Earth has; `eclipse`
    (n,) whether the satellite is in shadow; `facts` the settings.
    """

    samples: Samples
    ground: Thermal
    truth: Thermal
    bias: Array
    rot_bm: Rotation
    rot_nb: Rotation
    field_n: Array
    external_n: Array
    eclipse: Mask
    facts: Mapping[str, Any]

    def field_m(self) -> Array:
        """The field met, in sensor axes (n, 3), nT: what a perfect calibration gives."""
        return np.asarray((self.rot_nb * self.rot_bm).apply(self.field_n, inverse=True))


def simulate_orbit(
    *,
    n: int = 86_400,
    rate_Hz: float = 1.0,
    orbit: Orbit | None = None,
    epoch: datetime = datetime(2026, 5, 1, tzinfo=UTC),
    pointing: aboard.Pointing = "nadir",
    pace_s: float = 300.0,
    noise: float = 100.0,
    step: float = 0.0,
    sensor: Affine | Thermal | None = None,
    bias: float = 20_000.0,
    thermal: float = 2_000.0,
    moved: float = 0.0,
    drift: float = 0.0,
    walk_nT_h: float = 0.0,
    jump: float = 0.0,
    jump_at: float = 0.5,
    external: float = 20.0,
    correlation_s: float = 7_200.0,
    torquer: float = 0.0,
    torquer_share: float = 0.2,
    torquer_settling_s: float | None = None,
    scalar_sd: float | None = None,
    attitude_sd_deg: float | None = 0.0,
    mounting_deg: float = 0.0,
    equilibrium_C: tuple[float, float] = (-15.0, 35.0),
    settling_s: float = 1_500.0,
    seed: int = 0,
) -> SimulatedOrbit:
    """Readings of a magnetometer in orbit, with all that moves its bias, and the truth.

    The world model and what lies outside it, seen through a bias that follows temperature and time:

        raw = matrix(T)⁻¹ @ rot_bmᵀ rot_nbᵀ (field_n + external_n) + bias(T) + drift(t) + noise

    Parameters
    ----------
    n, rate_Hz : rows and rows a second; the default is a day.
    orbit : its elements; default 500 km, nearly polar, circular.
    epoch : UTC moment of the first row.
    pointing : "nadir", x forward and z down with a wobble of some degrees, or "tumble", all
        attitudes smoothly; either turns noticeably in `pace_s` seconds.
    noise : standard deviation of one reading on one axis, nT. step : its quantisation, nT.
    sensor : the truth on the ground, in nT; drawn from the seed when not given, with a bias of
        length `bias`, nT, whose axes change by up to `thermal` nT over −30…50 °C.
    moved : how far the bias has moved from ground to flight, nT, in a random direction.
    drift : how far it then moves steadily to the end. walk_nT_h : its random walk on each axis,
        nT in the first hour, √t times as much in t hours. jump : a step at `jump_at` (0…1) of
        the time, nT.
    external : standard deviation of the field of the ring current along the axis of the Earth's
        dipole, nT, half of it across; Gauss–Markov over `correlation_s`.
    torquer : field of the magnetic torquers, nT, in pulses that fill a `torquer_share` of the
        time and are marked in the column `flagged`; 0 for none. With `torquer_settling_s` the
        dipoles they are told to make are recorded instead, as torquer_x_Am2 and so on, 0.2 A m² in
        a pulse, and the field follows a switch with this time constant, s.
    scalar_sd : noise of a scalar magnetometer beside it, nT; None for none.
    attitude_sd_deg : white noise of the recorded attitude about each axis; None: none recorded.
    mounting_deg : by how much the sensor is turned in the body, about a random axis.
    equilibrium_C, settling_s : temperatures in shadow and sunlight, and how fast they are reached.
    seed : the same seed gives the same orbit; all that is random draws separately.

    Returns
    -------
    SimulatedOrbit
        Samples with temperature, position, and as asked for attitude, scalar reading and flags.

    Raises
    ------
    AgonicError
        For a setting that makes no sense.

    Source: Vallado, Fundamentals of Astrodynamics, section 9.6, for the orbit; the world models of
    IAGA and NOAA for the field.

    Examples
    --------
    >>> made = simulate_orbit(n=600, noise=0.0, thermal=0.0, drift=50.0)
    >>> field = (made.samples.field - made.bias) @ made.truth.matrix_at([20.0])[0].T
    >>> bool(np.allclose(field, made.field_m()))
    True
    """
    facts = {name: value for name, value in locals().items() if name not in ("sensor", "orbit")}
    _check(facts)
    rngs = _Generators(*np.random.default_rng(seed).spawn(len(_Generators._fields)))
    time = np.arange(n) / rate_Hz
    way = aboard.find_way(orbit or Orbit(), time, epoch)
    rot_nb = aboard.draw_attitude_nb(rngs.attitude, time, way, pointing, pace_s)
    rot_bm = Rotation.from_rotvec(np.radians(mounting_deg) * draw_directions(rngs.mounting, 1)[0])
    temperature = aboard.follow_temperature(way, time, equilibrium_C, settling_s)
    outside_n = aboard.draw_external_n(rngs.external, time, way, external, correlation_s)
    track = Samples(field=np.zeros((n, 3)), time=time, epoch=epoch).with_columns(**way.columns)
    field_n = choose_model(float(decimal_year(epoch))).along(track).values + outside_n
    ground = _draw_ground(sensor, rngs.sensor, bias, thermal)
    truth = _move_bias(ground, moved * draw_directions(rngs.moved, 1)[0])
    course = {"drift": drift, "walk_nT_h": walk_nT_h, "jump": jump, "at": jump_at}
    moving = aboard.draw_drift(rngs.drift, time, **course)
    field_m = (rot_nb * rot_bm).apply(field_n, inverse=True)
    pulsed, on = aboard.draw_pulses(rngs.torquer, time, torquer, torquer_share)
    told = torquer > 0 and torquer_settling_s is not None
    raw = _simulate_readings(truth, field_m, temperature) + moving
    raw = raw + aboard.settle(pulsed, time, torquer_settling_s or 0.0)
    raw = raw + noise * rngs.noise.standard_normal((n, 3))
    samples = Samples(
        field=np.round(raw / step) * step if step else raw,
        unit="nT",
        time=time,
        epoch=epoch,
        temperature=temperature,
        scalar=_read_scalar(field_n, scalar_sd, rngs.scalar),
        flagged=on.astype(float) if torquer and not told else None,
        disturbers=dict(zip(DIPOLES, pulsed.T * (0.2 / torquer), strict=True)) if told else {},
        notes=("simulated",),
    )
    seen = _record_attitude(rot_nb, attitude_sd_deg, rngs.star)
    return SimulatedOrbit(
        samples=samples.with_columns(**way.columns, **seen),
        ground=ground,
        truth=truth,
        bias=truth.bias_at(temperature) + moving,
        rot_bm=rot_bm,
        rot_nb=rot_nb,
        field_n=field_n,
        external_n=outside_n,
        eclipse=way.eclipse,
        facts=MappingProxyType(facts),
    )


_ZERO_OR_MORE = "a simulation needs zero or more"


_Generators = namedtuple(
    "_Generators", "attitude mounting external sensor moved drift torquer noise scalar star"
)
"""A source of chance for each thing, so that one setting does not change the others."""


def _check(facts: Mapping[str, Any]) -> None:
    check_choice("pointing", facts["pointing"], POINTINGS)
    for names, most, least in (
        ("n rate_Hz pace_s correlation_s settling_s", np.inf, "a simulation needs it above zero"),
        ("noise step external torquer scalar_sd attitude_sd_deg", np.inf, _ZERO_OR_MORE),
        ("jump_at torquer_share", 1.0, "it needs a share from 0 to 1"),
    ):
        for name in names.split():
            value = 1.0 if facts[name] is None else facts[name]
            if not 0 <= value <= most or (value == 0 and least.endswith("above zero")):
                raise AgonicError(f"{name} is {facts[name]}; {least}")


def _draw_ground(
    sensor: Affine | Thermal | None, rng: np.random.Generator, bias: float, thermal: float
) -> Thermal:
    """The calibration as a function of temperature: the given one, or one that is drawn."""
    if isinstance(sensor, Thermal):
        return sensor
    low, high = RANGE_C
    if sensor is not None:
        if sensor.unit_in == RAW:
            raise AgonicError("the sensor takes raw counts; a simulated satellite reads in nT")
        return Thermal(
            bias=sensor.bias[None], matrix=sensor.matrix[None], centre_C=0.0, half_range_C=1.0
        )
    drawn = random_drifting(
        rng,
        centre_C=(low + high) / 2,
        half_range_C=(high - low) / 2,
        bias=bias,
        drift=thermal,
        gain_drift=0.0,
    )
    made = {name: getattr(drawn, name) for name in ("bias", "matrix", "centre_C", "half_range_C")}
    return Thermal(**made, validity=Validity(temperature_C=RANGE_C))


def _move_bias(ground: Thermal, shift: Array) -> Thermal:
    """The calibration with its bias moved by the same at all temperatures."""
    return replace(ground, bias=np.vstack([ground.bias[:1] + shift, ground.bias[1:]]))


def _read_scalar(field: Array, sd: float | None, rng: np.random.Generator) -> Array | None:
    """What a scalar magnetometer of such noise reads; `None` without one."""
    if sd is None:
        return None
    return np.asarray(np.linalg.norm(field, axis=1) + sd * rng.standard_normal(len(field)))


def _record_attitude(
    rot_nb: Rotation, sd_deg: float | None, rng: np.random.Generator
) -> dict[str, Array]:
    """The attitude as a star camera gives it, by the names of its columns; none without one."""
    if sd_deg is None:
        return {}
    turns = np.radians(sd_deg) * rng.standard_normal((len(rot_nb), 3))
    angles = angles_deg((rot_nb * Rotation.from_rotvec(turns)).as_matrix())
    return dict(zip(("roll_deg", "pitch_deg", "heading_deg"), angles, strict=True))


def _simulate_readings(truth: Thermal, field_m: Array, temperature: Array) -> Array:
    """What the sensor reads of a field in its own axes: matrix⁻¹(T) @ field + bias(T)."""
    seen = np.linalg.solve(truth.matrix_at(temperature), field_m[:, :, None])[:, :, 0]
    return np.asarray(seen + truth.bias_at(temperature))
