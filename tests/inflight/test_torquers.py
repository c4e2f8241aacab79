"""Torquers in orbit: modelled by their commands, left out where they are not, and their decay."""

from __future__ import annotations

import numpy as np
import pytest

from agonic.calibration.sources import parse_source
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.inflight.fit import fit_inflight, fit_mission, large_scan
from agonic.inflight.fit.torquers import find_settling_s
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.samples import Samples
from tests.inflight.test_mission import Pieces

COMMANDS = ("torquer_x_Am2", "torquer_y_Am2", "torquer_z_Am2")
TORQUER = 3000.0


def flown(seed: int, settling_s: float, n: int = 4000) -> tuple[Samples, Thermal, np.ndarray]:
    made = simulate_orbit(
        n=n,
        noise=50.0,
        external=0.0,
        moved=800.0,
        torquer=TORQUER,
        torquer_settling_s=settling_s,
        pointing="tumble",
        seed=seed,
    )
    moved = made.ground.matrix[0] @ (made.truth.bias[0] - made.ground.bias[0])
    return made.samples, made.ground, moved


@pytest.mark.slow
def test_what_a_torquer_adds_is_found_within_its_stated_error() -> None:
    scaled = []
    for seed in range(8):
        samples, ground, moved = flown(seed, 0.0)
        fit = fit_inflight(samples, ground=ground, sources=COMMANDS, drift_knots=0)
        added = fit.sources * 0.2 / TORQUER - ground.matrix[0]
        scaled.append(added / (fit.sources_sd * 0.2 / TORQUER))
        assert np.linalg.norm(fit.change.bias - moved) < 5 * np.linalg.norm(fit.sd[:3])
        assert "torquers settling" not in [finding.name for finding in fit.findings]
    assert 0.75 < np.sqrt(np.mean(np.square(scaled))) < 1.25


@pytest.mark.slow
def test_the_time_constant_of_torquers_is_found_and_no_reading_is_lost() -> None:
    """The field follows a command exponentially: modelled, all readings take part."""
    scaled, constants = [], []
    for seed in range(6):
        samples, ground, moved = flown(seed, 2.0)
        fit = fit_inflight(samples, ground=ground, sources=COMMANDS, drift_knots=0)
        said = {finding.name: finding for finding in fit.findings}
        assert "time constant of" in said["torquers followed"].what
        assert "torquers settling" not in said
        assert fit.n == len(samples)
        added = fit.sources * 0.2 / TORQUER - ground.matrix[0]
        scaled.append(added / (fit.sources_sd * 0.2 / TORQUER))
        constants.append(-parse_source(fit.source_names[0]).time_constant_s)
        assert np.linalg.norm(fit.change.bias - moved) < 5 * np.linalg.norm(fit.sd[:3])
    assert 0.75 < np.sqrt(np.mean(np.square(scaled))) < 1.25
    assert np.abs(np.array(constants) - 2.0).max() < 0.04


@pytest.mark.slow
def test_a_mission_in_pieces_leaves_out_what_one_piece_does(monkeypatch) -> None:
    """Switches are followed across pieces and counted in all rows, not in the thinned ones."""
    samples, ground, _ = flown(4, 2.0, n=20_000)
    whole = fit_inflight(samples, ground=ground, drift_knots=0)
    for most, share, apart in ((20_000, 0.0, 0.3), (3_000, 0.1, 2.0)):  # fewer rows tell less
        monkeypatch.setattr(large_scan, "MOST", most)
        fit = fit_mission(Pieces(samples, 3_777), ground=ground, drift_knots=0)
        assert abs(fit.n - whole.n) <= share * whole.n
        assert np.abs((fit.change.bias - whole.change.bias) / whole.sd[:3]).max() < apart
        assert "torquers on" in [finding.name for finding in fit.findings]
    modelled = fit_mission(Pieces(samples, 3_777), ground=ground, drift_knots=0, sources=COMMANDS)
    assert "torquers settling" in [finding.name for finding in modelled.findings]
    assert modelled.n > 1.1 * fit.n
    added = modelled.sources * 0.2 / TORQUER
    assert np.abs(added - ground.matrix[0]).max() < 0.02
    with pytest.raises(AgonicError, match="piece by piece"):
        fit_mission(Pieces(samples, 3_777), ground=ground, sources=("torquer_x_Am2~-2",))


def test_torquers_that_are_not_modelled_are_left_out_while_on() -> None:
    samples, ground, moved = flown(4, 1.0)
    fit = fit_inflight(samples, ground=ground, drift_knots=0)
    said = {finding.name: finding for finding in fit.findings}
    assert "torquer_x_Am2,torquer_y_Am2,torquer_z_Am2" in said["torquers on"].move
    assert fit.verdict == "good"
    assert np.linalg.norm(fit.change.bias - moved) < 5 * np.linalg.norm(fit.sd[:3])
    always = samples.with_columns(
        disturbers={name: values + 0.01 for name, values in samples.disturbers.items()}
    )
    kept = fit_inflight(always, ground=ground, drift_knots=0)
    assert "torquers always on" in [finding.name for finding in kept.findings]


def test_settling_is_not_seen_in_noise() -> None:
    since = np.tile(np.arange(40.0), 60)
    found = [
        find_settling_s(since, np.random.default_rng(seed).standard_normal(len(since)), 1.0)
        for seed in range(50)
    ]
    assert np.mean(np.array(found) > 0) <= 0.04
