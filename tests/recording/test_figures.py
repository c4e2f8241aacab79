"""The strips: nothing is lost, and everything stands where the axis says."""

import re
from dataclasses import replace

import numpy as np
import pytest

import agonic as ag
from agonic.recording import figures
from agonic.recording.quantities import compute_residuals
from agonic.report.axes import Axis, along_rows
from agonic.simulation import simulate
from tests.recording.handmade import samples_of, tumble


def draw(shown) -> str:
    return "".join(one if isinstance(one, str) else one.to_html() for one in shown)


def draw_strip(result, residuals) -> str:
    return draw([figures.draw_strip(result, residuals, "Residuals", "± noise")])


def draw_histogram(residuals) -> str:
    return draw([figures.draw_histogram(residuals)])


def draw_magnitude(result) -> str:
    return draw([figures.draw_magnitude(result)])


def path(svg: str, name: str) -> np.ndarray:
    """The points of the path of that class, in thousandths of the area."""
    d = re.search(rf'<path d="([^"]*)" class="{name}">', svg).group(1)
    return np.array(re.findall(r"(-?[\d.]+) (-?[\d.]+)", d), dtype=float)


@pytest.mark.parametrize(("low", "high"), [(0, 47), (-3e4, 7e4), (0.001, 0.0042), (0, 1e-9)])
def test_ticks_are_round_and_inside(low, high):
    ticks = Axis("", low, high).ticks()
    assert 2 <= len(ticks) <= 8
    assert ticks[0] >= low - 1e-12 * high
    assert ticks[-1] <= high * (1 + 1e-9)
    step = np.diff(ticks).mean()
    assert step / 10 ** np.floor(np.log10(step) + 1e-9) == pytest.approx(
        min((1, 2, 5), key=lambda m: abs(m - step / 10 ** np.floor(np.log10(step) + 1e-9)))
    )


@pytest.mark.parametrize(("seconds", "unit"), [(50, "s"), (900, "min"), (10_000, "h")])
def test_time_is_counted_in_a_unit_that_fits(good, seconds, unit):
    time = 5.0 + np.linspace(0, seconds, len(good.samples))
    axis, along = along_rows(time, np.arange(len(time)))
    assert axis.label == f"time since the first reading (t = 5.0 s), {unit}"
    assert along[-1] == axis.high == pytest.approx(seconds / {"s": 1, "min": 60, "h": 3600}[unit])


def test_a_log_without_times_is_drawn_by_reading(good):
    axis, along = along_rows(None, np.arange(len(good.samples)))
    assert axis.label == "reading"
    assert along[-1] == len(good.samples) - 1


def with_residuals(result, values):
    return replace(result, fit=replace(result.fit, residuals=values))


def test_a_single_peak_of_a_long_log_is_drawn(good):
    values = good.fit.residuals.copy()
    values[3000] = 700.0
    peaked = with_residuals(good, values)
    residuals = compute_residuals(peaked)
    points = path(draw_strip(peaked, residuals), "range")
    top = points[np.argmin(points[:, 1])]
    assert top[1] == pytest.approx(500 * (1 - 700 / residuals.limit), abs=1)
    assert top[0] == pytest.approx(500, abs=2)


def test_the_mean_shows_a_drift_that_noise_hides(good):
    drift = np.linspace(-60, 60, len(good.samples))
    drifting = with_residuals(good, good.fit.residuals + drift)
    residuals = compute_residuals(drifting)
    mean = path(draw_strip(drifting, residuals), "mean")
    slope = np.polyfit(mean[:, 0], mean[:, 1], 1)[0]
    assert slope == pytest.approx(-60 / residuals.limit, rel=0.15)


def test_held_out_stretches_are_marked(good):
    svg = draw_strip(good, compute_residuals(good))
    d = re.search(r'<path d="([^"]*)" class="held-out">', svg).group(1)
    marks = np.array(re.findall(r"M([\d.]+) 990H([\d.]+)", d), dtype=float)
    assert np.sum(marks[:, 1] - marks[:, 0]) == pytest.approx(200, abs=5)


def test_the_histogram_meets_the_normal_curve_of_the_noise(good):
    svg = draw_histogram(compute_residuals(good))
    curve, bars = path(svg, "normal"), path(svg, "bars")
    assert curve[np.argmin(curve[:, 1]), 0] == pytest.approx(500, abs=5)
    tops = np.interp(curve[20:-20, 0], bars[:, 0], bars[:, 1])
    assert np.abs(tops - curve[20:-20, 1]).mean() < 20


def test_magnitudes_before_and_after(good):
    svg = draw_magnitude(good)
    before, after = path(svg, "before"), path(svg, "after")
    assert np.ptp(before[:, 1]) > 800
    assert np.ptp(after[:, 1]) < 40


def test_a_sensor_that_says_always_the_same_can_be_drawn(good):
    still = samples_of(tumble(2)).with_columns(field=np.full((2, 3), 100.0))
    after = np.full(2, 50_000.0)
    result = replace(
        good,
        samples=still,
        fit=replace(good.fit, residuals=np.zeros(2), weights=np.ones(2), noise=0.0),
        verification=replace(
            good.verification, magnitude_before=after, magnitude_after=after, held_out=None
        ),
    )
    residuals = compute_residuals(result)
    strips = (
        draw_strip(result, residuals),
        draw_histogram(residuals),
        draw_magnitude(result),
    )
    assert "nan" not in "".join(strips)


def test_strays_that_did_not_count_are_arrows_and_set_no_scale(logged):
    weights = np.where(np.arange(len(logged.samples)) % 211 == 0, 0.0, 1.0)
    strayed = replace(logged, fit=replace(logged.fit, weights=weights))
    residuals = compute_residuals(strayed)
    assert np.abs(residuals.values).max() > 10 * residuals.limit
    svg = draw_strip(strayed, residuals)
    assert 'class="beyond"' in svg
    assert "▲" in svg
    mean = path(svg, "mean")
    assert np.std(mean[:, 1]) > 1.5  # not flattened: of a thousand


def test_readings_in_another_unit_have_an_axis_of_their_own(good):
    """Counts on an axis of nanotesla would be a flat line."""
    counted = replace(good.fit.calibration, unit_in="raw")
    before = good.verification.magnitude_before / 100.0
    result = replace(
        good,
        fit=replace(good.fit, calibration=counted),
        verification=replace(good.verification, magnitude_before=before),
    )
    drawn = draw_magnitude(result)
    assert re.findall(r">magnitude, ([^<]+)<", drawn) == ["raw units", "nT"]
    spread = np.ptp(path(drawn, "before")[:, 1])
    assert spread > 500  # of a thousand: the strip is used


def test_the_heading_is_shown_before_and_after_and_by_each_fit(good):
    made = ag.calibrate(simulate("hand", n=800, seed=3).samples, 50_000)
    drawn = draw(figures.draw_headings(made))
    before, *others = (np.array(one.errors_deg) for one in made.ladder)
    assert len(before) == 36
    assert np.sqrt(np.mean(before**2)) == pytest.approx(made.ladder[0].heading_error_deg, rel=0.02)
    assert drawn.count('class="mean"') == len(others)  # those between are folded, the chosen is 0
    assert np.abs(others[-1]).max() < 1e-6
    assert 'class="noise"' in drawn


def test_an_interval_of_time_is_picked_by_the_clock_of_the_log(good):
    time = 5.0 + 0.1 * np.arange(len(good.samples))
    axis, _ = along_rows(time, np.arange(len(time)))
    assert axis.clock == (time[0], time[-1])
    assert along_rows(None, np.arange(9))[0].clock is None
