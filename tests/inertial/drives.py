"""Vehicles with a raw inertial unit, and how far a calibration turns their heading."""

import numpy as np
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.maths.rotations.tilt import down_from_force, heading_by_vectors_deg
from agonic.simulation import simulate, with_inertial_unit
from agonic.simulation.sensor import Simulated


def drive(
    kind: str = "circle", seed: int = 0, *, unit: dict | None = None, **settings
) -> tuple[Simulated, ag.Samples, ag.Reference]:
    """A motion, what its raw sensors recorded, and the field of the place."""
    settings = {"n": 3000, "inclination_deg": 65.0, **settings}
    made = simulate(kind, seed=seed, **settings)
    logged = with_inertial_unit(seed=seed, **(unit or {}))(made.samples)
    return made, logged, ag.Reference.vector(made.field_n, frame="n")


def heading_error_deg(calibration, made: Simulated, tilt_deg: float) -> float:
    """rms error of headings at tilts up to `tilt_deg`, in the sensor's own axes."""
    rng = np.random.default_rng(5)
    heading = np.repeat(np.arange(0.0, 360.0, 10.0), 10)
    side, tilt = rng.uniform(0, 1, (2, len(heading))) * [[2 * np.pi], [np.radians(tilt_deg)]]
    lean = np.stack([tilt * np.cos(side), tilt * np.sin(side), 0 * tilt], axis=1)
    rot_nb = Rotation.from_euler("z", heading[:, None], degrees=True) * Rotation.from_rotvec(lean)
    truth = made.truth
    raw = rot_nb.apply(made.field_n, inverse=True) @ np.linalg.inv(truth.matrix).T + truth.bias
    own = polar(calibration.matrix)[1]
    north, east, _ = rot_nb.apply((raw - calibration.bias) @ own.T).T
    return float(np.sqrt(np.mean(np.degrees(np.arctan2(east, north)) ** 2)))


def used_error_deg(calibration, made: Simulated, tilt_deg: float, **unit) -> float:
    """rms error, about its mean, of headings by the tilt that the accelerometer of a unit reads."""
    rng = np.random.default_rng(5)
    heading = np.repeat(np.arange(0.0, 360.0, 10.0), 10)
    lean = np.zeros((len(heading), 3))
    lean[:, :2] = np.radians(tilt_deg) * rng.uniform(-0.7, 0.7, (len(heading), 2))
    rot_nb = Rotation.from_euler("z", heading[:, None], degrees=True) * Rotation.from_rotvec(lean)
    truth = made.truth
    raw = rot_nb.apply(made.field_n, inverse=True) @ np.linalg.inv(truth.matrix).T + truth.bias
    force = rot_nb.apply([0.0, 0.0, -9.80665], inverse=True)
    time = np.arange(len(raw), dtype=float)
    still = ag.Samples(time=time, field=raw, acceleration=force, rotation_rate=0 * force)
    read = with_inertial_unit(**unit, accelerometer_noise=0.0)(still).acceleration
    compass = heading_by_vectors_deg(calibration.correct(raw), down_from_force(read))
    nose = rot_nb.apply([1.0, 0.0, 0.0])
    off = np.radians(compass) - np.arctan2(nose[:, 1], nose[:, 0])
    turned = np.exp(1j * off)
    return float(np.degrees(np.sqrt(np.mean(np.angle(turned / turned.mean()) ** 2))))
