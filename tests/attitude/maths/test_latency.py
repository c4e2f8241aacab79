"""Slopes against finite differences, and the pieces of time that rows are cut into."""

from itertools import pairwise

import numpy as np
import pytest

from agonic.attitude.maths import latency
from agonic.maths.rotations.attitude import integrate_rates, rot_nb
from agonic.simulation import simulate

HAND = simulate("hand", n=1500, rate_Hz=50, noise=100.0, seed=3).samples
ROT_NB = rot_nb(HAND.roll_deg, HAND.pitch_deg, HAND.heading_deg)


def test_projected_slopes_are_those_of_noiseless_residuals() -> None:
    """Kaufman's slope leaves out a part in the residual, so it is exact where there is none."""
    clean = simulate("hand", n=1500, rate_Hz=50, noise=0.0, seed=3).samples
    record = latency.record(clean.time, clean.field, 0.3, 10.0)
    path = latency.attitude_path(clean.time, ROT_NB)
    weights = np.random.default_rng(0).uniform(0.2, 1, len(record.time))
    h = 1e-4
    ahead, back = (latency._projected(record, path, at, weights).residuals for at in (h, -h))
    slope = latency._projected(record, path, 0.0, weights).slopes[0]
    error = np.linalg.norm((back - ahead) / (2 * h) - slope) / np.linalg.norm(slope)
    assert error < 0.01  # smoothing leaves a small residual


def test_a_turn_about_one_axis_leaves_entries_that_show_nothing() -> None:
    """What no row tells is left out, in every stretch, without a warning."""
    flat = rot_nb(np.zeros(1500), np.zeros(1500), HAND.heading_deg)
    field = np.einsum("nji,j->ni", flat, [20_000.0, 0.0, 40_000.0]) * 1e3
    record = latency.record(HAND.time, field, 0.3, 10.0)
    path = latency.attitude_path(HAND.time, flat)
    seen = latency._projected(record, path, 0.02, np.ones(len(record.time)))
    assert np.isfinite(seen.slopes).all()
    assert np.abs(seen.slopes[0, :, :2]).max() > 1e6


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_drifts_of_a_gyro_are_what_a_bias_adds_to_the_path(axis: int) -> None:
    bias = np.zeros(3)
    bias[axis] = 1e-5
    rate = HAND.rotation_rate
    path = latency.gyro_path(HAND.time, rate)
    biased = latency.gyro_path(HAND.time, rate + bias)
    at = HAND.time[100:600] + 0.007
    change = (biased.entries(at) - path.entries(at)) / 1e-5
    np.testing.assert_allclose(path.find_drifts(at)[axis], change, atol=0.02)


def test_a_gyro_is_integrated_as_the_sensor_turned() -> None:
    found = integrate_rates(HAND.rotation_rate, HAND.time).as_matrix()
    turned = np.swapaxes(ROT_NB[:1], 1, 2) @ ROT_NB
    assert np.abs(found - turned).max() < 2e-4  # 50 Hz, 30 s, up to 300°/s


def test_rows_near_ends_and_gaps_are_left_out_and_stretches_keep_to_runs() -> None:
    time = np.concatenate([np.arange(500) * 0.02, 60 + np.arange(1000) * 0.02, [200.0, 200.02]])
    record = latency.record(time, np.zeros((len(time), 3)), 0.51, 5.0)
    far = np.abs(record.time[:, None] - np.array([0.0, time[499], 60.0, time[1499]])).min(axis=1)
    assert far.min() > 0.51
    assert [len(run) for run in latency.runs(time)] == [500, 1000, 2]
    for first, beyond in pairwise(record.edges):
        assert np.ptp(record.time[first:beyond]) < 6.5
    assert record.edges[-1] == len(record.time) == (500 - 2 * 26) + (1000 - 2 * 26)


def test_every_stretch_of_a_long_log_keeps_rows_enough_to_tell_a_delay() -> None:
    """A day at one reading a second: of 2880 stretches some are taken, each with all its rows."""
    time = np.arange(86_400.0)
    kept = latency.record(time, np.zeros((len(time), 3)), 0.3, 20.0)
    assert len(kept.time) <= 1.1 * latency.MOST_ROWS
    assert np.diff(kept.edges).min() >= 29
    for first, last in pairwise(kept.edges):
        assert np.ptp(kept.time[first:last]) < 32.0
    assert np.diff(kept.time[kept.edges[:-1]]).max() < 300.0


@pytest.mark.slow
def test_correlated_residuals_widen_the_scatter_of_a_score() -> None:
    """Scatter of Σ J z, for white and for correlated z, against many draws."""
    rng = np.random.default_rng(5)
    t = np.arange(2000)[:, None]
    fall = np.sin(t / np.array([40.0, 60.0, 90.0]))
    for keep in (0.0, 0.9):
        scores, told = [], []
        for _ in range(150):
            noise = rng.standard_normal((2200, 3))
            for i in range(1, len(noise)):
                noise[i] += keep * noise[i - 1]
            z = noise[200:]
            scores.append((fall * z).sum())
            told.append(latency._scatter(z, fall))
        assert np.sqrt(np.mean(told)) == pytest.approx(np.std(scores), rel=0.15)
