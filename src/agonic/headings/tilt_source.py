"""`find_attitude`: the tilt at each sample: of the log, by accelerometer, gyro filter, or none; and
`mend_unit`: whether gyro and accelerometer turn as the compass does."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration, correct_field, has_two_axes
from agonic.calibration.setup import Setup
from agonic.calibration.steps import steps_of
from agonic.errors import LogError
from agonic.headings.acceleration import AT_REST, estimate_shaking, estimate_speed
from agonic.headings.attitude import LEVEL, RECORDED_SD_DEG, Attitude, find_stated_sd
from agonic.headings.gyro import FilteredDown, filter_down
from agonic.health.finding import figure
from agonic.health.inertial_unit import check_clipping, find_faults
from agonic.maths.rotations import tilt as kernel
from agonic.new_rows import find_fresh, interpolate_repeated
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2

LEVEL_SD_DEG = 3.0
"""Of a vehicle that is taken to be level, where nothing tells more."""

_Variances = tuple[Array | float, Array | float]


def find_attitude(samples: Samples, setup: Setup, calibration: Calibration) -> Attitude:
    """The tilt at each sample as the setup wants it; `calibration` knows how the sensor is mounted.

    "auto" takes what the log recorded, else the gyro filter, else the accelerometer.
    """
    source, why = _choose_source(samples, setup, calibration)
    samples, turn = interpolate_repeated(samples), find_mounting(calibration)
    felt: _Variances = (0.0, 0.0)
    if setup.accelerometer is not None and samples.acceleration is not None:
        samples, felt = calibrate_acceleration(samples, setup.accelerometer)
        turn = np.eye(3)
    if source == LEVEL:
        return _assume_level(samples, setup, turn)
    if source != "log":
        return _find_felt_tilt(samples, setup, source, why, turn, felt)
    roll, pitch = (_require_column(samples, name, "log") for name in ("roll_deg", "pitch_deg"))
    sd = np.full(1, find_stated_sd(setup))
    return Attitude(
        tilt=kernel.tilt_from_angles(roll, pitch),
        roll_deg=roll,
        pitch_deg=pitch,
        order=setup.tilt_order,
        source="log",
        roll_sd=sd,
        pitch_sd=sd,
        stated_sd=find_stated_sd(setup, 0.0),
        notes=why,
    )


def _require_column(samples: Samples, name: str, source: str) -> Array:
    values: Array | None = getattr(samples, name)
    if values is None:
        raise LogError(
            f"tilt from the {source} needs {name} and the samples of {samples.name} have none; "
            "record it, or take the tilt from elsewhere"
        )
    return values


def _choose_source(
    samples: Samples, setup: Setup, calibration: Calibration
) -> tuple[str, tuple[str, ...]]:
    """Where the tilt comes from, and why; a compass of two axes can only be level."""
    if has_two_axes(calibration):
        if setup.tilt not in ("auto", LEVEL):
            raise LogError(
                f"{samples.name} is a two-axis compass, whose field cannot be turned by a tilt "
                f'from the {setup.tilt}: say source = "level" under [tilt]'
            )
        return LEVEL, ()
    there = samples.columns()
    if setup.tilt != "auto" or {"roll_deg", "pitch_deg"} <= there.keys():
        return ("log" if setup.tilt == "auto" else setup.tilt), ()
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


def _find_felt_tilt(
    samples: Samples,
    setup: Setup,
    source: str,
    why: tuple[str, ...],
    turn: Array,
    felt: _Variances,
) -> Attitude:
    """The tilt from the accelerometer, followed by the gyro where that is the `source`.

    `turn` (3, 3) leads from the sensor's axes to those of the body. The sd holds the
    accelerometer's own errors too: those of a calibrated one are `felt`; one that feels a share
    more or less than gravity at rest is off by as much across.
    """
    force = _require_column(samples, "acceleration", source) @ turn.T
    time, rate = samples.time, samples.rotation_rate
    if source == "gyro":
        time, rate = (_require_column(samples, name, source) for name in ("time", "rotation_rate"))
    rate = None if rate is None else rate @ turn.T
    speed = AT_REST if time is None or rate is None else estimate_speed(samples, force, rate)
    down = kernel.down_from_force(force)
    if source == "gyro" and time is not None and rate is not None:
        found, speed = filter_down(time, force, rate, setup.settling_s, speed)
        if speed.taken:
            reckoned = f"the speed in turns is taken as {figure(speed.taken)} m/s"
            track = "" if samples.latitude_deg is None else ", and the track"
            why = (*why, f"{reckoned}, from the accelerometer in them{track}")
    elif time is None and setup.accelerometer is not None:  # calibrated by such shots
        found = FilteredDown(down, *np.zeros((2, len(force))))
        why = (*why, "each row is taken as a shot at rest")
    else:
        window_s = setup.settling_s
        if time is None:  # each row for itself
            time, rate, window_s = np.arange(float(len(force))), None, 1.0
        found = FilteredDown(down, *estimate_shaking(time, force, rate, speed, window_s))
    tilt = kernel.tilt_from_down(found.down)
    roll, pitch = kernel.roll_pitch_deg(tilt)
    own = find_stated_sd(setup) ** 2 + (speed.gravity / STANDARD_GRAVITY_M_S2 - 1.0) ** 2
    return Attitude(
        tilt=tilt,
        roll_deg=roll,
        pitch_deg=pitch,
        source=source,
        # about the level axis ahead, roll turns by 1/cos pitch as much
        roll_sd=np.sqrt(found.roll_sd**2 + own + felt[0]) / np.maximum(tilt.cos_pitch, 1e-3),
        pitch_sd=np.sqrt(found.pitch_sd**2 + own + felt[1]),
        stated_sd=find_stated_sd(setup, 0.0),
        gyro_bias=found.bias,
        gyro_bias_sd=found.bias_sd,
        missing=np.asarray(~np.isfinite(found.down).all(axis=1)),
        notes=why,
    )


def calibrate_acceleration(samples: Samples, accelerometer: Affine) -> tuple[Samples, _Variances]:
    """The samples with acceleration and rates in body axes, and what the calibration's own errors
    do to the tilt about the level axes ahead and across: variances (n,), rad²."""
    raw = samples.acceleration
    assert raw is not None
    force = accelerometer.correct(raw)
    changed = {"acceleration": force}
    if samples.rotation_rate is not None:
        changed["rotation_rate"] = samples.rotation_rate @ _find_axes(accelerometer).T
    samples = samples.with_columns(**changed)
    if accelerometer.covariance is None:
        return samples, (0.0, 0.0)
    down = kernel.down_from_force(force)
    right = np.cross(down, [1.0, 0.0, 0.0])
    length = np.linalg.norm(right, axis=1, keepdims=True)
    right = np.where(length > 1e-9, right / np.maximum(length, 1e-9), [0.0, 1.0, 0.0])
    spread = accelerometer.uncertainty(raw) / (force**2).sum(axis=1)[:, None, None]
    ahead, across = (
        np.einsum("ni,nij,nj->n", axis, spread, axis) for axis in (right, np.cross(right, down))
    )
    return samples, (ahead, across)


def _find_axes(accelerometer: Affine) -> Array:
    """The turn (3, 3) from the axes of an accelerometer to those that it is calibrated into."""
    return np.asarray(polar(accelerometer.matrix)[0])


def _assume_level(samples: Samples, setup: Setup, turn: Array) -> Attitude:
    """No tilt, and how level that is: by the setup, by what the log tells, or as a rule."""
    zero, sds = np.zeros(1), [np.full(1, find_stated_sd(setup, LEVEL_SD_DEG))] * 2
    notes: tuple[str, ...] = ()
    if setup.tilt_sd_deg is None:
        said = f"the vehicle is taken to be level to {LEVEL_SD_DEG:g}°; state its tilt_sd_deg"
        angles = _list_recorded(samples, turn)
        if len(angles[0]):
            rms = [float(np.sqrt(np.mean(a**2))) for a in angles]
            sds = [np.radians([np.hypot(one, RECORDED_SD_DEG)]) for one in rms]
            told = f"{figure(rms[0])}° of roll, {figure(rms[1])}° of pitch"
            said = f"the vehicle is taken to be level; by the log it was tilted by {told}, rms"
        notes = (said,)
    return Attitude(
        tilt=kernel.tilt_from_angles(zero, zero),
        roll_deg=zero,
        pitch_deg=zero,
        source=LEVEL,
        roll_sd=sds[0],
        pitch_sd=sds[1],
        notes=notes,
    )


def _list_recorded(samples: Samples, turn: Array) -> tuple[Array, Array]:
    """Roll and pitch that tell how level a vehicle was, from the log or from its accelerometer."""
    if samples.roll_deg is not None and samples.pitch_deg is not None:
        return samples.roll_deg, samples.pitch_deg
    if samples.acceleration is None:
        return np.empty(0), np.empty(0)
    down = kernel.down_from_force(samples.acceleration @ turn.T)
    roll, pitch = kernel.roll_pitch_deg(kernel.tilt_from_down(down))
    known = np.isfinite(roll)
    return roll[known], pitch[known]


def find_mounting(calibration: Calibration) -> Array:
    """The rotation (3, 3) from the sensor's axes to those of the calibrated field."""
    turn = np.eye(3)
    for step in steps_of(calibration):
        if isinstance(step, Alignment):
            turn = step.rotation.as_matrix() @ turn
    return turn


