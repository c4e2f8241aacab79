"""One screen of plain text."""

from dataclasses import replace

import numpy as np
import pytest

import agonic as ag
from agonic.health import Finding, figure
from agonic.recording.document import describe_recording
from agonic.recording.values import list_values
from agonic.report.digits import MINUS, THIN
from agonic.report.tables import NOTHING


@pytest.mark.parametrize("width", [40, 80, 120, 200])
def test_three_sensors_fit_the_width_whole(good, logged, refused, width):
    status = "the sensor did not turn enough to say anything " * 9
    wordy = refused.with_finding(Finding("static", "refuse", status.strip()))
    text = describe_recording([good, logged, wordy]).to_text(width)
    assert max(map(len, text.splitlines())) <= width
    assert status.strip()[4:] in " ".join(text.split())
    assert "…" not in text


def test_what_one_needs_to_know_is_there(good):
    text = (
        describe_recording([good]).to_text().replace(THIN, " ").replace("\N{NO-BREAK SPACE}", " ")
    )
    sd = good.fit.sd
    assert f"x 18 000.0 ± {sd[0]:.1f}   y {MINUS}21 000.0 ± {sd[1]:.1f}" in text
    assert f"z 12 000.0 ± {sd[2]:.1f} nT" in text
    assert "MAG0: good (ellipsoid, full model, 6 000 readings)" in text
    assert "33 % → 0.29 %" in text
    assert "noise 150 nT" in text
    assert f"{good.fit.coverage.heading_sd_deg:.3f}° (level, dip 65°)" in text


def test_a_matrix_is_printed_row_by_row(good):
    lines = describe_recording([good]).to_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("  Matrix"))
    rows = [line.removeprefix("  Matrix").split() for line in lines[first : first + 3]]
    printed = [[float(cell.replace(MINUS, "-")) for cell in row] for row in rows]
    assert np.array(printed) == pytest.approx(good.fit.calibration.matrix, abs=6e-6)


def test_a_refusal_is_its_reason_with_the_move(refused):
    lines = describe_recording([refused]).to_text().splitlines()
    assert lines[0].startswith("✗ MAG2: refused")
    why = "Only one side of the sphere was seen; turn it upside down and once about every axis."
    assert lines[1] == f"  Refused   {why}"
    assert not any("Bias" in line for line in lines)


def test_a_log_cannot_send_orders_to_the_terminal(good):
    named = replace(good, samples=good.samples.with_columns(name="MAG\x1b[2J\r\n0"))
    text = describe_recording([named]).to_text()
    assert "\x1b" not in text
    assert "MAG?[2J??0" in text


def test_the_heading_of_the_vehicle_is_stated_beside_that_of_the_sensor():
    """What the JSON, the ladder and the figures of the page count with stands in the sentence."""
    made = ag.simulate("circle", tilt_deg=8, n=800, noise=100.0, seed=2)
    fit = ag.fit_levelled(made.samples, ag.Reference.vector(made.field_n, frame="n"))
    assert f"{figure(fit.coverage.heading_sd_deg)}° of the vehicle" in fit.status


def test_a_refused_sensor_shows_no_figures_in_the_summary(good, refused):
    table = describe_recording([good, refused]).sections[0].blocks[0]
    assert table.rows[0].count(NOTHING) == 0
    assert table.rows[1].count(NOTHING) == 3


def test_a_sensor_that_could_not_be_fitted_is_told_in_a_sentence(good):
    why = str(ag.CoverageError("6 readings are too few", turns="record a few minutes"))
    text = describe_recording([good], failures=[("spare", why)]).to_text()
    assert "6 readings are too few; record a few minutes." in text


def test_a_heading_that_is_open_has_no_number(good):
    """Of a sensor that hardly turned, thousands of degrees were stated."""
    coverage = replace(good.fit.coverage, heading_sd_deg=27_000.0)
    result = replace(good, fit=replace(good.fit, coverage=coverage))
    result = result.with_finding(Finding("static", "refuse", "it did not turn"))
    assert list_values(result)["heading_sd_deg"] is None
    assert "000°" not in describe_recording([result]).to_html()
