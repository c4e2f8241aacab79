"""One screen of plain text."""

from dataclasses import replace

import numpy as np
import pytest

from agonic.recording.document import describe_recording
from agonic.report.digits import MINUS, THIN


@pytest.mark.parametrize("width", [40, 80, 120, 200])
def test_three_sensors_fit_the_width_whole(good, logged, refused, width):
    status = "the sensor did not turn enough to say anything " * 9
    text = describe_recording([good, logged, replace(refused, status=status)]).to_text(width)
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
