"""Sums by station, direction and temperature: what they hold, and that pieces make the whole."""

import numpy as np
import pytest

from agonic.thermal.maths.binned_sums import Binned


def recording(seed: int = 0, n: int = 3000):
    rng = np.random.default_rng(seed)
    t = np.concatenate([np.linspace(30, 0, n), np.linspace(0, 30, n)])
    field = 40_000 + np.outer(t, [300.0, -50.0, 10.0])
    noise = rng.normal(size=field.shape) @ np.array([[100.0, 0, 0], [30, 80, 0], [0, 0, 50]])
    return field + noise, t + 0.01 * rng.normal(size=2 * n), np.arange(2.0 * n)


def test_a_cell_holds_means_and_covariances_of_its_rows() -> None:
    field, t, time = recording()
    sums = Binned(1.0)
    sums.add(7, field, t, time)
    cells = sums.cells()
    at = np.flatnonzero((cells.bin == 12) & ~cells.heating)[0]
    rows = (np.floor(t) == 12) & (np.arange(len(t)) < 3000)
    assert cells.n[at] == rows.sum()
    assert cells.number[at] == 7
    assert cells.mean[at] == pytest.approx(field[rows].mean(axis=0), rel=1e-12)
    assert cells.temperature[at] == pytest.approx(t[rows].mean(), rel=1e-9)
    assert cells.time[at] == pytest.approx(time[rows].mean())
    together = np.cov(np.column_stack([t[rows], field[rows]]).T, bias=True)
    assert cells.variance[at] == pytest.approx(together[0, 0], rel=1e-6)
    assert cells.shared[at] == pytest.approx(together[0, 1:], rel=1e-5, abs=1e-4)
    assert cells.covariance[at] == pytest.approx(together[1:, 1:], rel=1e-5, abs=0.01)
    assert cells.rate[at] == pytest.approx(-30 / 3000, rel=0.02)


def test_the_noise_is_that_of_the_readings_not_of_the_drift() -> None:
    sums = Binned(2.0)  # the drift over a bin is 600 nT
    sums.add(1, *recording()[:2])
    mix = np.array([[100.0, 0, 0], [30, 80, 0], [0, 0, 50]])
    assert sums.cells().noise() == pytest.approx(mix.T @ mix, abs=400.0)


def test_split_is_whole() -> None:
    field, t, time = recording()
    whole = Binned()
    whole.add(1, field, t, time, heating=np.arange(6000) >= 3000, keep_anomalies=True)
    parts = Binned()
    parts.add(1, field[:3000], t[:3000], time[:3000], heating=False, keep_anomalies=True)
    parts.add(1, field[3000:], t[3000:], time[3000:], heating=True, keep_anomalies=True)
    assert len(parts) == len(whole) == 6000
    ours, theirs = whole.cells(), parts.cells()
    for name in ("number", "heating", "bin", "n"):
        assert (getattr(ours, name) == getattr(theirs, name)).all()
    for name in ("temperature", "time", "mean"):
        assert getattr(theirs, name) == pytest.approx(getattr(ours, name), rel=1e-12)
    assert theirs.covariance == pytest.approx(ours.covariance, abs=1e-3)
    assert whole.stations[1].coldest == parts.stations[1].coldest


def test_anomalies_are_left_out_and_listed() -> None:
    field, t, time = recording()
    field[[100, 2000]] += 9000.0
    sums = Binned()
    sums.add(3, field, t, time)
    assert sums.stations[3].dropped == 2
    assert sums.anomalies[0].rows.tolist() == [100, 2000]
    assert sums.anomalies[0].times.tolist() == [100.0, 2000.0]
    assert sums.cells().n.sum() == 5998


def test_sums_that_hold_nothing_are_refused() -> None:
    with pytest.raises(ValueError, match="cannot hold"):
        Binned(0.0)
    with pytest.raises(ValueError, match="no readings"):
        Binned().cells()
