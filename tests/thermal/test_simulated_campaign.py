"""The simulated campaign holds what it says: sensors, field, fixture, hysteresis, faults."""

from dataclasses import replace

import numpy as np
import pytest

from agonic.errors import AgonicError
from agonic.simulation.thermal import random_drifting
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.plan.plan import plan_thermal
from agonic.thermal.simulation.campaign import Faults, simulate_campaign
from tests.thermal.coil import simulate_thermal_coil

QUIET = {
    "noise": 0.0,
    "field_sd": 0.0,
    "fixture_sd_deg": 0.0,
    "anomalies": 0.0,
    "hysteresis": 0.0,
    "quantised": False,
    "temperature_noise_C": 0.0,
}


def test_without_disturbances_the_truth_gives_the_field_of_the_station() -> None:
    made = simulate_campaign("MMC5883MA", rate_Hz=0.02, seed=3, **QUIET)
    truth = made.truth["MMC5883MA"]
    for number, by in made.stations():
        s = by["MMC5883MA"]
        field = truth.correct(s.field, temperature=s.temperature)
        expected = made.rotations[number].inv().apply(made.field_n(s.time))
        np.testing.assert_allclose(field, expected, atol=1.0)  # °C to 0.001
        told = made.description.rotations[number]
        dip = np.radians(65)
        steady = told.inv().apply(48_000 * np.array([np.cos(dip), 0.0, np.sin(dip)]))
        np.testing.assert_allclose(expected - steady, 0.0, atol=1e-6)


def test_the_sensors_are_those_of_the_published_campaign() -> None:
    made = simulate_campaign(rate_Hz=0.05)
    assert list(made.truth) == [
        "MMC5883MA-1",
        "MMC5883MA-2",
        "MPU-9255-1",
        "MPU-9255-2",
        "MPU-9255-3",
    ]
    by = made.station(1)
    for name, step in (("MMC5883MA-1", 25.0), ("MPU-9255-2", 150.0)):
        steps = by[name].field / step
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
        assert np.abs(by[name].field).max() < 150_000
    x = np.linspace(-10, 50, 61)
    for truth in made.truth.values():
        drift = np.ptp(truth.bias_at(x), axis=0)
        assert (drift > 3_000).all()
        assert (drift <= 20_000 * 1.001).all()
        gains = np.ptp(truth.matrix_at(x).reshape(-1, 9), axis=0)
        assert 0.001 < gains.max() <= 0.01 * 1.001


def test_noise_fixture_and_field_have_the_size_that_is_asked_for() -> None:
    made = simulate_campaign(
        "MPU-9255",
        rate_Hz=0.1,
        seed=1,
        noise=300.0,
        quantised=False,
        anomalies=0.0,
        fixture_sd_deg=2.0,
        field_sd=70.0,
    )
    samples = made.campaign.recordings["MPU-9255"]
    jumps = np.concatenate([np.diff(s.field, n=3, axis=0) for s in samples.values()])
    assert jumps.std() / np.sqrt(20) == pytest.approx(300.0, rel=0.02)
    told = made.description.rotations
    away = [(told[n].inv() * made.rotations[n]).as_rotvec(degrees=True) for n in told]
    assert np.std(away) == pytest.approx(2.0, rel=0.35)
    time = np.linspace(0, made.knots[-3], 500)
    assert made.field_n(time).std(axis=0).mean() == pytest.approx(70.0, rel=0.4)


def test_spikes_hysteresis_and_lag() -> None:
    quiet = {**QUIET, "hysteresis": 500.0}
    made = simulate_campaign("MPU-9255", rate_Hz=0.1, seed=8, **quiet)
    plain = simulate_campaign("MPU-9255", rate_Hz=0.1, seed=8, **QUIET)
    difference = made.station(1)["MPU-9255"].field - plain.station(1)["MPU-9255"].field
    time = made.station(1)["MPU-9255"].time
    cooling = (time > 3000) & (time < 6000)
    assert np.ptp(difference[cooling], axis=0).max() < 5.0
    assert 50.0 < np.abs(difference[cooling]).max() <= 505.0
    resting = (time > 7900) & (time < 8000)
    assert np.abs(difference[resting]).max() < 15.0
    spiked = simulate_campaign("MPU-9255", rate_Hz=0.1, seed=8, **{**QUIET, "anomalies": 0.01})
    away = np.linalg.norm(
        spiked.station(2)["MPU-9255"].field - plain.station(2)["MPU-9255"].field, axis=1
    )
    assert 3 <= np.count_nonzero(away > 1_900) <= 35
    lagging = simulate_campaign("MPU-9255", rate_Hz=0.1, **{**QUIET, "lag_s": 300.0})
    level = lagging.station(1)["MPU-9255"].temperature
    assert level[360] - Profile().at(3600.0) == pytest.approx(0.5 * 5, abs=0.05)  # τ × rate


