"""A calibration that takes out what the vehicle does, followed from log to log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agonic.calibration.interference import Interference
from agonic.calibration.tracking import TrackerParams
from agonic.errors import AgonicError
from agonic.exports.firmware.tracker import write_tracker
from agonic.inflight.tracking import Tracker
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.simulation import simulate

ADDED = np.array([[900.0, -2000.0], [-1500.0, 400.0], [300.0, 1200.0]])
MOVED = np.array([400.0, -200.0, 300.0])
FIELD = Reference.constant(50_000.0)


def flown(seed: int) -> tuple[Samples, Interference]:
    """A tumbling sensor beside two torquers that go on and off, and the calibration of before."""
    made = simulate("tumble", n=3000, noise=50.0, seed=seed)
    rng = np.random.default_rng(seed)
    dipole = np.repeat(rng.integers(-1, 2, (100, 2)), 30, axis=0).astype(np.float64)
    samples = replace(
        made.samples,
        field=made.samples.field + dipole @ ADDED.T,
        disturbers={"torquer_x_Am2": dipole[:, 0], "torquer_y_Am2": dipole[:, 1]},
    )
    before = Interference(
        bias=made.truth.bias + MOVED,
        matrix=made.truth.matrix + unpack_symmetric(0.003 * rng.standard_normal(6)),
        covariance=np.diag([500.0**2] * 3 + [0.003**2] * 6 + [1.0] * 6),
        sources=("torquer_x_Am2", "torquer_y_Am2"),
        coefficients=ADDED,
    )
    return samples, before


@pytest.mark.slow
def test_what_disturbs_is_taken_out_before_the_bias_is_followed() -> None:
    """The same to the last digit as following readings of which it was taken before."""
    samples, before = flown(0)
    columns = {name: samples.disturbers[name] for name in before.sources}
    tracker = Tracker(before, TrackerParams(noise=50.0))
    tracker.update(samples, FIELD)
    plain = replace(before.at(np.zeros(2)), covariance=before.covariance[:9, :9])  # type: ignore[index]
    beside = Tracker(plain, TrackerParams(noise=50.0))
    beside.update(replace(samples, field=before.cleaned(samples.field, **columns)), FIELD)
    assert np.array_equal(tracker.state.bias, beside.state.bias)
    assert np.array_equal(tracker.state.bias_sd, beside.state.bias_sd)
    off = np.abs(tracker.state.bias - (before.bias - MOVED)) / tracker.state.bias_sd
    assert off.max() < 4
    naive = Tracker(plain, TrackerParams(noise=50.0))
    found = naive.update(samples, FIELD)
    assert found.used.mean() < 0.9  # readings beside a torquer that is on do not fit
    now = tracker.state.interference
    assert now is not None
    field = np.linalg.norm(now.correct(samples.field, **columns), axis=1)
    assert np.sqrt(np.mean((field - 50_000.0) ** 2)) < 70.0


def test_a_track_with_disturbers_is_resumed_exactly(tmp_path: Path) -> None:
    samples, before = flown(1)
    whole, parts = (Tracker(before, TrackerParams(noise=50.0)) for _ in range(2))
    whole.update(samples, FIELD)
    parts.update(samples.select(np.arange(1700)), FIELD)
    resumed = Tracker.resume(parts.save(tmp_path / "state.json"))
    resumed.update(samples.select(np.arange(1700, 3000)), FIELD)
    assert np.array_equal(resumed.state.bias, whole.state.bias)
    assert resumed.state.interference is not None
    assert resumed.state.interference.sources == before.sources
    assert np.array_equal(resumed.state.interference.coefficients, ADDED)


def test_a_log_without_the_columns_and_firmware_are_refused(tmp_path: Path) -> None:
    samples, before = flown(2)
    tracker = Tracker(before, TrackerParams(noise=50.0))
    with pytest.raises(AgonicError, match="torquer_x_Am2"):
        tracker.update(replace(samples, disturbers={}), FIELD)
    tracker.update(samples, FIELD)
    with pytest.raises(AgonicError, match="disturbs on board"):
        write_tracker(tracker.params, tracker.state, tmp_path)
