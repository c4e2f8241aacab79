"""The ladder of fits: what it predicts of unseen readings and of headings is what comes."""

from dataclasses import replace

import numpy as np
import pytest

import agonic as ag
from agonic.maths.equation.coverage import level_directions
from agonic.maths.rotations.angles import wrap_deg
from agonic.recording.document import describe_recording
from agonic.recording.ladder import predict_heading_error
from agonic.simulation import simulate

FIELD = 50_000.0
DIP = 60.0


def true_heading_error_deg(calibration, truth):
    """The rms error of a level heading, by the truth of the simulation."""
    along, _ = level_directions(DIP)
    raw = FIELD * along @ np.linalg.inv(truth.matrix).T + truth.bias
    found = calibration.correct(raw)
    error = np.arctan2(-found[:, 1], found[:, 0]) - np.arctan2(-along[:, 1], along[:, 0])
    return float(np.sqrt(np.mean(wrap_deg(np.degrees(error)) ** 2)))


@pytest.mark.slow
@pytest.mark.parametrize("model", ["sphere", "diagonal"])
def test_a_smaller_model_errs_by_what_is_predicted(model):
    """(true − predicted)/sd has mean 0 and sd 1 over seeds."""
    scores = []
    for seed in range(4):
        made = simulate("tumble", n=400, noise=400.0, seed=seed)
        full = ag.fit_ellipsoid(made.samples, FIELD, model="full", inclination_deg=DIP)
        small = ag.fit_ellipsoid(made.samples, FIELD, model=model).calibration
        error, sd, _ = predict_heading_error(small, fit=full, samples=made.samples)
        scores.append((true_heading_error_deg(small, made.truth) - error) / sd)
    assert abs(np.mean(scores)) < 3 / np.sqrt(len(scores))
    assert 0.5 < np.std(scores, ddof=1) < 1.6


def test_the_chosen_fit_errs_by_its_own_standard_error():
    made = simulate("hand", seed=4)
    result = ag.calibrate(made.samples, FIELD)
    chosen = result.ladder[-1]
    assert chosen.chosen
    assert chosen.name == "full"
    stated = result.fit.coverage.heading_sd_deg  # with what the delay leaves, which no rung has
    assert 0.9 * stated < chosen.heading_error_deg <= stated
    assert chosen.held_out_rms == result.verification.residual_rms
    assert [rung.name for rung in result.ladder[:-1]] == ["as recorded", "bias only", "diagonal"]
    assert [rung.parameters for rung in result.ladder] == [0, 4, 6, 9]
    spreads = [rung.spread for rung in result.ladder]
    assert spreads == sorted(spreads, reverse=True)
    assert "present" in chosen.why


def test_of_a_sensor_without_soft_iron_the_ladder_says_so():
    truth = ag.Affine(bias=[3000.0, -9000.0, 500.0], matrix=np.eye(3))
    made = simulate("tumble", calibration=truth, seed=2)
    ladder = {rung.name: rung for rung in ag.calibrate(made.samples, FIELD).ladder}
    assert ladder["full"].chosen
    assert ladder["full"].held_out_rms == pytest.approx(ladder["bias only"].held_out_rms, rel=0.1)
    assert "no sign of soft iron" in ladder["bias only"].why


@pytest.mark.slow
def test_a_current_on_board_is_a_rung():
    made = simulate("flight", n=4000, noise=50.0, stray_nT_A=(60.0, -35.0, 90.0))
    place = ag.Reference.horizontal_vertical(25_000.0, 43_301.27)
    result = ag.calibrate(made.samples, place)
    ladder = {rung.name: rung for rung in result.ladder}
    with_it, without = ladder["full + roll and pitch + current_A"], ladder["full + roll and pitch"]
    assert with_it.chosen
    assert with_it.held_out_rms < 0.5 * without.held_out_rms
    assert with_it.heading_error_deg < 0.5 * without.heading_error_deg
    bare = made.samples.with_columns(roll_deg=None, pitch_deg=None)
    alone = {rung.name: rung for rung in ag.calibrate(bare, FIELD).ladder}
    assert alone["full + current_A"].held_out_rms < 0.5 * alone["full"].held_out_rms


def test_a_mounting_by_right_angles_is_no_error():
    made = simulate("tumble", seed=6)
    place = ag.Reference.horizontal_vertical(25_000.0, 43_301.27)
    fit = ag.fit_levelled(made.samples, place)
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # about the vertical
    alone = ag.fit_ellipsoid(made.samples, FIELD).calibration
    turned = replace(alone, matrix=turn @ alone.matrix, gauge="triangular")
    plain = predict_heading_error(alone, fit=fit, samples=made.samples)
    again = predict_heading_error(turned, fit=fit, samples=made.samples)
    assert again[:2] == pytest.approx(plain[:2])
    assert again.errors_deg == pytest.approx(plain.errors_deg, abs=1e-9)
    assert plain.heading_error_deg < 0.2


def test_the_ladder_is_printed_and_recorded():
    result = ag.calibrate(simulate("hand", seed=4).samples, FIELD)
    document = describe_recording([result])
    text = document.to_text()
    assert "Ladder of fits" in text
    assert "✓ full" in text
    record = document.to_record()["sensors"][0]["ladder"]
    assert [one["chosen"] for one in record] == [False, False, False, True]
    assert "Ladder of fits" in document.to_html()


def test_a_refused_fit_has_no_ladder():
    result = ag.calibrate(simulate("car", seed=1).samples, FIELD)
    assert result.verdict == "refused"
    assert result.ladder == ()
