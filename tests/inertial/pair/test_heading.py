"""Headings with both calibrations: right, and with standard errors that hold."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.inertial.pair.simulate import SimulatedShots
from agonic.units import STANDARD_GRAVITY_M_S2


def look_around(made: SimulatedShots, seed: int, n: int = 150) -> tuple[ag.Samples, np.ndarray]:
    """Shots in all directions by an instrument, and the true azimuth of its sight."""
    rng = np.random.default_rng(seed)
    angles = np.column_stack([rng.uniform(0, 360, n), rng.uniform(-60, 60, (n, 2))])
    rot_nb = Rotation.from_euler("ZYX", angles, degrees=True)
    dip = np.radians(66.0)
    field = rot_nb.apply([np.cos(dip), 0.0, np.sin(dip)], inverse=True) * 49_000.0
    force = rot_nb.apply([0.0, 0.0, -STANDARD_GRAVITY_M_S2], inverse=True)
    mag, acc = made.magnetometer, made.accelerometer
    raw = field @ np.linalg.inv(mag.matrix).T + mag.bias + 150 * rng.standard_normal((n, 3))
    felt = force @ np.linalg.inv(acc.matrix).T + acc.bias + 0.02 * rng.standard_normal((n, 3))
    return ag.Samples(field=raw, acceleration=felt, unit="nT"), angles[:, 0]


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, {"targets": 0, "attitudes": 24}])
def test_headings_are_right_and_their_errors_honest(settings: dict) -> None:
    square, off = [], []
    for seed in range(5):
        made = ag.inertial.simulate_shots(seed=seed, **settings)
        setup = ag.fit_pair(made.samples).make_setup(declination_deg=0.0)
        samples, truth = look_around(made, seed)
        found = ag.heading(samples, setup)
        error = (found.true_deg - truth + 180) % 360 - 180
        square.append(np.mean((error / found.sd_deg) ** 2))
        off.append(np.mean(error**2))
    assert 0.75 < np.sqrt(np.mean(square)) < 1.25
    assert np.sqrt(np.mean(off)) < 0.9


def test_the_accelerometer_s_calibration_matters() -> None:
    made = ag.inertial.simulate_shots(seed=1)
    setup = ag.fit_pair(made.samples).make_setup(declination_deg=0.0)
    bare = ag.Setup(compasses=setup.compasses, tilt="accelerometer", declination_deg=0.0)
    samples, truth = look_around(made, 1)
    with_it, without = (
        np.sqrt(np.mean(((ag.heading(samples, one).true_deg - truth + 180) % 360 - 180) ** 2))
        for one in (setup, bare)
    )
    assert with_it < 1.0 < 2.0 < without


def test_gyro_and_accelerometer_are_turned_into_the_same_axes() -> None:
    made = ag.inertial.simulate_shots(seed=2)
    setup = ag.fit_pair(made.samples).make_setup(declination_deg=0.0)
    samples, _ = look_around(made, 2)
    from agonic.headings.tilt_source import calibrate_acceleration

    turned, felt = calibrate_acceleration(
        samples.with_columns(rotation_rate=samples.acceleration), setup.accelerometer
    )
    cosine = np.sum(turned.acceleration * turned.rotation_rate, axis=1) / (
        np.linalg.norm(turned.acceleration, axis=1) * np.linalg.norm(turned.rotation_rate, axis=1)
    )
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 8  # the bias, 0.3 m/s² an axis
    assert all((variance > 0).all() for variance in felt)
