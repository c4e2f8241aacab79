"""A gyro's bias at rest: what it reads there, how well, and that a slow turn is no rest."""

import numpy as np
import pytest

from agonic.headings.maths.rest import find_rest, find_still

TIME = np.arange(0.0, 60.0, 0.1)
BIAS = np.radians([0.3, -0.2, 0.1])
NOISE = 8.7e-4 / np.sqrt(0.1)


def read(seed: int, turn_deg_s: float):
    """What is read of twenty seconds at rest, or in an even turn, amid motion."""
    rng = np.random.default_rng(seed)
    quiet = (TIME > 20.0) & (TIME < 40.0)
    moving = np.where(quiet[:, None], 0.0, np.sin(TIME[:, None] * [1.0, 1.3, 0.7]))
    rate = moving + np.radians([0.0, 0.0, turn_deg_s]) * quiet[:, None]
    heading = np.cumsum(rate[:, 2]) * 0.1 + 0.02 * rng.standard_normal(len(TIME))
    rate = rate + BIAS + NOISE * rng.standard_normal(rate.shape)
    force = np.array([0.0, 0.0, -9.81]) + 0.05 * rng.standard_normal(rate.shape)
    still = find_still(TIME, rate, force)
    assert not still[~quiet].any()
    return find_rest(TIME, rate, still, heading, np.full(len(TIME), 0.02**2))


def test_it_reads_the_bias_as_well_as_it_says() -> None:
    found = [read(seed, 0.0) for seed in range(60)]
    z = np.concatenate([(one.bias - BIAS) / np.sqrt(one.variance)[:, None] for one in found])
    assert len(z) >= 55
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.2


@pytest.mark.parametrize("turn_deg_s", [-0.5, 0.2])
def test_an_even_turn_is_no_rest(turn_deg_s) -> None:
    found = [read(seed, turn_deg_s) for seed in range(40)]
    kept = [one for one in found if len(one.at)]
    assert len(kept) < 0.2 * len(found)
    for one in kept:
        assert abs(one.bias[0, 2] - BIAS[2]) < 3 * np.sqrt(one.variance[0])
