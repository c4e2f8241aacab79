"""`find_attitude`: the tilt at each sample: of the log, by accelerometer, gyro filter, or none."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration, has_two_axes
from agonic.calibration.setup import Setup
from agonic.calibration.steps import steps_of
from agonic.errors import LogError
from agonic.headings.attitude import (
    LEVEL,
    LEVEL_SD_DEG,
    RECORDED_SD_DEG,
    Attitude,
    find_stated_sd,
    require_column,
)
from agonic.headings.felt_tilt import calibrate_acceleration, find_felt_tilt
from agonic.health.finding import figure
from agonic.maths.rotations import tilt as kernel
from agonic.new_rows import without_held
from agonic.samples import Samples


def find_attitude(samples: Samples, setup: Setup, calibration: Calibration) -> Attitude:
    """The tilt at each sample as the setup wants it; `calibration` knows how the sensor is mounted.

    "auto" takes what the log recorded, else the gyro filter, else the accelerometer.
    """
    source, why = _choose_source(samples, setup, calibration)
    samples = without_held(samples)
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
            said = f"the vehicle is taken to be level; by the log it was off by {told}, rms"
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
