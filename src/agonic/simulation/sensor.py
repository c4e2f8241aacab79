"""`simulate`: readings of a magnetometer whose calibration is known."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.errors import AgonicError, LogError
from agonic.maths.one_pass import interpolate
from agonic.maths.rotations.attitude import angles_deg, yaw_pitch_roll
from agonic.readable import Readable
from agonic.samples import Samples
from agonic.simulation import motions, surface
from agonic.simulation.defects import Defect
from agonic.simulation.draws import draw_smooth, random_calibration
from agonic.simulation.flight import flight
from agonic.units import RAW, STANDARD_GRAVITY_M_S2


@dataclass(frozen=True, kw_only=True, eq=False)
class Simulated(Readable):
    """Readings and the truth behind them.

    `samples` what the sensor recorded, defects included; `truth` the calibration that undoes it;
    `field_n` (3,) Earth's field, north-east-down, nT; `field_b` (n, 3) the same in sensor axes at
    the attitude of each row; `facts` the settings that made it.
    """

    samples: Samples
    truth: Affine
    field_n: Array
    field_b: Array
    facts: Mapping[str, Any]


def kinds() -> tuple[str, ...]:
    """The motions that `simulate` knows."""
    return tuple(_MOTIONS)


_NO_FACTS = ("calibration", "counts_per_nT", "defects", "settings")


def simulate(
    kind: str,
    *,
    n: int = 3000,
    rate_Hz: float = 50.0,
    magnitude: float = 50_000.0,
    inclination_deg: float = 60.0,
    declination_deg: float = 0.0,
    noise: float = 200.0,
    calibration: Affine | None = None,
    counts_per_nT: float | None = None,
    defects: Iterable[Defect] = (),
    seed: int = 0,
    **settings: Any,
) -> Simulated:
    """Readings of a known magnetometer in a known field.

        raw = matrix⁻¹ @ field_b + bias + noise

    Parameters
    ----------
    kind : the motion, with settings of its own by keyword: "tumble" (pace_s), "sphere", "belt"
        (tilt_deg, axis), "hand", "circle" (tilt_deg, smooth, period_s), "flight" (vehicle, leg_s,
        turns_deg, stray_nT_A, full_current_A, latitude_deg, longitude_deg, altitude_m), "boat"
        (speed_m_s, leg_s, wave_s, roll_sd_deg, pitch_sd_deg, surge_sd_m_s2), "car" (speed_m_s,
        leg_s, slope_sd_deg) and "static" (heading_deg, pitch_deg, roll_deg);
        `simulation.motions`, `.flight` and `.surface` describe them.
    n, rate_Hz : number of rows and rows a second.
    magnitude, inclination_deg, declination_deg : Earth's field, nT and degrees.
    noise : standard deviation of one reading on one axis, in the unit the calibration takes in.
    calibration : the truth; drawn by `random_calibration` from the seed when not given.
    counts_per_nT : readings become raw counts of this sensitivity, and the truth with them.
    defects : applied to the samples in this order.
    seed : the same seed gives the same readings; motion, noise and calibration draw separately.

    Returns
    -------
    Simulated
        Samples with attitude and specific force, and for smooth motions rotation rate.

    Raises
    ------
    AgonicError
        For a kind or setting that does not exist.

    Examples
    --------
    >>> s = simulate("tumble", n=500, noise=0.0)
    >>> bool(np.allclose(s.truth.correct(s.samples.field), s.field_b))
    True
    """
    facts = {name: value for name, value in locals().items() if name not in _NO_FACTS}
    settings = _settings(kind, settings)
    facts |= settings
    for name, value in facts.items():
        if (name in ("n", "rate_Hz", "magnitude") or name.endswith("_s")) and not value > 0:
            raise AgonicError(f"{name} is {value}; a simulation needs it above zero")
    motion_rng, noise_rng, truth_rng = np.random.default_rng(seed).spawn(3)
    truth = random_calibration(truth_rng) if calibration is None else calibration
    truth = replace(truth, noise=noise, magnitude=magnitude)
    time = np.arange(n) / rate_Hz
    dip, east = np.radians(inclination_deg), np.radians(declination_deg)
    level = np.cos(dip)
    field_n = magnitude * np.array([level * np.cos(east), level * np.sin(east), np.sin(dip)])
    motion = _MOTIONS[kind](time, motion_rng, field_n, **settings)
    field_b = motion.rot_nb.apply(field_n, inverse=True) + motion.stray_b
    raw = field_b @ np.linalg.inv(truth.matrix).T + truth.bias
    raw += noise * noise_rng.standard_normal((n, 3))
    if counts_per_nT is not None:
        raw, truth = raw * counts_per_nT, _to_counts(truth, counts_per_nT)
    samples = _record(time, raw, truth, motion)
    for defect in defects:
        samples = defect(samples)
    return Simulated(
        samples=samples,
        truth=truth,
        field_n=field_n,
        field_b=_rot_nb(samples).apply(field_n, inverse=True),
        facts=MappingProxyType(facts),
    )


def _settings(kind: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """All settings of a kind: its defaults, and over them those that were given."""
    if kind not in _MOTIONS:
        raise AgonicError(f"no kind {kind!r} to simulate; choose from {', '.join(kinds())}")
    parameters = inspect.signature(_MOTIONS[kind]).parameters.values()
    defaults = {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}
    unknown = sorted(set(given) - set(defaults))
    if unknown:
        offer = ", ".join(defaults) or "none of its own"
        raise AgonicError(f"{kind!r} has no setting {', '.join(unknown)}; it takes {offer}")
    return defaults | dict(given)


def _to_counts(truth: Affine, counts_per_nT: float) -> Affine:
    """The same calibration for readings in counts."""
    if truth.unit_in == RAW:
        raise AgonicError("counts_per_nT needs a calibration in nT; this one takes counts already")
    return replace(
        truth,
        bias=truth.bias * counts_per_nT,
        matrix=truth.matrix / counts_per_nT,
        noise=None if truth.noise is None else truth.noise * counts_per_nT,
        unit_in=RAW,
    )


def _record(time: Array, raw: Array, truth: Affine, motion: motions.Motion) -> Samples:
    """The columns that a logger would have written."""
    roll, pitch, heading = angles_deg(motion.rot_nb.as_matrix())
    specific_force_n = motion.acceleration_n - np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])
    return Samples(
        time=time,
        field=raw,
        unit=truth.unit_in,
        roll_deg=roll,
        pitch_deg=pitch,
        heading_deg=heading,
        acceleration=motion.rot_nb.apply(specific_force_n, inverse=True),
        rotation_rate=motion.rotation_rate,
        name=truth.sensor,
        frame=truth.frame_in,
        notes=("simulated",),
    ).with_columns(**motion.columns)


def _rot_nb(samples: Samples) -> Rotation:
    """The attitude of each row, as recorded."""
    heading, pitch, roll = samples.heading_deg, samples.pitch_deg, samples.roll_deg
    if heading is None or pitch is None or roll is None:
        raise AgonicError("a defect took the attitude away; take it from the finished samples")
    return yaw_pitch_roll(heading, pitch, roll)


def with_inertial_unit(
    *,
    accelerometer_bias: float = 0.05,
    accelerometer_noise: float = 0.02,
    vibration: float = 0.0,
    push: float = 0.0,
    gyro_bias_deg_s: float = 0.5,
    gyro_noise: float = 8.7e-4,
    gyro_scale: float = 0.01,
    turn: ArrayLike = (0.0, 0.0, 0.0),
    late_s: float = 0.0,
    seed: int = 0,
) -> Defect:
    """The attitude taken away, and the errors of an inertial unit put in."""

    def defect(samples: Samples) -> Samples:
        time, force, rate = samples.time, samples.acceleration, samples.rotation_rate
        if time is None or force is None or rate is None:
            raise LogError("an inertial unit needs a motion with times, acceleration and rates")
        unit_rng, noise_rng, push_rng = np.random.default_rng(seed).spawn(3)
        drawn = unit_rng.standard_normal((3, 3))
        root = np.sqrt(1.0 / float(np.median(np.diff(time))))  # of the rate, in Hz
        turned = Rotation.from_rotvec(np.radians(turn)).as_matrix().T
        if late_s:
            then = time - late_s
            force, rate = (interpolate(then, time, values) for values in (force, rate))
        if push:
            pace = [draw_smooth(push_rng, time[-1], sd=push, pace_s=1.0) for _ in range(3)]
            force = force + np.stack([one(time) for one in pace], axis=1)
        noise = noise_rng.standard_normal((2, len(time), 3))
        shaken = np.hypot(accelerometer_noise * root, vibration)
        force = force @ turned + accelerometer_bias * drawn[0] + shaken * noise[0]
        rate = rate @ turned * (1.0 + gyro_scale * drawn[1])
        rate = rate + np.radians(gyro_bias_deg_s) * drawn[2] + gyro_noise * root * noise[1]
        return samples.with_columns(
            acceleration=force, rotation_rate=rate, roll_deg=None, pitch_deg=None, heading_deg=None
        )

    return defect


_MOTIONS: Mapping[str, Callable[..., motions.Motion]] = MappingProxyType(
    {
        "tumble": motions.tumble,
        "sphere": motions.sphere,
        "belt": motions.belt,
        "hand": motions.hand,
        "circle": motions.circle,
        "flight": flight,
        "boat": surface.boat,
        "car": surface.car,
        "static": motions.static,
    }
)
