"""Pages about a flight: what they draw is what was simulated, and they hold in a browser."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.calibration.tracking import TrackerParams
from agonic.cli import run
from agonic.inflight.fit import fit_inflight
from agonic.inflight.report.document import describe_inflight, describe_tracking
from agonic.inflight.report.flight import compare, flight_of_fit, measure_correlated_errors
from agonic.inflight.report.tables import explain
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.inflight.tracking import Tracker
from agonic.report.digits import MINUS, NO_BREAK, THIN
from agonic.simulation import simulate

MOVED = np.array([1500.0, -800.0, 400.0])


def words(page: str) -> str:
    """The words of a page, with plain spaces."""
    body = re.sub(r"<style.*?</style>", " ", page, flags=re.DOTALL)
    text = unescape(re.sub(r"<[^>]*>", " ", body))
    return re.sub(r"\s+", " ", text.replace(THIN, " ").replace(NO_BREAK, " "))


def number(text: str) -> float:
    return float(re.sub(f"[{THIN}{NO_BREAK} +σ]", "", text).replace(MINUS, "-"))


@pytest.fixture(scope="module")
def made():
    return simulate_orbit(n=9000, rate_Hz=0.5, pointing="tumble", external=0.0, seed=11)


@pytest.fixture(scope="module")
def ground(made) -> Affine:
    """The calibration of the ground, off by what has moved since, with its standard errors."""
    now = made.truth.at(10.0)
    return replace(now, bias=now.bias - MOVED, covariance=np.diag([30.0**2] * 3 + [1e-3**2] * 6))


@pytest.fixture(scope="module")
def samples(made):
    """Readings that know no temperature dependence, for the ground calibration is an affine."""
    steady = made.truth.at(10.0)
    raw = made.field_m() @ np.linalg.inv(steady.matrix).T + steady.bias
    noise = np.random.default_rng(1).normal(0.0, 100.0, raw.shape)
    return made.samples.with_columns(field=raw + noise)


@pytest.fixture(scope="module")
def fit(samples, ground):
    return fit_inflight(samples, ground=ground, solve="full", drift_knots=0)


@pytest.fixture(scope="module")
def page(fit, samples) -> str:
    return describe_inflight(fit, samples, title="orbit.csv").to_html()


def test_ground_and_flight_stand_side_by_side_with_the_change_in_sigmas(page, fit, ground) -> None:
    table = page[page.index("Ground against flight") :]
    rows = re.findall(
        r'<tr><th scope="row">(\w+)</th><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td>',
        table,
    )[:9]
    assert [row[0] for row in rows] == "x y z xx yy zz xy xz yz".split()  # noqa: SIM905
    for k, (_, before, after, change, sigmas) in enumerate(rows[:3]):
        sd = np.hypot(30.0, fit.after.sd[k])
        moved = fit.after.bias[k] - ground.bias[k]
        assert number(before.split("±")[0]) == pytest.approx(ground.bias[k], abs=1.0)
        assert number(after.split("±")[0]) == pytest.approx(fit.after.bias[k], abs=1.0)
        assert number(change) == pytest.approx(moved, abs=1.0)
        assert number(sigmas) == pytest.approx(moved / sd, rel=0.02)
        assert moved == pytest.approx(MOVED[k], abs=5 * sd)
    assert max(abs(number(row[4])) for row in rows[3:]) < 5
    bars = re.findall(r'class="bar( far)?"', table)
    assert bars.count(" far") == 3


def test_changes_in_sigmas_are_honest() -> None:
    """Two estimates of one truth are apart by one standard error of their difference, rms."""
    rng = np.random.default_rng(3)
    spread = np.diag([20.0**2] * 3 + [2e-3**2] * 6)
    sigmas = []
    for _ in range(300):
        both = []
        for factor in (1.0, 0.25):
            by = rng.multivariate_normal(np.zeros(9), factor * spread)
            matrix = np.eye(3) + np.array(
                [[by[3], by[6], by[7]], [by[6], by[4], by[8]], [by[7], by[8], by[5]]]
            )
            both.append(Affine(bias=by[:3], matrix=matrix, covariance=factor * spread))
        sigmas += [q.sigmas for group in compare(*both) for q in group.rows]
    assert np.mean(sigmas) == pytest.approx(0.0, abs=0.06)
    assert np.std(sigmas) == pytest.approx(1.0, abs=0.05)


def test_the_shadow_is_drawn_where_the_satellite_was_in_it(page, made) -> None:
    drawn = re.search(r'd="([^"]*)" class="shadow"', page)[1]
    bars = np.array(re.findall(r"M([\d.]+) 0H([\d.]+)V1000", drawn), dtype=float)
    centre = (np.arange(9000) + 0.5) / 9.0
    inside = ((centre[:, None] > bars[:, 0]) & (centre[:, None] < bars[:, 1])).any(axis=1)
    assert (inside == made.eclipse).mean() > 0.998


def test_a_step_in_the_shadow_is_measured(fit, samples, made) -> None:
    stepped = replace(fit, residuals=fit.residuals + 40.0 * made.eclipse)
    said = re.search(
        r"mean is ([^ ]+) ± ([\d.]+) nT from", words(describe_inflight(stepped, samples).to_html())
    )
    step, sd = number(said[1]), float(said[2])
    assert step == pytest.approx(40.0, abs=4 * sd)
    assert sd == pytest.approx(
        100.0 * np.sqrt(1 / made.eclipse.sum() + 1 / (~made.eclipse).sum()), rel=0.2
    )


@pytest.mark.parametrize("what", ["time", "latitude", "temperature", "shadow"])
def test_what_residuals_go_with_is_named(fit, samples, made, what: str) -> None:
    t = samples.time
    pattern = {
        "time": np.sin(2 * np.pi * t / t[-1]),
        "latitude": (np.abs(samples.latitude_deg) > 65.0) - 0.3,
        "temperature": (samples.temperature - samples.temperature.mean()) / 8.0,
        "shadow": made.eclipse - made.eclipse.mean(),
    }[what]
    with_it = replace(fit, residuals=fit.residuals + 150.0 * pattern)
    shares = explain(flight_of_fit(with_it, samples))
    assert shares[0].what == what
    assert shares[0].named
    assert (
        shares[0].cause.split(":")[0]
        in words(describe_inflight(with_it, samples).to_html()).lower()
    )


def test_noise_alone_has_no_cause(fit, samples) -> None:
    shares = explain(flight_of_fit(fit, samples))
    assert {share.what for share in shares} == {"time", "latitude", "temperature", "shadow"}
    assert max(share.share for share in shares) < 0.01
    assert "no cause stands out" in words(describe_inflight(fit, samples).to_html())


def test_the_map_has_each_residual_at_its_place(fit, samples) -> None:
    north = np.sign(samples.latitude_deg) * 300.0
    drawn = describe_inflight(replace(fit, residuals=north), samples).to_html()
    for name, lies in (("high", np.less), ("low", np.greater)):
        cells = "".join(re.findall(rf'd="([^"]*)" class="cell {name}"', drawn))
        tops = np.array(re.findall(r"M[\d.]+ ([\d.]+)h", cells), dtype=float)
        assert len(tops) > 100
        assert lies(tops + 500 / 45, 500 + 20 * (1 if name == "high" else -1)).all()


@pytest.fixture(scope="module")
def drifting(samples, ground):
    return fit_inflight(samples, ground=ground, solve="full", drift_knots=3)


def test_the_band_of_the_bias_is_two_standard_errors(drifting, samples) -> None:
    page = describe_inflight(drifting, samples).to_html()
    svg = page[page.index("Bias along x, y and z, nT: x, nT over") :]
    path = re.search(r'd="([^"]+)" class="band"', svg)[1]
    band = np.array(re.findall(r"([\d.]+) (\d+)", path), dtype=float)
    first = band[band[:, 0] == band[:, 0].min(), 1]
    ticks = re.findall(r'<text y="([\d.]+)%">([^<]+)</text>', page[page.index("x, nT") :])[:2]
    scale = (number(ticks[1][1]) - number(ticks[0][1])) / (float(ticks[0][0]) - float(ticks[1][0]))
    sd = drifting.bias_at(drifting.drift.start)[1][0, 0]
    assert scale * np.ptp(first) / 10 == pytest.approx(4 * sd, rel=0.05)


def test_what_lasts_is_told_from_what_does_not() -> None:
    found, time, kept = [], np.arange(40_000) * 2.0, np.exp(-2.0 / 600.0)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        slow = lfilter([1.0], [1.0, -kept], rng.normal(size=50_000) * np.sqrt(1 - kept**2))
        r = (40.0 * slow + 100.0 * rng.normal(size=50_000))[10_000:]
        found.append(measure_correlated_errors(time, r, np.ones(len(r), dtype=bool)))
    scale, seconds = np.median(found, axis=0)
    assert scale == pytest.approx(40.0, rel=0.1)
    assert seconds == pytest.approx(600.0, rel=0.4)


def test_the_error_of_the_model_is_said_with_its_scale_and_time(fit, samples) -> None:
    told = replace(fit, noise=100.0, lasting_nT=60.0, lasting_s=600.0, correlation=12.0)
    said = words(describe_inflight(told, samples).to_html())
    assert (
        "Of this 80 nT is noise, new in every reading; the other 60 nT are correlated over" in said
    )
    assert "so that 12 readings count as much as an independent one" in said
    alone = replace(fit, lasting_nT=0.0, lasting_s=0.0)
    assert "Successive residuals are uncorrelated" in words(
        describe_inflight(alone, samples).to_html()
    )


def test_the_direction_and_the_currents_are_shown(made, samples) -> None:
    current = np.random.default_rng(7).uniform(0.0, 3.0, len(samples))
    raw = samples.field + current[:, None] * [100.0, -50.0, 20.0]
    log = samples.with_columns(field=raw, current_A=current)
    fit = fit_inflight(log, attitude="logged", sources=("current_A",), drift_knots=0)
    page = describe_inflight(fit, log).to_html()
    row = re.search(r"current_A</th><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td>", page)
    for text, added in zip(row.groups(), (100.0, -50.0, 20.0), strict=True):
        value, sd = (number(part) for part in text.split("±"))
        assert value == pytest.approx(added, abs=5 * sd)
    middle = float(re.search(r"field points ([\d.]+)°", words(page))[1])
    assert middle == pytest.approx(np.median(fit.direction_error_deg), rel=0.05)
    assert "Turn from the axes m to b" in words(page)


def test_what_was_left_out_is_counted_by_reason(samples, ground) -> None:
    rng = np.random.default_rng(2)
    field = samples.field.copy()
    field[rng.choice(4000, 60, replace=False)] += [9_000.0, -7_000.0, 8_000.0]
    field[5000:5007] = np.nan
    flagged = np.zeros(len(field))
    flagged[8000:8100] = 1.0
    torn = samples.with_columns(field=field, flagged=flagged)
    fit = fit_inflight(torn, ground=ground, drift_knots=0)
    said = words(describe_inflight(fit, torn).to_html())
    assert "NaN or infinite field 7" in said
    assert "Flagged in the log (torquers on and the like) 100 " in said
    strays = int(re.search(r"no weight in the robust loss (\d+)", said)[1])
    assert 55 <= strays <= 60
    assert f"{len(torn) - 100 - strays:,}".replace(",", " ") + " readings of 8 993" in said


def test_held_out_errors_of_the_choice_are_shown(fit, samples) -> None:
    chosen = replace(fit, held_out={0: 210.0, 1: 105.0, 2: 104.0})
    said = words(describe_inflight(chosen, samples).to_html())
    assert "constant 210 nT +102 % chosen" in said
    assert "1 interval 105 nT" in said
    assert "so nothing was chosen" in words(describe_inflight(fit, samples).to_html())


def test_a_log_that_knows_little_is_drawn_as_far_as_it_goes() -> None:
    known = simulate("tumble", n=3000, noise=50.0).samples
    fit = fit_inflight(known, ag.Reference.constant(50_000.0), drift_knots=0)
    said = words(describe_inflight(fit, known).to_html())
    assert "The log does not hold latitude, temperature, sunlight and shadow" in said
    assert "no ground calibration to compare with" in said
    assert not re.search(r"\bnan\b", said.lower())


def test_without_the_samples_only_the_map_is_missing(fit) -> None:
    said = words(describe_inflight(fit).to_html())
    assert "The log does not hold place: not drawn." in said
    assert "Along temperature" in said


def test_a_long_mission_makes_a_small_page(fit, samples) -> None:
    n = 500_000
    rng = np.random.default_rng(0)
    rows = np.arange(n) % len(samples)
    columns = {name: values[rows] for name, values in samples.columns().items() if name != "time"}
    time = np.arange(n) * 10.0
    long = replace(samples, **columns, time=time)
    residuals = rng.normal(0, 100.0, n)
    residuals[123_456] = 90_000.0
    told = replace(
        fit,
        time=time,
        residuals=residuals,
        weights=np.ones(n),
        eclipse=None,
        latitude_deg=long.latitude_deg,
        temperature=long.temperature,
    )
    drawn = describe_inflight(told, long).to_html()
    assert len(drawn) < 300_000
    assert "1 reading lies beyond the edges (arrows), the farthest at 90 000 nT" in words(drawn)


@pytest.fixture(scope="module")
def tracked(samples, ground):
    jumped = samples.field + np.where(np.arange(len(samples)) >= 6000, 2500.0, 0.0)[:, None]
    log = samples.with_columns(field=jumped)
    tracker = Tracker(ground, TrackerParams(noise=100.0, walk=0.1))
    return tracker, tracker.update(log, ag.igrf().along(log)), log


def test_the_tracker_shows_its_jump_and_its_predictions(tracked) -> None:
    tracker, _, log = tracked
    page = describe_tracking(*tracked, title="log.csv").to_html()
    said = words(page)
    assert "Calibration followed in flight" in said
    assert "rms, before each was used" in said
    assert "all of them are held out" in said
    (jump,) = tracker.jumps
    svg = page[page.index("Bias along x, y and z, nT: x, nT over") :]
    at = float(re.search(r'd="M([\d.]+) 0V1000" class="jump"', svg)[1])
    history = tracker.history[:, 0]
    assert at == pytest.approx(1000 * (jump.time - history[0]) / (log.time[-1] - history[0]), abs=2)
    assert len(page) < 200_000


@pytest.mark.parametrize("width", [360, 400, 768, 1200])
def test_the_pages_fit_every_width_and_fetch_nothing(opened, page, tracked, width) -> None:
    for text in (page, describe_tracking(*tracked).to_html()):
        shown = opened(text, viewport={"width": width, "height": 900})
        assert shown.evaluate("document.documentElement.scrollWidth") == width
        assert [url for url in shown.requests if not url.startswith("data:")] == [shown.url]
        assert shown.complaints == []


def test_figures_have_the_same_size_as_their_ticks(opened, drifting, samples) -> None:
    shown = opened(describe_inflight(drifting, samples).to_html())
    for kind in ("short", "map"):
        area = shown.locator(f".plot.{kind} .area").first.bounding_box()
        ticks = shown.locator(f".plot.{kind} .ticks-y").first.bounding_box()
        assert ticks["height"] == pytest.approx(area["height"], abs=2)
        assert ticks["y"] == pytest.approx(area["y"], abs=2)


def test_an_evil_title_is_text(opened, fit, samples) -> None:
    evil = "</title><script>alert(1)</script>"
    shown = opened(describe_inflight(fit, samples, title=evil).to_html())
    assert shown.locator("h1").inner_text() == evil
    assert shown.locator("script").count() == 0


@pytest.mark.slow
def test_the_commands_write_their_pages(tmp_path: Path, monkeypatch, samples, ground) -> None:
    monkeypatch.chdir(tmp_path)
    ag.write_csv(samples, "orbit.csv")
    ag.save(ground, "ground.json")
    asked = ["orbit.csv", "--ground", "ground.json"]
    assert run(["fit", "inflight", *asked, "--knots", "0", "-o", "now.json"]) == 0
    assert "Ground against flight" in words(Path("now.html").read_text())
    assert run(["track", *asked, "--state", "s.json", "--walk", "0.1", "--report", "t.html"]) == 0
    assert "Calibration followed in flight" in words(Path("t.html").read_text())


def test_a_refused_fit_still_shows_why(tmp_path: Path, monkeypatch, samples, ground) -> None:
    monkeypatch.chdir(tmp_path)
    ag.write_csv(samples.with_columns(altitude_m=samples.altitude_m / 1000), "orbit.csv")
    ag.save(ground, "ground.json")
    asked = ["orbit.csv", "--ground", "ground.json", "--knots", "0", "-o", "now.json"]
    assert run(["fit", "inflight", *asked]) == 1
    assert not Path("now.json").exists()
    said = words(Path("now.html").read_text())
    assert "Refused : do not use" in said
    assert "where nothing orbits" in said
