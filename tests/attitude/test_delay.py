"""The delay of a magnetometer beside a raw gyro: found, kept in the calibration, and counted."""

from dataclasses import replace

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.latency import LATENCY_SD_S, fit_latency
from agonic.attitude.undo_latency import advance, keep_latency, measure_rate
from agonic.calibration.setup import Compass, Setup
from agonic.health import figure
from agonic.model.verdict import check_coverage
from agonic.simulation import (
    delayed,
    duplicated,
    simulate,
    with_correlated_noise,
    with_inertial_unit,
    with_outliers,
)

BROKEN = {
    "as it should be": lambda seed: lambda s: s,
    "noise with a memory": lambda seed: with_correlated_noise(300.0, 0.5, seed=seed),
    "outliers": lambda seed: with_outliers(0.03, seed=seed),
    "a gyro 1 % off": lambda seed: lambda s: s.with_columns(rotation_rate=1.01 * s.rotation_rate),
}


def log(kind: str, seed: int, late_s: float = 0.0, **settings) -> ag.Samples:
    """A raw inertial log whose magnetometer is late."""
    made = simulate(kind, seed=seed, **{"n": 1500, **settings})
    bare = with_inertial_unit(seed=seed)(made.samples)
    return delayed(late_s)(bare) if late_s else bare


@pytest.mark.slow
@pytest.mark.parametrize("broken", list(BROKEN))
def test_its_error_is_as_stated_beside_a_raw_gyro(broken: str) -> None:
    z = []
    for seed in range(5):
        fit = fit_latency(BROKEN[broken](seed)(log("flight", seed, 0.02)))
        assert fit.known
        z.append((fit.latency_s - 0.02) / fit.sd_s)
    assert 0.3 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert abs(np.mean(z)) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["circle", "car", "boat"])
def test_a_drive_on_time_is_left_on_time(kind: str) -> None:
    """Where little turns, the noise makes minima far from zero."""
    fits = [fit_latency(log(kind, seed)) for seed in range(5)]
    assert max(abs(fit.undone_s) for fit in fits) < 0.005
    assert all(0.0 < fit.left_sd_s <= LATENCY_SD_S for fit in fits)


@pytest.mark.slow
def test_beside_roll_and_pitch_it_is_that_of_the_heading_made_with_them() -> None:
    """Roll and pitch 4 ms early beside the gyro, the readings 11 ms late."""
    found = []
    for seed in range(4):
        samples = delayed(0.011)(simulate("hand", n=2500, seed=seed).samples)
        early = ag.undelayed(samples, -0.004)
        rows = np.arange(len(early))
        early = samples.select(rows).with_columns(
            roll_deg=early.roll_deg, pitch_deg=early.pitch_deg, heading_deg=None
        )
        fit = fit_latency(early)
        assert fit.method == "tilt"
        assert fit.significant
        found.append(1e3 * fit.latency_s)
    assert np.mean(found) == pytest.approx(15.0, abs=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [-0.5, 0.5])
def test_clocks_far_apart_are_found(late_s: float) -> None:
    fit = fit_latency(log("circle", 1, late_s))
    assert fit.significant
    assert fit.latency_s == pytest.approx(late_s, abs=4 * fit.sd_s)


def test_a_slow_sensor_is_not_late_by_half_of_its_interval() -> None:
    held = duplicated(10)(log("hand", 2))
    fit = fit_latency(held)
    assert not fit.significant
    assert abs(fit.latency_s) < 0.004
    slow = log("hand", 2)
    rows = np.arange(len(slow)) // 10 * 10
    slow = slow.with_columns(rotation_rate=slow.rotation_rate[rows])
    assert abs(fit_latency(slow).latency_s) < 0.004


def test_a_calibration_carries_it_with_its_error() -> None:
    late = log("tumble", 3, 0.03)
    made = ag.calibrate(late, 50_000.0)
    fit = fit_latency(late)
    assert made.calibration.latency_s == fit.latency_s
    assert made.calibration.latency_sd_s == fit.sd_s
    turned = np.degrees(measure_rate(late) * fit.sd_s)
    sd = made.fit.coverage.heading_sd_deg
    assert sd > turned
    assert f"heading {figure(sd)}°" in made.status, "words and numbers state the same"
    assert Compass(calibration=made.calibration).latency_sd_s == fit.sd_s
    assert Compass(calibration=made.calibration, latency_s=0.0).latency_sd_s is None


