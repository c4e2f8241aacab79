"""North by turning points, transits and the damped sinusoid, against hand-computed examples."""

import numpy as np
import pytest

from agonic.alignment.maths import north

ARCSEC = 1 / 3600


def test_schuler_means_by_hand() -> None:
    """(10 + 2·2 + 8)/4 = 5.5, (2 + 2·8 + 3)/4 = 5.25, (8 + 2·3 + 7.5)/4 = 5.375."""
    turning = np.array([10.0, 2.0, 8.0, 3.0, 7.5])
    np.testing.assert_allclose(north.compute_schuler_means(turning), [5.5, 5.25, 5.375], atol=1e-14)
    found = north.fit_reversals(turning)
    assert found.reading_deg == pytest.approx((5.5 + 5.25 + 5.375) / 3)
    assert found.freedom == 2


def test_a_schuler_mean_is_free_of_a_linear_decay() -> None:
    amplitude = 3.0 - 0.05 * np.arange(9)
    turning = 42.0 + amplitude * (-1.0) ** np.arange(9)
    np.testing.assert_allclose(north.compute_schuler_means(turning), 42.0, atol=1e-13)


def test_standard_error_of_overlapping_means_is_that_of_their_weights() -> None:
    """Three means of five readings: weights (1 3 4 3 1)/12, so σ √(1+9+16+9+1)/12 = σ/2."""
    stated = north.fit_reversals(np.array([10.0, 2.0, 8.0, 3.0, 7.5]), 0.3)
    assert stated.sd_deg == pytest.approx(0.15)
    assert np.isnan(north.fit_reversals(np.array([1.0, 2.0, 1.5])).sd_deg)  # one mean has no spread
    three = north.fit_reversals(np.array([1.0, 2.0, 1.5]), 0.4)
    assert three.sd_deg == pytest.approx(0.4 * np.sqrt(6) / 4)


def test_reversal_is_honest() -> None:
    rng = np.random.default_rng(3)
    signs = (-1.0) ** np.arange(13)
    z = []
    for _ in range(2000):
        found = north.fit_reversals(5.0 + signs + 0.01 * rng.standard_normal(13))
        z.append((found.reading_deg - 5.0) / found.sd_deg)
    # with eleven overlapping means the spread has the freedom of about eight
    assert abs(np.mean(z)) < 0.1
    assert 1.0 < np.std(z) < 1.35


def test_transit_by_hand() -> None:
    """N′ = 0.00° and 0.50°; aΔt = 120·1.0 and −30·1.0: c = 0.5/150, N = 0 + 120/300 = 0.4°."""
    product, setting = np.array([120.0, -30.0]), np.array([0.0, 0.5])
    found, constant, _ = north.fit_transits(setting, product, None)
    assert constant == pytest.approx(0.5 / 150)
    assert found.reading_deg == pytest.approx(0.4)
    assert np.isnan(found.sd_deg)
    known, _, _ = north.fit_transits(setting, product, None, 0.5 / 150)
    assert known.reading_deg == pytest.approx(0.4)
    assert known.sd_deg == pytest.approx(0.0, abs=1e-12)


def test_transit_constant_of_a_free_swing_is_pi_over_twice_the_period() -> None:
    """d = a sin(ω Δt/4), so for small d: d = a Δt · π/(2T)."""
    period, amplitude, off = 400.0, 1.5, np.array([0.01, -0.02])
    dt = 4 * np.arcsin(off / amplitude) / (2 * np.pi / period)
    found, constant, _ = north.fit_transits(10.0 - off, amplitude * dt, None)
    assert constant == pytest.approx(np.pi / (2 * period), rel=1e-4)
    assert found.reading_deg == pytest.approx(10.0, abs=0.001 * ARCSEC)


def test_transit_is_honest_with_stated_times() -> None:
    rng = np.random.default_rng(0)
    setting = np.array([-0.1, -0.1, 0.15, 0.15])
    exact, sd = (0.02 - setting) / 0.004, np.full(4, 0.3)
    z = []
    for _ in range(2000):
        found, _, _ = north.fit_transits(setting, exact + 0.3 * rng.standard_normal(4), sd)
        z.append((found.reading_deg - 0.02) / found.sd_deg)
    assert abs(np.mean(z)) < 0.1
    assert np.std(z) == pytest.approx(1.0, abs=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("periods", [1.3, 4.0])
def test_the_sinusoid_is_honest(periods: float) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, periods * 400, 8.0)
    truth = np.array([212.3456, 1.2, 0.5, 1e-4, 2 * np.pi / 400])
    z = []
    for _ in range(80):
        noise = 4 * ARCSEC * rng.standard_normal(len(time))
        found = north.fit_swing(time + 7.0, north.evaluate_swing_deg(truth, time) + noise)
        assert found.converged
        z.append((found.params - truth) / np.sqrt(np.diag(found.covariance)))
    assert np.abs(np.mean(z, axis=0)).max() < 0.3
    assert (np.abs(np.std(z, axis=0) - 1.0) < 0.2).all()


def test_the_sinusoids_jacobian() -> None:
    time = np.linspace(0, 900, 40)
    params = np.array([10.0, 1.0, -0.4, 3e-4, 0.016])
    _, jacobian = north._pieces(time, np.zeros(40), params)
    for k, step in enumerate((1e-6, 1e-6, 1e-6, 1e-9, 1e-9)):
        ahead, behind = params.copy(), params.copy()
        ahead[k] += step
        behind[k] -= step
        slope = (north.evaluate_swing_deg(ahead, time) - north.evaluate_swing_deg(behind, time)) / (
            2 * step
        )
        np.testing.assert_allclose(jacobian[:, k], slope, rtol=1e-5, atol=1e-5)


def test_correlated_readings_widen_the_standard_error() -> None:
    """An observer who lags leaves residuals that are alike: fewer count."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 1600, 4.0)
    truth = np.array([12.0, 1.2, 0.5, 1e-4, 2 * np.pi / 400])
    white = 4 * ARCSEC * rng.standard_normal(len(time) + 9)
    slow = np.convolve(white, np.ones(10) / np.sqrt(10), mode="valid")
    lagged = north.fit_swing(time, north.evaluate_swing_deg(truth, time) + slow)
    assert 4 < lagged.correlation < 20


def test_pointing_in_two_faces() -> None:
    """Face one 10.002 and 10.004, face two 189.998 and 190.000: direction 10.001, error 2″·…"""
    found = north.average_faces(np.array([10.002, 189.998, 10.004, 190.0]))
    assert found.reading_deg == pytest.approx(10.001)
    assert found.collimation_deg == pytest.approx(0.002)
    # left over ±0.001 four times with two freedoms: σ = 0.001 √2, of the mean half that, widened
    # by Student's t, 4.30 over 1.96
    assert found.sd_deg == pytest.approx(0.001 * np.sqrt(2) / 2 * 2.1953, rel=1e-4)
    over = north.average_faces(np.array([359.9995, 180.0005]))
    assert (over.reading_deg + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(north.average_faces(np.array([12.0])).collimation_deg)
