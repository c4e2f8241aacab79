"""The published scenario, and the sensor that no affine fits: the truth behind them."""

import numpy as np
import pytest

from agonic.errors import AgonicError
from agonic.network.simulate import CHANGE_S, simulate_nonaffine, simulate_paper


def affine_left(made, *extra):
    """Rms of what the best affine function of the readings leaves of the field, nT on an axis."""
    rows = np.column_stack([made.samples.field, np.ones(len(made.field)), *extra])
    left = made.field - rows @ np.linalg.lstsq(rows, made.field, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


def test_the_printed_field_keeps_to_a_plane_and_the_other_fills_space():
    for directions, rank in (("planar", 2), ("space", 3)):
        field = simulate_paper(15.0, directions=directions).field
        np.testing.assert_allclose(
            np.linalg.norm(field - 4000.0, axis=1) <= 100.0 * np.sqrt(2) + 1e-9, True
        )
        spread = np.linalg.svd(field - field.mean(axis=0), compute_uv=False) / np.sqrt(1500)
        assert (spread > 10.0).sum() == rank


def test_the_sensor_of_the_paper_changes_at_fifteen_seconds():
    made = simulate_paper(30.0, noise=0.0)
    ground = made.samples.field[:1500], made.field[:1500]
    raw, field = ground
    np.testing.assert_allclose(
        raw[0] - raw[700],
        np.array([[0.9599, -0.0209, -0.0065], [0.0020, 0.9476, -0.0040], [0.0011, 0.0561, 0.9657]])
        @ (field[0] - field[700]),
        atol=1e-9,
    )
    step = made.samples.field[1500] - made.samples.field[1499]
    wanted = [-652.7 + 633.2, 1266.4 - 1281.7, -444.49 + 455.5] - 0.002 * made.field[1500]
    np.testing.assert_allclose(step, wanted, atol=2.0)
    assert made.samples.time[1500] == pytest.approx(CHANGE_S)


def test_the_noise_is_what_was_asked_for():
    quiet, noisy = simulate_paper(15.0, noise=0.0), simulate_paper(15.0, noise=2.0)
    off = noisy.samples.field - quiet.samples.field
    assert off.std() == pytest.approx(2.0, rel=0.05)


def test_each_defect_alone_is_what_no_affine_fits():
    plain = {"saturation": 0.0, "cross": 0.0, "hysteresis": 0.0, "noise": 1e-3, "n": 3000}
    assert affine_left(simulate_nonaffine(**plain)) < 0.01
    for defect in ({"saturation": 0.02}, {"cross": 0.01}, {"hysteresis": 200.0}):
        assert affine_left(simulate_nonaffine(**{**plain, **defect})) > 20.0, defect


def test_a_saturated_reading_is_short_by_its_share():
    """A reading of the whole field along an axis is short of 2 %."""
    bent = simulate_nonaffine(n=2000, cross=0.0, hysteresis=0.0, noise=1e-6, seed=3)
    straight = simulate_nonaffine(
        n=2000, saturation=0.0, cross=0.0, hysteresis=0.0, noise=1e-6, seed=3
    )
    rows = np.column_stack([straight.field, np.ones(2000)])
    bias = np.linalg.lstsq(rows, straight.samples.field, rcond=None)[0][3]
    full = straight.samples.field - bias
    short = (straight.samples.field - bent.samples.field) / full
    np.testing.assert_allclose(short, 0.02 * (full / 50_000.0) ** 2, rtol=1e-3, atol=1e-8)


def test_the_lag_is_between_warming_and_cooling():
    """At the same temperature the bias differs by the hysteresis while warming and cooling."""
    made = simulate_nonaffine(
        n=6000, saturation=0.0, cross=0.0, noise=1e-6, hysteresis=200.0, seed=1
    )
    rows = np.column_stack([made.field, np.ones(6000)])
    moved = made.samples.field - rows @ np.linalg.lstsq(rows, made.samples.field, rcond=None)[0]
    warming = np.gradient(made.samples.temperature) > 0
    middle = np.abs(made.samples.temperature - 15.0) < 3.0
    step = moved[middle & warming].mean(axis=0) - moved[middle & ~warming].mean(axis=0)
    assert np.linalg.norm(step) == pytest.approx(200.0, rel=0.2)


def test_what_cannot_be_simulated_is_told():
    with pytest.raises(AgonicError, match="directions 'round' is not known"):
        simulate_paper(directions="round")
    with pytest.raises(AgonicError, match="hold no reading"):
        simulate_paper(0.0)
