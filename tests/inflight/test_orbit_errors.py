"""What goes round with the orbit is not taken for the bias: clocks, tracks, sunlight."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from agonic.inflight.fit import fit_inflight
from agonic.inflight.fit.pointing import find_eclipse, find_sun_height
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.simulation import simulate
from tests.inflight.test_fit import GROUND, orbit


def late(samples, rows: int):
    """The log with positions of so many rows later."""
    shifted = {
        name: np.roll(getattr(samples, name), -rows)
        for name in ("latitude_deg", "longitude_deg", "altitude_m")
    }
    return samples.with_columns(**shifted).select(np.arange(len(samples) - rows))


@pytest.mark.parametrize("seconds", [30, 90])
def test_a_clock_that_is_off_is_named_with_its_seconds(seconds: int) -> None:
    fit = fit_inflight(late(orbit(1, n=1200), seconds // 10), ground=GROUND)
    assert fit.verdict == "refused"
    told = next(finding for finding in fit.findings if finding.name == "reference")
    found = float(told.what.split("positions ")[1].split(" s")[0].replace("−", "-"))
    assert found == pytest.approx(-seconds, abs=3.0)


def test_no_clock_is_blamed_where_the_place_hardly_changes() -> None:
    """A log of one place was told "positions −4 s off in time", as its field could not change."""
    made, here = simulate("circle", n=600, noise=400.0).samples, np.ones(600)
    parked = made.with_columns(
        latitude_deg=52.1 * here, longitude_deg=5.2 * here, epoch=datetime(2026, 5, 1, tzinfo=UTC)
    )
    assert "would explain it" not in fit_inflight(parked).status


@pytest.mark.slow
def test_heights_off_by_20_km_are_no_bias() -> None:
    """The spline of the bias takes them up, with some 100 nT stated for 300 of error."""
    samples = orbit(2)
    high = samples.with_columns(altitude_m=samples.altitude_m + 20e3)
    fit = fit_inflight(high, ground=GROUND)
    assert "bias follows the orbit" in {finding.name for finding in fit.findings}


def test_a_bias_that_changes_slowly_is_no_error_of_the_orbit() -> None:
    moved = np.outer(np.linspace(-1, 1, 3000), [300.0, -200.0, 100.0])
    fit = fit_inflight(orbit(3, step_s=20.0, moved=moved), ground=GROUND)
    assert fit.drift.changes
    assert fit.verdict == "good"


@pytest.mark.parametrize("stepped", [True, False])
def test_a_step_of_the_bias_is_told_from_a_steady_drift(stepped: bool) -> None:
    course = (np.arange(1200) >= 700) if stepped else np.linspace(0.0, 1.0, 1200)
    samples = orbit(4, n=1200, moved=np.outer(course, [500.0, -400.0, 300.0]))
    fit = fit_inflight(samples, ground=GROUND, drift_knots=8)
    told = [finding.what for finding in fit.findings if finding.name == "bias stepped"]
    assert bool(told) == stepped
    if stepped:
        assert float(told[0].split("t = ")[1].split(" s")[0]) == pytest.approx(7000.0, abs=200.0)


def test_other_gains_are_told_from_a_bias_that_swings() -> None:
    """2 % of gain asked for many intervals of the bias, and the clock was blamed."""
    plain = orbit(1, n=1000)
    spoilt = plain.with_columns(field=1.02 * plain.field)
    fit = fit_inflight(spoilt, ground=GROUND, drift_knots=16)
    told = [finding.what for finding in fit.findings if finding.name == "gains changed"]
    assert 1.7 < float(told[0].split("gains that are ")[1].split(" %")[0]) < 2.3
    assert "bias follows the orbit" not in fit.status


@pytest.mark.slow
def test_a_drift_is_neither_other_gains_nor_surer_than_the_world_model() -> None:
    """300 nT over two orbits: told as gains (seed 1), or good and 4 sd off (5 and 10)."""
    for seed in (1, 5, 10):
        made = simulate_orbit(
            n=3000, rate_Hz=0.25, thermal=0.0, moved=500.0, pointing="nadir", seed=seed
        )
        ground = replace(made.ground.at(20.0), covariance=np.diag([2500.0] * 3 + [1e-6] * 6))
        way = np.random.default_rng(seed).standard_normal(3)
        moved = np.outer(np.linspace(0, 1, 3000), 300.0 * way / np.linalg.norm(way))
        samples = made.samples.with_columns(temperature=None, field=made.samples.field + moved)
        fit = fit_inflight(samples, ground=ground)
        assert "gains changed" not in {finding.name for finding in fit.findings}
        away = fit.after.bias - made.truth.at(20.0).bias - moved[-1]
        sd = np.sqrt(np.diag(fit.after.covariance))[:3]
        assert np.sqrt(np.mean((away / sd) ** 2)) < 3.2


def test_a_current_that_comes_and_goes_is_in_the_standard_error() -> None:
    """On and off at random for a minute, 300 nT, nine numbers free: good and 7 errors off."""
    made = simulate_orbit(n=2000, rate_Hz=0.25, thermal=0.0, pointing="tumble", seed=3)
    rng = np.random.default_rng(3)
    on = np.cumsum(rng.random(2000) < 1 / 15) % 2
    plain = made.samples.with_columns(temperature=None)
    for size in (0.0, 300.0):
        current = np.outer(on, size * np.array([0.6, -0.64, 0.48]))
        fit = fit_inflight(plain.with_columns(field=plain.field + current))
        away = (fit.after.bias - made.truth.at(20.0).bias)[None] - current[[0, np.argmax(on)]]
        assert np.sqrt(np.mean((away / fit.sd[:3]) ** 2)) < 3.0
        assert ("switching current" in {one.name for one in fit.findings}) == (size > 0.0)
        assert (fit.verdict == "good") == (size == 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["shadow", "panels"])
def test_a_bias_that_goes_with_the_sunlight_is_in_the_standard_error(kind: str) -> None:
    """Of the shadow 200 nT: error over standard error was 3 to 10, and the verdict good."""
    z, checks = [], 0
    for seed in range(3):
        plain = orbit(seed, step_s=20.0)
        dark, height = find_eclipse(plain), find_sun_height(plain)
        shine = dark if kind == "shadow" else np.where(dark, 0.0, np.maximum(height, 0.0))
        moved = np.outer(shine, 200.0 * np.array([0.6, -0.64, 0.48]))
        fit = fit_inflight(orbit(seed, step_s=20.0, moved=moved), ground=GROUND)
        z.append((fit.change.bias - moved[::100]) / fit.sd[:3])
        checks += fit.verdict == "check"
    assert 0.3 < np.sqrt(np.mean(np.square(z))) < 1.8
    assert checks >= 2


@pytest.mark.slow
def test_nothing_is_said_of_the_sunlight_where_it_does_nothing() -> None:
    for seed in range(3):
        fit = fit_inflight(orbit(seed, step_s=20.0, external=20.0), ground=GROUND)
        assert fit.verdict == "good"
