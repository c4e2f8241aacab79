"""`simulate_vehicle`: a vehicle that flies level legs and banked turns, with all that disturbs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
from agonic.errors import AgonicError, check_choice
from agonic.field.decimal_year import decimal_year
from agonic.field.place import choose_model
from agonic.maths.rotations.attitude import angles_deg
from agonic.readable import Readable
from agonic.samples import Samples
from agonic.simulation.draws import draw_smooth, random_calibration
from agonic.simulation.flight import (
    Flown,
    Vehicle,
    compute_current_A,
    compute_position,
    fly,
    steer,
)
from agonic.simulation.motions import rate_of_change, rotation_rate
from agonic.units import RAW, STANDARD_GRAVITY_M_S2

Placing = Literal["apart", "opposite"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedVehicle(Readable):
    """The readings of a vehicle's magnetometers and the truth behind them.

    `samples` and `truths` one for each sensor, `truths` with the field of the current (their
    covariance unknown); `latency_s` by which the readings are late; `rot_nb`, `heading_deg` (n,)
    the true attitude and true heading of each row, without the errors that the samples carry;
    `field_n` (n, 3) Earth's field on the way, nT; `facts` the settings that made it.
    """

    samples: tuple[Samples, ...]
    truths: tuple[Interference, ...]
    latency_s: float
    rot_nb: Rotation
    heading_deg: Array
    field_n: Array
    facts: Mapping[str, Any]


_NO_FACTS = (
    *("sensors", "bias", "calibrations", "stray_nT_A", "motors_nT", "field_n"),
    *("latitude_deg", "longitude_deg", "altitude_m", "epoch"),
)


def simulate_vehicle(
    *,
    n: int = 12_000,
    rate_Hz: float = 50.0,
    vehicle: Vehicle = "plane",
    bank_deg: float = 27.0,
    leg_s: float = 12.0,
    sensors: int = 2,
    noise: float = 100.0,
    bias: float = 15_000.0,
    calibrations: Sequence[Affine] | None = None,
    placing: Placing = "apart",
    stray_nT_A: ArrayLike = ((60.0, -35.0, 90.0), (-25.0, 50.0, 40.0)),
    full_current_A: float = 25.0,
    motors_nT: ArrayLike = (),
    latency_s: float = 0.0,
    attitude_sd_deg: float = 0.3,
    heading_sd_deg: float | None = 0.5,
    correlation_s: float = 5.0,
    latitude_deg: float = 47.0,
    longitude_deg: float = 8.0,
    altitude_m: float = 500.0,
    epoch: datetime = datetime(2026, 5, 1, 10, 0, tzinfo=UTC),
    field_n: ArrayLike | None = None,
    seed: int = 0,
) -> SimulatedVehicle:
    """A flight of level legs and banked turns, without wind, seen by one or two magnetometers.

        raw(t) = matrix⁻¹ @ (rot_nb(t − τ)ᵀ field_n + stray · I(t − τ)) + bias + noise

    Parameters
    ----------
    n, rate_Hz : rows and rows a second.
    vehicle : "plane" or "copter", with their speeds; the plane's turns bank up to ± `bank_deg`.
    leg_s : seconds of a level leg.
    sensors : 1 or 2.
    noise : standard deviation of one reading on one axis, nT.
    bias : length of the bias that is drawn for each sensor, nT; soft iron is drawn too.
    calibrations : the truths, one for each sensor, in nT; drawn from the seed when not given.
    placing : "opposite" turns the second sensor's disturbance into the first's, with opposite sign.
    stray_nT_A : (3,) or one for each sensor: the field of an ampere at its place, body axes.
    full_current_A : current at full throttle.
    motors_nT : (k, 3) the field of each of k motors at full duty, body axes, where they disturb
        for themselves: a motor with duty d adds d^1.5 of it. The columns are `motor1_duty` ….
    latency_s : how late readings are beside all other columns.
    attitude_sd_deg : of the errors of roll and pitch on level legs, correlated over some
        `correlation_s`; under an acceleration a they are √(1 + (2a/g)²) times as large.
    heading_sd_deg : of the heading's error, correlated in the same way; None: no heading recorded.
    latitude_deg, longitude_deg, altitude_m, epoch : where and when the flight starts.
    field_n : (3,) Earth's field, nT; default: the world model's along the way.
    seed : the same seed gives the same flight; another with the same `calibrations` is another
        flight of the same vehicle.

    Returns
    -------
    SimulatedVehicle
        Samples with attitude, specific force, rotation rate, current, throttle and position.

    Raises
    ------
    AgonicError
        For a setting that makes no sense.

    Examples
    --------
    >>> flown = simulate_vehicle(n=500, noise=0.0)
    >>> first, truth = flown.samples[0], flown.truths[0]
    >>> field_b = truth.correct(first.field, current_A=first.current_A)
    >>> bool(np.allclose(flown.rot_nb.apply(field_b), flown.field_n, atol=1e-6))
    True
    """
    facts = {name: value for name, value in locals().items() if name not in _NO_FACTS}
    _check(facts, sensors, calibrations)
    generators = np.random.default_rng(seed).spawn(5)
    way_rng, noise_rng, truth_rng, attitude_rng, motor_rng = generators
    time = np.arange(n) / rate_Hz
    flown = fly(way_rng, time[-1] + abs(latency_s), vehicle=vehicle, leg_s=leg_s, bank_deg=bank_deg)
    given = calibrations or [random_calibration(truth_rng, bias=bias) for _ in range(sensors)]
    strays = np.asarray(motors_nT, dtype=np.float64).reshape(-1, 3)
    motors = [f"motor{k + 1}_duty" for k in range(len(strays))]
    added = (_strays(stray_nT_A, placing, sensors), strays)
    truths = _truths(given, *added, [f"{name}^1.5" for name in motors], noise)
    start = (latitude_deg, longitude_deg, altitude_m)
    common = _common(time, flown, start, epoch, full_current_A).with_columns(
        **_recorded_angles(
            attitude_rng, time, flown, attitude_sd_deg, heading_sd_deg, correlation_s
        ),
    )
    along = _field_n(field_n, common)
    then = time - latency_s
    field_then = flown.attitude(then).apply(along, inverse=True)
    disturbing = {"current_A": compute_current_A(flown.throttle(then), full_current_A)}
    if motors:
        duty = steer(motor_rng, time[-1] + abs(latency_s), flown.throttle, len(motors))
        disturbing |= dict(zip(motors, duty(then).T, strict=True))
        common = common.with_columns(disturbers=dict(zip(motors, duty(time).T, strict=True)))
    return SimulatedVehicle(
        samples=tuple(
            common.with_columns(
                field=_readings(field_then, disturbing, truth, noise_rng), name=truth.sensor
            )
            for truth in truths
        ),
        truths=truths,
        latency_s=latency_s,
        rot_nb=flown.attitude(time),
        heading_deg=angles_deg(flown.attitude(time).as_matrix())[2],
        field_n=along,
        facts=MappingProxyType(facts),
    )


def _check(facts: Mapping[str, Any], sensors: int, calibrations: Sequence[Affine] | None) -> None:
    check_choice("placing", facts["placing"], ("apart", "opposite"))
    for name, value in facts.items():
        if isinstance(value, float) and not np.isfinite(value):
            raise AgonicError(f"{name} is {value}; a simulation needs a number")
    if sensors not in (1, 2):
        raise AgonicError(f"sensors is {sensors}; a simulated vehicle has 1 or 2")
    if calibrations is not None and len(calibrations) != sensors:
        raise AgonicError(f"{len(calibrations)} calibrations were given for {sensors} sensors")
    if any(truth.unit_in == RAW for truth in calibrations or ()):
        raise AgonicError("the calibrations take raw counts; a simulated vehicle reads in nT")
    for name in ("n", "rate_Hz", "leg_s", "correlation_s"):
        if not facts[name] > 0:
            raise AgonicError(f"{name} is {facts[name]}; a simulation needs it above zero")


def _strays(stray_nT_A: ArrayLike, placing: Placing, sensors: int) -> Array:
    """The field of an ampere at each sensor, (sensors, 3), body axes."""
    given = np.atleast_2d(np.asarray(stray_nT_A, dtype=np.float64))
    if given.shape not in ((1, 3), (2, 3)):
        raise AgonicError(f"stray_nT_A has shape {given.shape}; give three numbers a sensor")
    if placing == "opposite":
        given = np.stack([given[0], -given[0]])
    elif len(given) == 1:
        given = np.repeat(given, 2, axis=0)
    return np.asarray(given[:sensors])


def _truths(
    given: Sequence[Affine], strays: Array, motors_nT: Array, motors: Sequence[str], noise: float
) -> tuple[Interference, ...]:
    """The calibrations with what current and motors add to the readings: matrix⁻¹ @ stray."""
    return tuple(
        Interference(
            **{f.name: getattr(truth, f.name) for f in fields(Affine)}
            | {"covariance": None, "noise": noise, "sensor": f"mag{number}"},
            sources=("current_A", *motors),
            coefficients=np.linalg.solve(truth.matrix, np.vstack([stray, motors_nT]).T),
        )
        for number, (truth, stray) in enumerate(zip(given, strays, strict=True), start=1)
    )


def _readings(
    field_b: Array, disturbing: Mapping[str, Array], truth: Interference, rng: np.random.Generator
) -> Array:
    """What a sensor reads of a field in body axes beside what disturbs it."""
    raw = field_b @ np.linalg.inv(truth.matrix).T + truth.bias
    raw = raw - truth.cleaned(np.zeros(3), **disturbing)
    return np.asarray(raw + (truth.noise or 0.0) * rng.standard_normal(raw.shape))


def _common(
    time: Array,
    flown: Flown,
    start: tuple[float, float, float],
    epoch: datetime,
    full_current_A: float,
) -> Samples:
    """What is recorded beside the readings, but for the attitude; the field is left at zero."""
    attitude, throttle = flown.attitude(time), flown.throttle(time)
    force_n = rate_of_change(flown.velocity_n, time) - np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])
    return Samples(
        field=np.zeros((len(time), 3)),
        unit="nT",
        time=time,
        epoch=epoch,
        acceleration=attitude.apply(force_n, inverse=True),
        rotation_rate=rotation_rate(flown.attitude, time),
        current_A=compute_current_A(throttle, full_current_A),
        throttle=throttle,
        notes=("simulated",),
    ).with_columns(**compute_position(time, flown.velocity_n(time), start))


def _field_n(given: ArrayLike | None, on_the_way: Samples) -> Array:
    """Earth's field (n, 3), the one that was given or that of the world model."""
    if given is not None:
        vector = np.asarray(given, dtype=np.float64)
        if vector.shape != (3,):
            raise AgonicError(f"field_n has shape {vector.shape}; it needs north, east and down")
        return np.tile(vector, (len(on_the_way), 1))
    assert on_the_way.epoch is not None, "_common sets it"
    model = choose_model(float(decimal_year(on_the_way.epoch)))
    return np.array(model.along(on_the_way).values)


def _recorded_angles(
    rng: np.random.Generator,
    time: Array,
    flown: Flown,
    attitude_sd_deg: float,
    heading_sd_deg: float | None,
    correlation_s: float,
) -> dict[str, Array]:
    """Roll, pitch and heading with the errors of an attitude filter, larger in manoeuvres."""
    roll, pitch, heading = angles_deg(flown.attitude(time).as_matrix())
    acceleration = np.linalg.norm(rate_of_change(flown.velocity_n, time), axis=1)
    larger = np.sqrt(1 + (2.0 * acceleration / STANDARD_GRAVITY_M_S2) ** 2)
    error = [draw_smooth(rng, time[-1], sd=1.0, pace_s=correlation_s)(time) for _ in range(3)]
    angles = {
        "roll_deg": roll + attitude_sd_deg * larger * error[0],
        "pitch_deg": pitch + attitude_sd_deg * larger * error[1],
    }
    if heading_sd_deg is not None:
        angles["heading_deg"] = (heading + heading_sd_deg * error[2]) % 360.0
    return angles
