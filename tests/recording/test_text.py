"""One screen of plain text."""

from dataclasses import replace

from agonic.recording.document import describe_recording
from agonic.report.digits import MINUS, THIN


def test_three_sensors_fit_on_one_screen(good, logged, refused):
    wordy = replace(refused, status="the sensor did not turn enough to say anything " * 9)
    text = describe_recording([good, logged, wordy]).to_text()
    assert len(text.splitlines()) <= 24
    assert max(map(len, text.splitlines())) <= 100


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
    assert f"{good.fit.coverage.heading_sd_deg:.3f}° at 65° inclination" in text
    assert "Next" in text


def test_a_refusal_begins_with_its_reason_and_ends_with_the_move(refused):
    lines = describe_recording([refused]).to_text().splitlines()
    assert lines[0].startswith("✗ MAG2: refused")
    assert lines[1].strip().startswith("Only one side of the sphere was seen")
    assert lines[-1] == "  Next      Turn it upside down and once about every axis."


def test_a_log_cannot_send_orders_to_the_terminal(good):
    named = replace(good, samples=good.samples.with_columns(name="MAG\x1b[2J\r\n0"))
    text = describe_recording([named]).to_text()
    assert "\x1b" not in text
    assert "MAG?[2J??0" in text
