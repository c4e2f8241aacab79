"""A rover driven along a list of legs, as its raw magnetometer, accelerometer and gyro tell."""

import numpy as np
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.maths.rotations.tilt import down_from_force, heading_by_vectors_deg
from agonic.simulation import with_inertial_unit

RATE_HZ = 10.0
TURN_DEG_S = 20.0
AT, ON = "52.1,5.2", "2026-03-01"
HERE = ag.wmm().at(52.1, 5.2, 0.0, ON)
FIELD_N = np.array([np.hypot(HERE.north, HERE.east), 0.0, HERE.down], dtype=float)
PLACE = ag.Reference.vector(FIELD_N, frame="n")
BIAS = np.array([3000.0, -5000.0, 8000.0])
MATRIX = np.eye(3) + np.array([[0.02, 0.01, -0.02], [0.01, -0.03, 0.015], [-0.02, 0.015, 0.01]])
NOISE = 100.0


def turn(first, last, slope_deg=0.0):
    """A turn from one heading to another on ground that slopes: heading, pitch, roll."""
    heading = np.linspace(first, last, int(abs(last - first) / TURN_DEG_S * RATE_HZ))
    along = np.radians(heading)
    return heading, slope_deg * np.cos(along), slope_deg * np.sin(along)


def stand(heading, pitch=0.0, roll=0.0, seconds=6.0):
    """A stand on a ramp."""
    return tuple(np.full(int(seconds * RATE_HZ), v) for v in (heading, pitch, roll))


def drive(*legs, seed=0):
    """The samples of legs one after another, tilts taken smoothly."""
    rng = np.random.default_rng(seed)
    heading, pitch, roll = (np.concatenate([leg[i] for leg in legs]) for i in range(3))
    pitch, roll = (_smooth(angle) for angle in (pitch, roll))
    rot_nb = Rotation.from_euler("ZYX", np.stack([heading, pitch, roll], axis=1), degrees=True)
    field = rot_nb.apply(FIELD_N, inverse=True)
    rate = (rot_nb[:-1].inv() * rot_nb[1:]).as_rotvec() * RATE_HZ
    samples = ag.Samples(
        time=np.arange(len(heading)) / RATE_HZ,
        field=field @ np.linalg.inv(MATRIX).T + BIAS + NOISE * rng.normal(size=field.shape),
        acceleration=rot_nb.apply([0.0, 0.0, -9.80665], inverse=True),
        rotation_rate=np.concatenate([rate, rate[-1:]]),
    )
    return with_inertial_unit(seed=seed)(samples)


def _smooth(angle):
    return np.convolve(np.pad(angle, 15, "edge"), np.ones(31) / 31, "valid")


def get_motion(samples):
    """Acceleration and rotation rate, (n, 6)."""
    return np.column_stack([samples.acceleration, samples.rotation_rate])


def heading_error_deg(calibration, seed=0):
    """rms error of a level heading but for one constant angle, and with it, by the tilt that the
    accelerometer of a drive reads then, bias and all."""
    heading = np.arange(0.0, 360.0, 10.0)
    rot_nb = Rotation.from_euler("z", heading[:, None], degrees=True)
    field = rot_nb.apply(FIELD_N, inverse=True)
    force = np.tile([0.0, 0.0, -9.80665], (len(heading), 1))
    still = ag.Samples(time=heading, field=field, acceleration=force, rotation_rate=0 * force)
    read = with_inertial_unit(accelerometer_noise=0.0, seed=seed)(still).acceleration
    found = calibration.correct(field @ np.linalg.inv(MATRIX).T + BIAS)
    off = heading_by_vectors_deg(found, down_from_force(read)) - heading
    error = np.angle(np.exp(1j * np.radians(off)))
    return np.degrees([error.std(), np.sqrt(np.mean(error**2))])
