"""`simulate_shots`: an instrument held still in many attitudes, and what would undo its errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup
from agonic.inertial.pair.solve import point_ahead
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.samples import Samples
from agonic.units import ACCELERATION, STANDARD_GRAVITY_M_S2


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedShots:
    """Shots, the true calibrations into the instrument's axes, and the true attitudes. The
    instrument's x is its sight. `rot_nb` (n,) turns its components into north, east, down, of the
    magnetic meridian; `sight` (3,) is in the axes of the accelerometer without its errors; `bad`
    are the rows beside iron."""

    samples: Samples
    magnetometer: Affine
    accelerometer: Affine
    rot_nb: Rotation
    sight: Array
    inclination_deg: float
    bad: Index

    def make_setup(self) -> Setup:
        """The true setup, with headings from magnetic north."""
        return Setup(
            compasses=(Compass(calibration=self.magnetometer),),
            tilt="accelerometer",
            accelerometer=self.accelerometer,
            declination_deg=0.0,
        )


def simulate_shots(
    *,
    attitudes: int = 8,
    targets: int = 2,
    rolls: int = 8,
    magnitude: float = 49_000.0,
    inclination_deg: float = 66.0,
    accelerometer_noise: float = 0.02,
    noise: float = 150.0,
    pointing_deg: float = 0.1,
    accelerometer_bias_sd: float = 0.3,
    accelerometer_shape_sd: float = 0.01,
    bias_sd: float = 20_000.0,
    soft_iron_sd: float = 0.05,
    turn_sd_deg: float = 2.0,
    sight_sd_deg: float = 1.0,
    tilt_deg: float | None = None,
    bad: int = 0,
    survey: int = 0,
    seed: int = 0,
) -> SimulatedShots:
    """Shots all over the sphere, and sets rolled about the sight on each of some targets.

    Parameters
    ----------
    attitudes : shots at no target. targets, rolls : how many targets, and shots at each.
    magnitude, inclination_deg : of the field, nT, degrees.
    accelerometer_noise, noise, pointing_deg : of one shot, m/s², nT and degrees, sd.
    accelerometer_bias_sd, accelerometer_shape_sd, bias_sd, soft_iron_sd : standard deviations of
        what is drawn: m/s², parts of one, nT, parts of one.
    turn_sd_deg, sight_sd_deg : the same of the mountings, degrees.
    bad : shots beside a lump of iron, which adds a twentieth of the field in some direction.
    tilt_deg : the most that shots at no target are tilted from level; `None`: all directions.
    survey : another number gives other shots by the same instrument, which `seed` draws.

    Examples
    --------
    >>> simulate_shots().samples.target.tolist()[6:10]
    [0.0, 0.0, 1.0, 1.0]
    """
    rng = np.random.default_rng(seed)
    off_axis = np.radians(sight_sd_deg if targets else 0.0)
    sight = np.array([1.0, *off_axis * rng.standard_normal(2)])
    body = point_ahead(sight)
    accelerometer = Affine(
        bias=accelerometer_bias_sd * rng.standard_normal(3),
        matrix=body @ _draw_shape(rng, accelerometer_shape_sd),
        unit_in=ACCELERATION,
        unit_out=ACCELERATION,
        gauge="free",
        frame_out="b",
        sensor="mag accelerometer",
    )
    turn = Rotation.from_rotvec(np.radians(turn_sd_deg) * rng.standard_normal(3)).as_matrix()
    magnetometer = Affine(
        bias=bias_sd * rng.standard_normal(3),
        matrix=body @ turn @ _draw_shape(rng, soft_iron_sd),
        gauge="free",
        magnitude=magnitude,
        frame_out="b",
    )
    rng = np.random.default_rng((seed, survey))
    angles, target = _choose_angles(rng, attitudes, targets, rolls, tilt_deg)
    on = target > 0
    off = pointing_deg * rng.standard_normal((int(on.sum()), 2))
    off[:, 0] /= np.cos(np.radians(angles[on, 1]))
    angles[on, :2] += off
    rot_nb = Rotation.from_euler("ZYX", angles, degrees=True)
    dip = np.radians(inclination_deg)
    field = rot_nb.apply([np.cos(dip), 0.0, np.sin(dip)], inverse=True) * magnitude
    force = rot_nb.apply([0.0, 0.0, -STANDARD_GRAVITY_M_S2], inverse=True)
    raw = field @ np.linalg.inv(magnetometer.matrix).T + magnetometer.bias
    felt = force @ np.linalg.inv(accelerometer.matrix).T + accelerometer.bias
    beside = rng.choice(len(raw), size=bad, replace=False)
    push = rng.standard_normal((bad, 3))
    raw[beside] += 0.05 * magnitude * push / np.linalg.norm(push, axis=1, keepdims=True)
    samples = Samples(
        field=raw + noise * rng.standard_normal(raw.shape),
        unit="nT",
        acceleration=felt + accelerometer_noise * rng.standard_normal(felt.shape),
        target=target,
    )
    return SimulatedShots(
        samples=samples,
        magnetometer=magnetometer,
        accelerometer=accelerometer,
        rot_nb=rot_nb,
        sight=sight / np.linalg.norm(sight),
        inclination_deg=inclination_deg,
        bad=np.sort(beside),
    )


def _draw_shape(rng: np.random.Generator, sd: float) -> Array:
    """A symmetric matrix near one."""
    return np.asarray(np.eye(3) + unpack_symmetric(sd * rng.standard_normal(6)))


def _choose_angles(
    rng: np.random.Generator, attitudes: int, targets: int, rolls: int, tilt_deg: float | None
) -> tuple[Array, Array]:
    """Azimuth, pitch and roll (n, 3), degrees, and the target (n,) of each shot."""
    if tilt_deg is None:
        free = Rotation.random(max(attitudes, 1), rng=rng).as_euler("ZYX", degrees=True)[:attitudes]
    else:
        tilts = rng.uniform(-tilt_deg, tilt_deg, (2, attitudes))
        free = np.stack([rng.uniform(0, 360, attitudes), *tilts], axis=1)
    parts, numbers = [free.reshape(-1, 3)], [np.zeros(attitudes)]
    for k in range(targets):
        azimuth, pitch = rng.uniform(0, 360), rng.uniform(-30, 30)
        roll = rng.uniform(0, 360) + 360.0 / rolls * np.arange(rolls)
        aimed = np.broadcast_to([azimuth, pitch], (rolls, 2))
        parts.append(np.column_stack([aimed, roll]))
        numbers.append(np.full(rolls, k + 1.0))
    return np.concatenate(parts), np.concatenate(numbers)
