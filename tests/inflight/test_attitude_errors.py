"""Errors of the attitude that last: they are in the standard error of the rotation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.inflight.fit import fit_inflight
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.maths.estimation.noise.autoregression import autoregress
from agonic.maths.rotations.attitude import angles_deg

NAMES = ("roll_deg", "pitch_deg", "heading_deg")


def turn_off_by(kind: str, seed: int, n: int, step_s: float) -> np.ndarray:
    """Rotation vectors (n, 3), rad, of 1° that wander over three hours, or of 2° from half-way."""
    rng = np.random.default_rng(seed)
    if kind == "step":
        axis = rng.standard_normal(3)
        return np.outer(np.arange(n) >= n / 2, np.radians(2.0) * axis / np.linalg.norm(axis))
    kept = np.exp(-step_s / 10_800)
    white = rng.standard_normal((5 * n, 3)) * np.sqrt(1 - kept**2)
    return np.radians(1.0) * autoregress(white, kept)[-n:]


def compute_over_stated(kind: str, seed: int, n: int = 1500, step_s: float = 20.0) -> float:
    """Error of the rotation from sensor to body over its standard error, rms of three axes."""
    made = simulate_orbit(n=n, rate_Hz=1 / step_s, pointing="tumble", thermal=0.0, seed=seed)
    wrong = made.rot_nb * Rotation.from_rotvec(turn_off_by(kind, seed, n, step_s))
    told = dict(zip(NAMES, angles_deg(wrong.as_matrix()), strict=True))
    fit = fit_inflight(
        made.samples.with_columns(**told),
        ground=made.ground.at(20.0),
        attitude="logged",
        drift_knots=0,
    )
    assert fit.alignment is not None
    off = (fit.alignment.rotation * made.rot_bm.inv()).as_rotvec()
    return float(np.sqrt(off @ np.linalg.solve(fit.alignment.covariance, off) / 3))


def test_an_attitude_that_wanders_is_in_the_error_of_the_rotation() -> None:
    assert compute_over_stated("wander", 3) < 2.0  # 6.0 where turns of the attitude are not counted


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["wander", "step"])
def test_lasting_errors_of_the_attitude_over_draws(kind: str) -> None:
    over = [compute_over_stated(kind, seed) for seed in range(6)]
    assert 0.5 < np.sqrt(np.mean(np.square(over))) < 2.6  # 11 and 9 where they are not
