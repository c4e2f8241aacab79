"""A calibration judged on parts of its log that it has not seen: found beside stated errors."""

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.recording.evaluation.cross_validation import (
    Measure,
    cross_validate,
    judge_measure,
    predict_as_recorded,
)
from agonic.recording.evaluation.document import describe_evaluation
from agonic.recording.evaluation.errors import find_known, measure_errors, measure_sensitivities
from agonic.simulation import simulate
from tests.command_line import answer, complaint

FIELD = 50_000.0


def test_sensitivities_are_derivatives_of_the_errors():
    rng = np.random.default_rng(0)
    made = simulate("tumble", n=60, seed=3)
    known = find_known(made.samples, ag.Reference.horizontal_vertical(25_000.0, 43_301.27))
    field, moved = made.samples.field, rng.normal(size=(60, 3, 2))
    step = np.array([0.3, -0.2])
    before, after = (measure_errors(field + s * moved @ step, known) for s in (-1, 1))
    for kind, moves in measure_sensitivities(field, moved, known).items():
        change = (after[kind] - before[kind]) / 2
        assert change - change.mean() == pytest.approx(
            moves @ step - (moves @ step).mean(), abs=1e-5
        ), kind


def test_a_heading_is_judged_after_one_constant_turn():
    made = simulate("tumble", n=200, noise=1e-9, calibration=None, seed=1)
    true = made.truth.correct(made.samples.field)
    turned = made.samples.with_columns(heading_deg=(made.samples.heading_deg + 7.0) % 360)
    errors = measure_errors(true, find_known(turned, None))
    assert np.abs(errors["heading"]).max() < 1e-6


@pytest.mark.slow
def test_found_errors_are_those_that_are_stated():
    """Over seeds, of a log with an independent heading that the fits are not shown."""
    ratios = []
    for seed in range(3):
        made = simulate("tumble", n=600, noise=300.0, seed=seed)
        result = ag.evaluate(made.samples, FIELD)
        assert [one.kind for one in result.measures] == ["heading", "magnitude"]
        ratios.append([one.found / one.stated for one in result.measures])
        assert result.truth == "the log's own heading"
        assert not result.findings
    mean = np.mean(ratios, axis=0)
    assert mean[1] == pytest.approx(1.0, abs=0.1)
    assert 0.7 < mean[0] < 1.2  # a tumbling sensor has rows with little horizontal field


@pytest.mark.slow
def test_unseen_rows_are_judged_by_fits_to_others():
    """A stretch with a bias of its own counts as unseen error, though a fit to it would hide it."""
    samples = simulate("tumble", n=800, noise=50.0, seed=2).samples
    field = samples.field.copy()
    field[300:500] += [6000.0, 0.0, 0.0]
    result = ag.evaluate(samples.with_columns(field=field), FIELD)
    assert result.verdict != "good"
    magnitude = result.measures[-1]
    assert magnitude.found < 1.5 * magnitude.stated


def test_readings_as_recorded_are_those_of_the_device():
    samples = simulate("tumble", n=100, seed=5).samples
    corrected = samples.with_columns(logged=ag.Affine(bias=[100.0, 0, 0], matrix=2 * np.eye(3)))
    rows = np.arange(100)
    given = predict_as_recorded(corrected)(rows, rows).field
    assert given == pytest.approx(2 * (samples.field - [100.0, 0, 0]))
    unseen = cross_validate(corrected, find_known(corrected, None), predict_as_recorded(corrected))
    assert np.isnan(unseen.errors["magnitude"].stated).all()
    assert set(unseen.block) == set(range(8))


def test_what_is_made_worse_is_said():
    worse = Measure(kind="heading", unit="°", found=5.0, stated=6.0, recorded=3.0)
    told = judge_measure(worse)
    assert [finding.name for finding in told] == ["worse than recorded"]
    assert "5° rms" in told[0].what
    assert "3°" in told[0].what


@pytest.mark.slow
def test_command_with_the_truth_of_another_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    made = simulate("tumble", n=800, noise=100.0, seed=4)
    blind = made.samples.with_columns(heading_deg=None, roll_deg=None, pitch_deg=None)
    ag.write_csv(blind, "log.csv")
    told = np.column_stack(
        [
            made.samples.time,
            (made.samples.heading_deg + 30.0) % 360.0,
            made.samples.roll_deg,
            made.samples.pitch_deg,
        ]
    )[5:]
    header = "time_s,heading_deg,roll_deg,pitch_deg"
    np.savetxt("truth.csv", told, delimiter=",", header=header, comments="", fmt="%.9f")
    given = ["evaluate", "log.csv", "--truth", "truth.csv", "--field", "50000"]
    status, record = answer(capsys, *given, "--json")
    (sensor,) = record["sensors"]
    assert record["schema"] == "agonic/evaluate@1"
    assert sensor["truth"] == "truth.csv"
    assert sensor["n"] == 795
    heading, magnitude = sensor["measures"]
    assert heading["kind"] == "heading"
    assert heading["found"] < 1.5 * heading["stated"] < heading["recorded"]
    assert magnitude["unit"] == "percent"
    assert len(sensor["blocks"]) == 8
    assert sum(block["n"] for block in sensor["blocks"]) == 795
    assert run([*given, "--report", "page.html"]) == status
    assert "truth.csv" in " ".join(capsys.readouterr().out.split())
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count('class="strip"') == 2
    assert "no heading" in complaint(capsys, "evaluate", "log.csv", "--truth", "log.csv")


def test_a_log_that_cannot_be_fitted_is_told():
    document = describe_evaluation([], title="log", failures=[("mag", "it never turned")])
    assert not document.good
    assert document.to_record()["sensors"][0]["status"] == "it never turned"