def find_rate_mounting(samples: Samples, setup: Setup, calibration: Calibration) -> Array:
    """The turn (3, 3) from the axes of the rates to those of the body."""
    if setup.accelerometer is not None and samples.acceleration is not None:
        return _find_axes(setup.accelerometer)
    return find_mounting(calibration)


def mend_unit(
    samples: Samples, setup: Setup, calibration: Calibration, *, smooth: bool
) -> tuple[Samples, tuple[str, ...]]:
    """The samples without a gyro or an accelerometer that does not turn as the calibrated field
    does, and what to say of it; as they are where neither is used, for no tilt and not to `smooth`.
    """
    recorded = samples.roll_deg is not None and samples.pitch_deg is not None
    needed = {
        "rotation_rate": setup.tilt == "gyro",
        "acceleration": setup.tilt in ("gyro", "accelerometer")
        or (setup.tilt == "auto" and not recorded),
    }
    used = smooth or any(needed.values())
    if not used or samples.time is None or has_two_axes(calibration):
        return samples, ()
    turn = find_rate_mounting(samples, setup, calibration)
    there = {"rotation_rate": samples.rotation_rate}
    if setup.accelerometer is None:  # which knows its own unit and axes
        there["acceleration"] = samples.acceleration
    turned = {name: values @ turn.T for name, values in there.items() if values is not None}
    compass = Samples(time=samples.time, field=correct_field(calibration, samples))
    notes = _describe_limits(samples)
    for column, finding, mended in find_faults(compass.with_columns(**turned)):
        if mended is None and needed[column]:
            raise LogError(finding.sentence)
        samples = samples.with_columns(**{column: None if mended is None else mended @ turn})
        out = "; it was left out" if finding.severity == "refuse" else ""
        notes.append("; ".join(part for part in (finding.what + out, finding.move) if part))
    return samples, tuple(notes)


def _describe_limits(samples: Samples) -> list[str]:
    """What a gyro that clips, or is slower than the log, cannot have told."""
    if samples.rotation_rate is None:
        return []
    clipped, fresh = check_clipping(samples), float(find_fresh(samples.rotation_rate).mean())
    said = [] if clipped is None else [clipped.sentence]
    if fresh < 1.0:
        said.append(
            f"the gyro has a new reading in one of {1 / fresh:.0f} rows only: faster turns are "
            "not seen, and the tilt may be off by more than is stated"
        )
    return said
