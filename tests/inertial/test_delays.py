"""An accelerometer and a gyro that are late beside one another."""

import numpy as np
import pytest

import agonic as ag
from tests.inertial.drives import drive
from tests.live import rover

LATE_S = 0.15
DRIVEN = (
    rover.turn(0, 360),
    rover.stand(0, pitch=6.0),
    rover.stand(0, roll=6.0),
    rover.turn(0, -360),
    rover.stand(0, pitch=-6.0),
    rover.turn(0, -180, 8.0),
    rover.stand(180, pitch=8.0),
)


def delay(samples: ag.Samples, column: str, late_s: float) -> ag.Samples:
    """The samples with one sensor recorded so much later."""
    then, time = samples.time - late_s, samples.time
    late = [np.interp(then, time, axis) for axis in getattr(samples, column).T]
    return samples.with_columns(**{column: np.stack(late, axis=1)})


@pytest.mark.slow
def test_a_gyro_alone_late_leaves_a_rovers_heading_within_its_error() -> None:
    """Beside the two other sensors; level leaned by ω τ, and headings were off by twice what was
    stated."""
    ratios = []
    for seed in range(3):
        driven = delay(rover.drive(*DRIVEN, seed=seed), "rotation_rate", LATE_S)
        fit = ag.fit_inertial(driven, rover.PLACE)
        error = rover.heading_error_deg(fit.calibration, seed)[1]
        ratios.append(error / fit.coverage.heading_sd_deg)
    assert np.sqrt(np.mean(np.square(ratios))) < 1.0


@pytest.mark.parametrize("late_s", [0.04, -0.08])
def test_how_late_the_accelerometer_is_beside_the_gyro_is_an_unknown(late_s: float) -> None:
    _, logged, place = drive(n=1000, tilt_deg=20.0)
    fit = ag.fit_inertial(delay(logged, "acceleration", late_s), place)
    assert abs(fit.inertial_errors[13] - late_s) < 3 * fit.inertial_sd[13]
    assert fit.inertial_sd[13] < 0.02


@pytest.mark.parametrize("kind", ["circle", "hand"])
def test_a_magnetometer_two_seconds_late_is_found_beside_the_gyro(kind: str) -> None:
    """Within a second something else fits: 0.17 ± 0.12 s, or 0.116 ± 0.025."""
    _, logged, _ = drive(kind, 1, n=1500, rate_Hz=25.0)
    found = ag.fit_latency(delay(logged, "field", 2.0))
    assert found.significant
    assert found.latency_s == pytest.approx(2.0, abs=0.03)
