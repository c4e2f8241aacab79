"""`simulate_gravity`: a body held still in many orientations, and how its sensors truly sit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from agonic.alignment.simulation.session import FIELD_N
from agonic.arrays import Array
from agonic.maths.rotations.attitude import make_rotation
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedGravity:
    """Samples with acceleration, and the true rotation from magnetometer to accelerometer."""

    samples: Samples
    rot_bm: Array


def simulate_gravity(
    *,
    orientations: int = 24,
    still_s: float = 3.0,
    turn_s: float = 2.0,
    rate_Hz: float = 50.0,
    turn_deg: float = 3.0,
    field_n: ArrayLike = FIELD_N,
    noise: float = 100.0,
    force_noise: float = 0.03,
    tilt_deg: float | None = None,
    bias: ArrayLike = (0.0, 0.0, 0.0),
    seed: int = 0,
) -> SimulatedGravity:
    """Stretches at rest with turns in between, in directions at random.

    Parameters
    ----------
    still_s, turn_s, rate_Hz : how long each lasts, and readings a second.
    turn_deg : size of the random rotation between the sensors' axes.
    noise : nT; force_noise : m/s². bias : of the magnetometer, nT.
    tilt_deg : the most that the body is tilted from level; `None`: all directions.

    Source: the constant angle of field and gravity, as in `fit_gravity`.

    >>> simulate_gravity(orientations=2).samples.acceleration.shape
    (401, 3)
    """
    rng = np.random.default_rng(seed)
    rot_bm = make_rotation(np.radians(turn_deg) * rng.standard_normal(3))
    begin = np.arange(orientations) * (still_s + turn_s)
    if tilt_deg is None:
        poses = Rotation.random(orientations, rng=rng)
    else:
        tilts = rng.uniform(-tilt_deg, tilt_deg, (2, orientations))
        angles = np.stack([rng.uniform(0, 360, orientations), *tilts], axis=1)
        poses = Rotation.from_euler("ZYX", angles, degrees=True)
    knots = np.stack([begin, begin + still_s], axis=1).ravel()
    path = Slerp(knots, poses[np.repeat(np.arange(orientations), 2)])
    time = np.arange(int(knots[-1] * rate_Hz) + 1) / rate_Hz
    rot_nb = path(np.minimum(time, knots[-1])).as_matrix()
    field_b = np.einsum("nji,j->ni", rot_nb, np.asarray(field_n))
    force = -STANDARD_GRAVITY_M_S2 * rot_nb[:, 2]
    samples = Samples(
        time=time,
        field=field_b @ rot_bm + np.asarray(bias) + noise * rng.standard_normal(field_b.shape),
        unit="nT",
        acceleration=force + force_noise * rng.standard_normal(force.shape),
    )
    return SimulatedGravity(samples=samples, rot_bm=rot_bm)
