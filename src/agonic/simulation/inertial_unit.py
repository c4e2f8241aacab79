"""What a real accelerometer and gyro make of a motion: a log without any attitude."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from agonic.errors import LogError
from agonic.maths.rotations.vectors import interpolate
from agonic.samples import Samples
from agonic.simulation.defects import Defect
from agonic.simulation.draws import draw_smooth


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
    """The attitude taken away, and the errors of an inertial unit put in.

    Parameters
    ----------
    accelerometer_bias, gyro_bias_deg_s, gyro_scale : standard deviations of what is drawn for each
        axis, m/s², degrees a second, and parts of one.
    accelerometer_noise, gyro_noise : noise densities, m/s²/√Hz and rad/s/√Hz.
    vibration : noise of one reading of the accelerometer beside that, m/s².
    push : standard deviation of acceleration that comes and goes within seconds, m/s².
    turn : rotation vector from the axes of the readings to those of the unit, degrees.
    late_s : how late its readings are recorded.
    seed : the same seed gives the same unit and noise.

    >>> from agonic.simulation import simulate
    >>> logged = with_inertial_unit()(simulate("circle", n=100).samples)
    >>> logged.roll_deg is None, logged.rotation_rate.shape
    (True, (100, 3))
    """

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