def test_a_delay_that_a_fast_log_does_not_tell_is_named() -> None:
    """Ten milliseconds at 500°/s are 5° of heading, whatever the magnitude tells."""
    made = simulate("tumble", n=1500, pace_s=0.3, seed=4)
    samples = with_inertial_unit(seed=4)(made.samples)
    fit, told = ag.fit_ellipsoid(samples, 50_000.0), fit_latency(samples)
    unknown = replace(told, sd_s=np.inf, known=False, significant=False)
    kept = keep_latency(fit, samples, unknown)
    (named,) = [one for one in kept.findings if one.name == "delay"]
    assert "10 ms only" in named.what
    turned = np.degrees(measure_rate(samples) * LATENCY_SD_S)
    assert kept.coverage.heading_sd_deg == pytest.approx(turned, rel=0.01)
    assert kept.calibration.latency_sd_s == LATENCY_SD_S
    axes, rest = "of the sensor's own axes", figure(fit.coverage.heading_sd_deg)
    both = f"{figure(turned)}° {axes} while turning as in this log, {rest}° {axes} at rest"
    assert both in kept.status
    assert keep_latency(fit, samples, told).verdict == "good"
    assert keep_latency(fit, samples, None) is fit
    doubted = replace(fit, coverage=replace(fit.coverage, heading_sd_deg=4.0))
    doubted = doubted.with_findings(check_coverage(doubted.coverage))
    stated = keep_latency(doubted, samples, unknown)
    said = next(finding.what for finding in stated.findings if finding.name == "coverage")
    assert (
        f"uncertain by {figure(stated.coverage.heading_sd_deg)}°, the error of the delay included"
        in said
    )


@pytest.mark.parametrize(
    ("motion", "latency_sd_s", "least"),
    # a hand's late readings disturb magnitude and dip too, which counts beside the delay
    [("hand", 0.01, 0.5), ("circle", None, 0.85)],
)
def test_the_heading_of_each_row_counts_it(motion, latency_sd_s, least) -> None:
    """Delays that scatter as stated turn headings by no more than stated; also without a gyro, and
    where nothing told the delay."""
    made = simulate(motion, n=1500, noise=0.0, seed=5)
    quiet = replace(made.truth, covariance=np.zeros((9, 9)), noise=0.0)
    compass = Compass(calibration=quiet, latency_s=0.0, latency_sd_s=latency_sd_s)
    setup = Setup(compasses=(compass,), declination_deg=0.0, tilt_sd_deg=0.0)
    squares, stated = [], []
    delays = np.random.default_rng(0).standard_normal(12)
    for late_s in 0.01 * delays / np.sqrt(np.mean(delays**2)):
        samples = delayed(late_s)(made.samples).with_columns(rotation_rate=None)
        found = ag.heading(samples, setup, smooth=False)
        off = (found.true_deg - samples.heading_deg + 180.0) % 360.0 - 180.0
        level = np.abs(found.pitch_deg) < 45.0
        squares.append(np.mean(off[level] ** 2))
        stated.append(np.mean(found.sd_deg[level] ** 2))
    assert least < np.sqrt(np.mean(squares) / np.mean(stated)) < 1.15


@pytest.mark.slow
def test_the_fit_beside_accelerometer_and_gyro_finds_it_by_itself() -> None:
    made = simulate("circle", tilt_deg=10.0, n=2000, inclination_deg=65.0, seed=6)
    late = delayed(0.1)(with_inertial_unit(seed=6)(made.samples))
    place = ag.Reference.vector(made.field_n, frame="n")
    fit = ag.fit_inertial(late, place)
    assert fit.calibration.latency_s == pytest.approx(0.1, abs=0.015)
    assert fit.calibration.latency_sd_s < 0.006
    assert (np.abs(fit.calibration.bias - made.truth.bias) < 4 * fit.sd[:3]).all()
    assert ag.fit_inertial(late, place, latency=False).calibration.latency_s == 0.0


def test_a_field_brought_to_the_rows_is_that_of_their_moments() -> None:
    made = simulate("hand", n=500, noise=0.0, seed=7)
    late = delayed(0.05)(made.samples)
    truth = replace(made.truth, latency_s=0.05)
    off = advance(truth.correct(late.field), late, truth) - truth.correct(
        made.samples.select(np.arange(len(made.samples) - len(late), len(made.samples))).field
    )
    assert np.abs(off[5:-5]).max() < 400.0  # of 50 000: interpolated twice between 20 ms
