"""Vehicles with a raw inertial unit, and how far a calibration turns their heading."""

import numpy as np
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

import agonic as ag
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
