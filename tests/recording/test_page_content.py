"""What the report says, and that nothing in a log can make it say something else."""

import re
from dataclasses import replace
from html import unescape
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import agonic.report
from agonic.calibration.interference import mean_of
from agonic.health import Finding
from agonic.recording.document import describe_recording, render
from agonic.recording.quantities import list_quantities
from agonic.report.digits import MINUS, THIN
from tests.recording.handmade import calibrated, samples_of, tumble

ENTRIES = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)]
EVIL = "</script><img src=x onerror=alert(1)>&\"'"


def text_of(page: str) -> str:
    """The words of a page, with plain spaces."""
    body = re.sub(r"<(script|style).*?</\1>", " ", page, flags=re.DOTALL)
    words = unescape(re.sub(r"<[^>]*>", " ", body))
    return re.sub(r"\s+", " ", words.replace(THIN, " "))


@pytest.fixture(scope="module")
def report(good, logged, refused) -> str:
    exports = {"MAG0": ["MAG0.params", "MAG0.json"]}
    return render([good, logged, refused], title="flight.ulg", exports=exports)


def test_every_number_stands_in_the_table_with_its_standard_error(report, logged):
    article = (
        report[report.index('id="sensor-2"') :].split("<h3>Numbers")[1].split("<h3>Magnitude")[0]
    )
    rows = re.findall(
        r'<th scope="row">(\w+)</th><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td>', article
    )
    plain = [
        [
            float(c.replace(THIN, "").replace(MINUS, "-").replace("\N{NO-BREAK SPACE}", ""))
            for c in (*new.split("±"), old, change)
        ]
        for _, new, old, change in rows
    ]
    calibration, before = logged.fit.calibration, logged.samples.logged
    order = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])
    value = np.concatenate([calibration.bias, calibration.matrix[order]])
    old = np.concatenate([before.bias, before.matrix[order]])
    assert [name for name, *_ in rows[:9]] == "x y z xx yy zz xy xz yz".split()  # noqa: SIM905
    shown = np.array(plain)[:9]
    assert np.all(np.abs(shown[:, 0] - value) <= 0.06 * logged.fit.sd)
    np.testing.assert_allclose(shown[:, 1], logged.fit.sd, rtol=0.06)
    assert np.all(np.abs(shown[:, 2] - old) <= 0.06 * logged.fit.sd)
    assert np.all(np.abs(shown[:, 3] - (value - old)) <= 0.06 * logged.fit.sd)
    angles = np.array(plain)[12:15, 0]
    np.testing.assert_allclose(angles, calibration.nonorthogonality_deg, atol=1e-3)


def test_the_summary_leads_to_each_sensor(report):
    assert re.findall(r'<a href="#(sensor-\d)">(\w+)</a>', report) == [
        ("sensor-1", "MAG0"),
        ("sensor-2", "MAG1"),
        ("sensor-3", "MAG2"),
    ]
    for number in "123":
        assert report.count(f'id="sensor-{number}"') == 1


def test_one_sensor_needs_no_summary(good):
    assert 'class="summary"' not in render([good], title="one")


def test_a_refusal_says_what_to_do_before_anything_else(report, refused):
    article = text_of(report[report.index('id="sensor-3"') :])
    told = article.index("Turn it upside down and once about every axis.")
    assert article.index("Refused : do not use") < told < article.index("Numbers")
    assert "Turns to add: Nose down, then roll right 90°." in article
    assert "16 of 80 directions were visited" in article
    assert "undetermined" in article


def test_verification_model_findings_exports_and_provenance_are_there(report, logged):
    words = text_of(report)
    for said in (
        "spread 0.294 % 2.00 % Passed The magnitude is as constant as the noise lets it be",
        "magnitude against the world model −120 nT – For information Iron near",
        "Checked on 1 200 readings held out of the fit.",
        "Soft iron is present (p < 1e-6). full against diagonal: statistic 913, p = 1e-09",
        "Note outliers 0.5 % of the readings are strays.",
        "COMPASS_OFS2",
        "MAG0.params MAG0.json",
        "flight.ulg, 6 000 rows, SHA-256 " + "ab" * 32,
        "field [nT] = matrix @ (raw [nT] - bias)",
        "m (magnetometer) to m (magnetometer)",
        "prior_sd = 0.1",
        "the clock jumped once",
        "doi:10.1109/GMAP.2004.1290055",
    ):
        assert said in words, said


def test_headings_are_in_order_and_tables_name_their_rows_and_columns(report):
    levels = [int(n) for n in re.findall(r"<h([1-6])", report)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in pairwise(levels))
    assert not re.search(r"<th(?! scope)[ >]", report)
    assert report.count('<html lang="en">') == 1


def test_every_picture_has_words(report):
    pictures = re.findall(r"<canvas[^>]*aria-label=\"([^\"]+)\"[^>]*>([^<]+)</canvas>", report)
    assert len(pictures) == 9
    assert "magnitude spreads by 33" in pictures[0][0]
    assert all(
        'role="img" aria-label=' in svg for svg in re.findall(r'<svg class="area"[^>]*>', report)
    )


