"""`find_attitude`: the tilt at each sample: of the log, by accelerometer, gyro filter, or none."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration, has_two_axes
from agonic.calibration.setup import Setup
from agonic.calibration.steps import steps_of
from agonic.errors import LogError
from agonic.headings.acceleration import (
    AT_REST,
    Speed,
    compute_track_square,
    compute_turn_rate,
    estimate_shaking,
    estimate_speed,
)
from agonic.headings.attitude import (
    LEVEL,
    LEVEL_SD_DEG,
    RECORDED_SD_DEG,
    Attitude,
    find_stated_sd,
    require_column,
)
from agonic.headings.gyro import FilteredDown, filter_down
from agonic.health.finding import figure
from agonic.maths.rotations import tilt as kernel
from agonic.new_rows import interpolate_repeated
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2


def find_felt_tilt(
    samples: Samples,
    setup: Setup,
    source: str,
    why: tuple[str, ...],
    turn: Array,
    felt: tuple[Array, Array] | None,
) -> Attitude:
    """The tilt from the accelerometer, followed by the gyro where that is the `source`.

    `turn` (3, 3) leads from the sensor's axes to those of the body, `felt` is what the errors of
    the accelerometer's calibration do.
    """
    force = require_column(samples, "acceleration", source) @ turn.T
    speed = AT_REST
    if source == "gyro":
        time = require_column(samples, "time", source)
        rate = require_column(samples, "rotation_rate", source) @ turn.T
        speed = _measure_speed(samples, force, rate)
        found, speed = filter_down(time, force, rate, setup.settling_s, speed)
        if speed.taken:
            reckoned = f"the speed in turns is taken as {figure(speed.taken)} m/s"
            track = "" if samples.latitude_deg is None else ", and the track"
            why = (*why, f"{reckoned}, from the accelerometer in them{track}")
    elif samples.time is None and setup.accelerometer is not None:  # calibrated by such shots
        still = np.zeros(len(force))
        found = FilteredDown(kernel.down_from_force(force), still, still)
        why = (*why, "each row is taken as a shot at rest")
    else:
        speed, sds = _measure_shaking(samples, setup, force, turn)
        found = FilteredDown(kernel.down_from_force(force), *sds)
    return _make_attitude(found, setup, source, speed, why, felt)


def calibrate_acceleration(
    samples: Samples, accelerometer: Affine
) -> tuple[Samples, tuple[Array, Array] | None]:
    """The samples with acceleration and rates in body axes, and what the calibration's own errors
    do to the tilt about the level axes ahead and across: variances (n,), rad².
    """
    raw = samples.acceleration
    assert raw is not None
    force = accelerometer.correct(raw)
    changed = {"acceleration": force}
    if samples.rotation_rate is not None:
        changed["rotation_rate"] = samples.rotation_rate @ find_axes(accelerometer).T
    if accelerometer.covariance is None:
        return samples.with_columns(**changed), None
    size = np.linalg.norm(force, axis=1, keepdims=True)
    down = kernel.down_from_force(force)
    right_axis = np.cross(down, [1.0, 0.0, 0.0])
    length = np.linalg.norm(right_axis, axis=1, keepdims=True)
    right_axis = np.where(length > 1e-9, right_axis / np.maximum(length, 1e-9), [0.0, 1.0, 0.0])
    spread = accelerometer.uncertainty(raw) / (size**2)[:, :, None]
    axes = right_axis, np.cross(right_axis, down)
    about = tuple(np.einsum("ni,nij,nj->n", axis, spread, axis) for axis in axes)
    return samples.with_columns(**changed), (about[0], about[1])


def find_axes(accelerometer: Affine) -> Array:
    """The turn (3, 3) from the axes of an accelerometer to those that it is calibrated into."""
    return np.asarray(polar(accelerometer.matrix)[0])


def _make_attitude(
    found: FilteredDown,
    setup: Setup,
    source: str,
    speed: Speed,
    notes: tuple[str, ...],
    felt: tuple[Array, Array] | None,
) -> Attitude:
    """The tilt of a measured down; its sd holds the accelerometer's own errors too.

    Those of a calibrated one are `felt`; one that feels a share more or less than gravity at rest
    is off by as much across.
    """
    tilt = kernel.tilt_from_down(found.down)
    scale = speed.gravity / STANDARD_GRAVITY_M_S2 - 1.0
    own = find_stated_sd(setup) ** 2 + scale**2
    ahead, across = (0.0, 0.0) if felt is None else felt
    # about the level axis ahead, roll turns by 1/cos pitch as much
    roll_sd = np.sqrt(found.roll_sd**2 + own + ahead) / np.maximum(tilt.cos_pitch, 1e-3)
    pitch_sd = np.sqrt(found.pitch_sd**2 + own + across)
    missing = np.asarray(~np.isfinite(found.down).all(axis=1))
    roll, pitch = kernel.roll_pitch_deg(tilt)
    return Attitude(
        tilt=tilt,
        roll_deg=roll,
        pitch_deg=pitch,
        order="roll-pitch",
        source=source,
        roll_sd=roll_sd,
        pitch_sd=pitch_sd,
        stated_sd=float(np.radians(setup.tilt_sd_deg or 0.0)),
        gyro_bias=found.bias,
        gyro_bias_sd=found.bias_sd,
        missing=missing,
        notes=notes,
    )


def _measure_speed(samples: Samples, force: Array, rate: Array) -> Speed:
    assert samples.time is not None
    turn = compute_turn_rate(samples.time, force, rate)
    return estimate_speed(samples.time, force, rate, compute_track_square(samples, turn))


def _measure_shaking(
    samples: Samples, setup: Setup, force: Array, turn: Array
) -> tuple[Speed, tuple[Array, Array]]:
    """What shakes the accelerometer, for a tilt from it alone: sds of roll and pitch, rad."""
    time, rate = samples.time, samples.rotation_rate
    speed = AT_REST
    if rate is not None:
        rate = rate @ turn.T
        speed = speed if time is None else _measure_speed(samples, force, rate)
    if time is None:  # each row for itself
        return speed, estimate_shaking(np.arange(float(len(force))), force, None, AT_REST, 1.0)
    return speed, estimate_shaking(time, force, rate, speed, setup.settling_s)


def find_attitude(samples: Samples, setup: Setup, calibration: Calibration) -> Attitude:
    """The tilt at each sample as the setup wants it; `calibration` knows how the sensor is mounted.

    "auto" takes what the log recorded, else the gyro filter, else the accelerometer.
    """
    source, why = _choose_source(samples, setup, calibration)
    samples = interpolate_repeated(samples)
    turn = find_mounting(calibration)
    felt: tuple[Array, Array] | None = None
    if setup.accelerometer is not None and samples.acceleration is not None:
        samples, felt = calibrate_acceleration(samples, setup.accelerometer)
        turn = np.eye(3)
    if source == LEVEL:
        return _assume_level(samples, setup, turn)
    if source == "log":
        return _take_recorded(samples, setup, why)
    return find_felt_tilt(samples, setup, source, why, turn, felt)


def _take_recorded(samples: Samples, setup: Setup, why: tuple[str, ...]) -> Attitude:
    """Roll and pitch of the log."""
    roll, pitch = (require_column(samples, name, "log") for name in ("roll_deg", "pitch_deg"))
    sd = np.full(1, find_stated_sd(setup))
    return Attitude(
        tilt=kernel.tilt_from_angles(roll, pitch),
        roll_deg=roll,
        pitch_deg=pitch,
        order=setup.tilt_order,
        source="log",
        roll_sd=sd,
        pitch_sd=sd,
        stated_sd=float(np.radians(setup.tilt_sd_deg or 0.0)),
        notes=why,
    )


def _choose_source(
    samples: Samples, setup: Setup, calibration: Calibration
) -> tuple[str, tuple[str, ...]]:
    """Where the tilt comes from, and why; a compass of two axes can only be level."""
    if not has_two_axes(calibration):
        return _choose_best(samples) if setup.tilt == "auto" else (setup.tilt, ())
    if setup.tilt not in ("auto", LEVEL):
        raise LogError(
            f"{samples.name} is a two-axis compass, whose field cannot be turned by a tilt from "
            f'the {setup.tilt}: say source = "level" under [tilt]'
        )
    return LEVEL, ()


def _assume_level(samples: Samples, setup: Setup, turn: Array) -> Attitude:
    """No tilt, and how level that is: by the setup, by what the log tells, or as a rule."""
    zero = np.zeros(1)
    roll_sd = pitch_sd = np.full(1, find_stated_sd(setup, LEVEL_SD_DEG))
    notes: tuple[str, ...] = ()
    if setup.tilt_sd_deg is None:
        angles = _list_recorded(samples, turn)
        if angles is None:
            said = f"the vehicle is taken to be level to {LEVEL_SD_DEG:g}°; state its tilt_sd_deg"
        else:
            rms = [np.full(1, np.sqrt(np.mean(np.radians(a) ** 2))) for a in angles]
            roll_sd, pitch_sd = (np.hypot(one, np.radians(RECORDED_SD_DEG)) for one in rms)
            told = ", ".join(
                f"{figure(float(np.degrees(r[0])))}° of {n}"
                for r, n in zip(rms, ("roll", "pitch"), strict=True)
            )
            said = f"the vehicle is taken to be level; by the log it was tilted by {told}, rms"
        notes = (said,)
    level = kernel.tilt_from_angles(zero, zero)
    return Attitude(
        tilt=level,
        roll_deg=zero,
        pitch_deg=zero,
        order="roll-pitch",
        source=LEVEL,
        roll_sd=roll_sd,
        pitch_sd=pitch_sd,
        notes=notes,
    )


def _list_recorded(samples: Samples, turn: Array) -> tuple[Array, Array] | None:
    """Roll and pitch that tell how level a vehicle was, from the log or from its accelerometer."""
    if samples.roll_deg is not None and samples.pitch_deg is not None:
        return samples.roll_deg, samples.pitch_deg
    if samples.acceleration is None:
        return None
    roll, pitch = kernel.roll_pitch_deg(
        kernel.tilt_from_down(kernel.down_from_force(samples.acceleration @ turn.T))
    )
    known = np.isfinite(roll)
    return (roll[known], pitch[known]) if known.any() else None


def _choose_best(samples: Samples) -> tuple[str, tuple[str, ...]]:
    """The best source that there is, and why it is that one."""
    there = samples.columns()
    if {"roll_deg", "pitch_deg"} <= there.keys():
        return "log", ()
    if {"acceleration", "rotation_rate", "time"} <= there.keys():
        if find_spec("vqf") is not None:
            return "gyro", ("the log has no roll and pitch: tilt is by the gyro filter",)
        return "accelerometer", (
            "the log has no roll and pitch: tilt is from the accelerometer alone; "
            "pip install 'agonic[gyro]' lets the gyros help",
        )
    if "acceleration" in there:
        return "accelerometer", (
            "the log has neither roll and pitch nor a gyro to use: tilt is from the accelerometer "
            "alone",
        )
    raise LogError(
        f"the samples of {samples.name} have neither roll and pitch nor an accelerometer, so the "
        'tilt is not known; record one of them, or say tilt = "level" for a compass that stays '
        "level"
    )


def find_mounting(calibration: Calibration) -> Array:
    """The rotation (3, 3) from the sensor's axes to those of the calibrated field.

    >>> from scipy.spatial.transform import Rotation
    >>> turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
    >>> find_mounting(turn).round(9)[0].tolist()
    [0.0, -1.0, 0.0]
    """
    turn = np.eye(3)
    for step in steps_of(calibration):
        if isinstance(step, Alignment):
            turn = step.rotation.as_matrix() @ turn
    return turn