def test_the_same_seed_gives_the_same_readings_whatever_else_is_made() -> None:
    one, other = (simulate_campaign("2xMPU-9255", rate_Hz=0.02, seed=6) for _ in range(2))
    list(one.stations())
    np.testing.assert_array_equal(
        one.station(9)["MPU-9255-2"].field, other.station(9)["MPU-9255-2"].field
    )
    third = simulate_campaign("2xMPU-9255", rate_Hz=0.02, seed=7)
    assert not np.allclose(third.station(9)["MPU-9255-2"].field, one.station(9)["MPU-9255-2"].field)


def test_faults() -> None:
    faults = Faults(missing=(2,), stuck="MPU-9255", swapped=(3, 4), truncated=(5,), kelvin=True)
    made = simulate_campaign("MPU-9255", rate_Hz=0.02, faults=faults)
    whole = simulate_campaign("MPU-9255", rate_Hz=0.02)
    assert 2 not in made.campaign.stations
    assert len(made.station(5)["MPU-9255"]) == round(0.4 * 288)
    level = made.station(1)["MPU-9255"].temperature
    assert np.ptp(level) == 0.0
    assert 263 < level[0] < 324
    told, right = made.description.rotations, whole.description.rotations
    assert (told[3].inv() * right[4]).magnitude() < 1e-9
    drifted = simulate_campaign("MPU-9255", faults=Faults(drift=4000.0), field_sd=0.0)
    ends = drifted.field_n(np.array([0.0, plan_thermal("MPU-9255").duration_s]))
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(4000.0, rel=1e-3)


@pytest.mark.parametrize(
    "faults", [Faults(missing=(13,)), Faults(stuck="x"), Faults(missing=tuple(range(1, 13)))]
)
def test_faults_that_cannot_be(faults) -> None:
    with pytest.raises(AgonicError):
        simulate_campaign("MPU-9255", faults=faults)


def test_a_plan_is_carried_out() -> None:
    plan = plan_thermal("MPU-9255:250", range_C=(0.0, 30.0), rate_Hz=0.05, inclination_deg=40.0)
    made = simulate_campaign(plan)
    s = made.station(1)["MPU-9255"]
    assert s.temperature.min() == pytest.approx(0.0, abs=0.1)
    assert s.temperature.max() == pytest.approx(30.0, abs=0.1)
    assert len(s) == round(plan.profile.recorded_s * 0.05)
    assert made.facts["noise"] == {"MPU-9255": 250.0}
    assert replace(made.description, magnitude=None).profile == plan.profile


def test_a_drawn_sensor_is_symmetric_and_mild() -> None:
    truth = random_drifting(np.random.default_rng(0))
    matrix = truth.matrix_at([-10.0, 20.0, 50.0])
    np.testing.assert_allclose(matrix, np.swapaxes(matrix, 1, 2))
    assert np.abs(matrix - np.eye(3)).max() < 0.05


def test_a_coil_s_truth_gives_the_coil_s_field() -> None:
    made = simulate_thermal_coil(400, noise=0.0, seed=2)
    level = made.samples.temperature
    field = made.truth.correct(made.samples.field, temperature=level)
    np.testing.assert_allclose(field, made.reference.values, atol=1e-6)
    assert (level.min(), level.max()) == pytest.approx((24.0, 66.0), abs=0.01)
    noisy = simulate_thermal_coil(400, noise=50.0, seed=2)
    assert (noisy.samples.field - made.samples.field).std() == pytest.approx(50.0, rel=0.1)
    np.testing.assert_allclose(noisy.truth.matrix, made.truth.matrix)
    assert not np.allclose(made.truth.matrix[0], made.truth.matrix[0].T)
