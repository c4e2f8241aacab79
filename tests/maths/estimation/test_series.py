"""One station in time: anomalies, direction, rate of change."""

import numpy as np
import pytest

from agonic.maths.estimation import series


def programme(n: int = 4000) -> np.ndarray:
    """Hold, cool, hold, heat in steps, hold."""
    steps = np.repeat(np.arange(-10.0, 50.0, 10.0), n // 12)
    ramp = np.concatenate([np.linspace(0, 10, n // 12)] * 6)[: len(steps)]
    return np.concatenate(
        [
            np.full(n // 8, 50.0),
            np.linspace(50, -10, n // 2),
            np.full(n // 8, -10.0),
            np.minimum(steps + np.minimum(2 * ramp, 10.0), 50.0),
            np.full(n // 8, 50.0),
        ]
    )


def test_spikes_are_found_and_honest_readings_are_not() -> None:
    rng = np.random.default_rng(0)
    t = programme()
    field = np.outer(t, [300.0, -200.0, 100.0]) + 100.0 * rng.normal(size=(len(t), 3))
    spiked = rng.choice(len(t), 20, replace=False)
    field[spiked] += 3000.0
    assert np.flatnonzero(series.find_anomalies(field)).tolist() == sorted(spiked.tolist())


def test_a_burst_shorter_than_half_a_block_is_found() -> None:
    rng = np.random.default_rng(1)
    field = 100.0 * rng.normal(size=(2000, 3))
    field[1000:1012] += 5000.0
    assert np.flatnonzero(series.find_anomalies(field)).tolist() == list(range(1000, 1012))


@pytest.mark.parametrize("noise", [10.0, 60.0, 400.0])
def test_coarse_steps_are_no_anomalies(noise: float) -> None:
    rng = np.random.default_rng(2)
    drift = np.outer(np.linspace(0, 1, 20_000), [20_000.0, 5000.0, 0.0])
    field = np.round((drift + noise * rng.normal(size=drift.shape)) / 150.0) * 150.0
    assert series.find_anomalies(field).sum() <= 1


def test_a_sharp_turn_without_noise_is_no_anomaly() -> None:
    t = np.abs(np.linspace(-60, 60, 1001))
    assert not series.find_anomalies(np.outer(t, [1.0, 2.0, 3.0])).any()


def test_heating_begins_at_the_coldest_whatever_the_thermometer_adds() -> None:
    rng = np.random.default_rng(3)
    t = programme()
    coldest = len(t) // 8, 5 * len(t) // 8
    rising = series.find_heating(t + 0.05 * rng.normal(size=len(t)))
    turn = int(np.argmax(rising))
    assert not rising[: coldest[0]].any()
    assert rising[turn:].all()
    assert abs(t[turn] + 10.0) < 0.6


def test_only_one_direction_is_one_direction() -> None:
    down = np.linspace(50, -10, 900)
    assert not series.find_heating(down).any()
    assert series.find_heating(down[::-1]).all()


def test_the_rate_is_that_of_the_temperature() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 7200.0, 0.5)
    t = 20 + 30 * np.cos(2 * np.pi * time / 7200)
    expected = -30 * 2 * np.pi / 7200 * np.sin(2 * np.pi * time / 7200)
    found = series.compute_rates(time, t + 0.01 * rng.normal(size=len(t)))
    assert np.abs(found - expected)[200:-200].max() < 5e-4  # °C/s, of 26e-3