def test_what_a_log_says_is_only_ever_text(good):
    samples = good.samples.with_columns(
        name=EVIL, notes=(EVIL,), source=replace(good.samples.source, name=EVIL)
    )
    page = render([replace(good, samples=samples)], title=EVIL, exports={EVIL: [EVIL]})
    assert "<img" not in page
    assert page.count("</script>") == page.count("<script")
    assert text_of(page).count(EVIL) >= 5


def test_fifty_thousand_points_make_half_a_megabyte_and_more_are_thinned():
    long = calibrated(samples_of(tumble(60_000)))
    page = render([long], title="long")
    assert 0.4e6 < len(page.encode()) < 0.6e6
    assert "50 000 of 60 000 readings are drawn" in text_of(page)
    assert len(render([long, long], title="long").encode()) < 0.7e6


def luminance(colour: str) -> float:
    channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_words_can_be_read_on_their_ground(theme):
    css = (Path(agonic.report.__file__).parent / "static" / "base.css").read_text()
    block = re.findall(r":root \{(.*?)\}", css, flags=re.DOTALL)[theme]
    colours = dict(re.findall(r"--(\w+): (#\w{6});", block))
    for name in ("ink", "soft", "accent", "good", "check", "refused"):
        for ground in ("paper", "card"):
            light, dark = sorted((luminance(colours[name]), luminance(colours[ground])))[::-1]
            assert (light + 0.05) / (dark + 0.05) >= 4.5, (name, ground)


def test_a_good_calibration_asks_for_no_turns(good):
    coverage = replace(good.fit.coverage, turns="turn the sensor until the field points along −z")
    words = text_of(render([replace(good, fit=replace(good.fit, coverage=coverage))], title="log"))
    assert "Turns to add" not in words
    assert "No further orientations are needed." in words
    doubtful = replace(good, fit=replace(good.fit, coverage=coverage))
    doubtful = doubtful.with_finding(Finding("range", "check", "the field is weak"))
    words = text_of(render([doubtful], title="log"))
    assert "Turns to add: Turn the sensor until the field points along −z." in words
    assert "No further turns" not in words


def test_readings_that_were_judged_in_their_turn_are_not_marked(good):
    everyone = np.ones(len(good.samples), dtype=bool)
    judged = replace(good, verification=replace(good.verification, held_out=everyone))
    page = render([judged], title="log")
    assert 'class="held-out"' not in page
    assert "key held-out" not in page
    assert "Each of 6 000 readings was judged by a fit to other parts of the log" in text_of(page)
    part = text_of(render([good], title="log"))
    assert "Checked on 1 200 readings held out of the fit." in part


def test_an_input_is_listed_once_and_one_row_is_a_row(good):
    calibration, source = good.fit.calibration, good.samples.source
    again = replace(
        calibration, provenance=replace(calibration.provenance, inputs=(source,), parents=())
    )
    samples = replace(good.samples, rejected={"NaN or infinite field": 1, "time stands": 2})
    result = replace(good, samples=samples, fit=replace(good.fit, calibration=again))
    words = text_of(render([result], title="log"))
    assert words.count(source.sha256) == 1
    assert "1 row: NaN or infinite field 2 rows: time stands" in words


def test_numbers_have_true_minuses(good):
    south = replace(good.fit.coverage, inclination_deg=-65.6)
    finding = Finding("field", "note", "the field dips by -66° since 2015-11-21")
    fit = replace(good.fit, coverage=south, findings=(finding,))
    words = text_of(render([replace(good, fit=fit)], title="log"))
    assert "level, dip −66°" in words
    assert words.count("dips by −66° since 2015-11-21") == 2
    assert not re.search(r"(?<![\w.-])-\d", words)


def test_a_mix_of_two_sensors_has_no_bias(good):
    rng = np.random.default_rng(4)
    directions = tumble(3000)
    samples = samples_of(directions)
    second = samples_of(directions, seed=9).field + rng.normal(0, 50, samples.field.shape)
    mix = mean_of(good.fit.calibration, good.fit.calibration)
    mix = replace(mix, covariance=np.diag([50.0**2] * 3 + [1e-3**2] * 18))
    paired = samples.with_columns(second=second)
    made = calibrated(samples)
    result = replace(made, samples=paired, fit=replace(made.fit, calibration=mix))
    page = render([result], title="log")
    words = text_of(page)
    assert "Constant, nT" in words
    assert "neither sensor has a bias" in words
    assert "Scale factor" not in words
    assert "Bias, nT" not in words
    names = [group.name for group in list_quantities(result)]
    assert names == ["Constant", "Weights of this sensor", "Weights of the second sensor"]
    own, other = (np.array([q.value for q in g.rows]) for g in list_quantities(result)[1:])
    half = np.array([good.fit.calibration.matrix[i, j] for i, j in ENTRIES]) / 2
    np.testing.assert_allclose(own, half, atol=1e-12)
    np.testing.assert_allclose(other, half, atol=1e-12)
    assert describe_recording([result]).to_text().splitlines()[2].startswith("  Constant")
