"""Torquers in orbit: modelled by their commands, left out where they are not, and their decay."""

from __future__ import annotations

import numpy as np

from agonic.calibration.thermal import Thermal
from agonic.inflight.fit import fit_inflight
from agonic.inflight.fit.torquers import find_settling_s
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.samples import Samples

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


def test_readings_while_torquers_settle_are_found_and_left_out() -> None:
    samples, ground, _ = flown(3, 2.0)
    fit = fit_inflight(samples, ground=ground, sources=COMMANDS, drift_knots=0)
    said = {finding.name: finding for finding in fit.findings}
    assert "torquers settling" in said
    assert fit.n < 0.95 * len(samples)
    added = fit.sources * 0.2 / TORQUER
    assert np.abs(added - ground.matrix[0]).max() < 0.02
    assert fit.noise < 60.0


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
