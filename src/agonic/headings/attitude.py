"""The tilt of the vehicle at each sample: from the log, accelerometer, gyro filter, or none."""

from __future__ import annotations

from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.setup import Setup
from agonic.errors import LogError
from agonic.headings.gyro import down_by_gyro
from agonic.kernels import tilt as kernel
from agonic.samples import Samples

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

STANDARD_GRAVITY_M_S2 = 9.80665
ACCELERATED = 0.05
"""A specific force this much off gravity is more than a poor accelerometer reads at rest."""
LEVEL = "level"


class Attitude(NamedTuple):
    """The tilt, the order of its turns, where it came from, and rows on which it is in doubt."""

    tilt: kernel.Tilt
    roll_deg: Array
    pitch_deg: Array
    order: kernel.Order
    source: str
    missing: Rows | None = None
    accelerated: Rows | None = None
    notes: tuple[str, ...] = ()


def attitude(samples: Samples, setup: Setup, calibration: Calibration) -> Attitude:
    """The tilt at each sample as the setup wants it; `calibration` knows how the sensor is mounted.

    "auto" takes what the log recorded, else the gyro filter, else the accelerometer.
    """
    source = _automatic(samples) if setup.tilt == "auto" else setup.tilt
    if source == LEVEL:
        zero = np.zeros(1)
        return Attitude(kernel.of_angles(zero, zero), zero, zero, "roll-pitch", source)
    if source == "log":
        roll, pitch = _needed(samples, "roll_deg", source), _needed(samples, "pitch_deg", source)
        return Attitude(kernel.of_angles(roll, pitch), roll, pitch, setup.tilt_order, source)
    force = _needed(samples, "acceleration", source) @ mounting(calibration).T
    if source == "accelerometer":
        size = np.sqrt((force**2).sum(axis=1))
        return _felt(kernel.down_of_force(force), size, source, _why_not_gyro(samples, setup))
    time = _needed(samples, "time", source)
    rate = _needed(samples, "rotation_rate", source) @ mounting(calibration).T
    return _felt(*down_by_gyro(time, force, rate, setup.settling_s), source, ())


def _felt(down: Array, size: Array, source: str, notes: tuple[str, ...]) -> Attitude:
    """The tilt of a measured down, with the rows that have none or felt more than gravity."""
    missing = np.asarray(~np.isfinite(down).all(axis=1))
    accelerated = np.asarray(np.abs(size / STANDARD_GRAVITY_M_S2 - 1) > ACCELERATED)
    tilt = kernel.of_down(down)
    angles = kernel.roll_pitch_deg(tilt)
    return Attitude(tilt, *angles, "roll-pitch", source, missing, accelerated & ~missing, notes)


def _automatic(samples: Samples) -> str:
    there = samples.columns()
    if {"roll_deg", "pitch_deg"} <= there.keys():
        return "log"
    if {"acceleration", "rotation_rate", "time"} <= there.keys() and find_spec("vqf") is not None:
        return "gyro"
    if "acceleration" in there:
        return "accelerometer"
    raise LogError(
        f"the samples of {samples.name} have neither roll and pitch nor an accelerometer, so the "
        'tilt is not known; record one of them, or say tilt = "level" for a compass that stays '
        "level"
    )


def _why_not_gyro(samples: Samples, setup: Setup) -> tuple[str, ...]:
    if setup.tilt != "auto" or samples.rotation_rate is None or samples.time is None:
        return ()
    return ("tilt is from the accelerometer alone; pip install 'agonic[gyro]' lets the gyros help",)


def _needed(samples: Samples, name: str, source: str) -> Array:
    values: Array | None = getattr(samples, name)
    if values is None:
        raise LogError(
            f"tilt from the {source} needs {name} and the samples of {samples.name} have none; "
            "record it, or take the tilt from elsewhere"
        )
    return values


def mounting(calibration: Calibration) -> Array:
    """The rotation (3, 3) from the sensor's axes to those of the calibrated field.

    >>> from scipy.spatial.transform import Rotation
    >>> turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
    >>> mounting(turn).round(9)[0].tolist()
    [0.0, -1.0, 0.0]
    """
    steps = calibration.steps if isinstance(calibration, Chain) else (calibration,)
    turn = np.eye(3)
    for step in steps:
        if isinstance(step, Alignment):
            turn = step.rotation.as_matrix() @ turn
    return turn
