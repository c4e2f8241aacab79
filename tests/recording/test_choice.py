"""Which fit `calibrate` takes, and why."""

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.interference import Interference
from agonic.recording.calibrated import judge
from agonic.simulation import simulate

PLACE = ag.Reference.horizontal_vertical(25_000.0, 43_301.27018922)


def flight(stray=(0.0, 0.0, 0.0), **settings) -> tuple[ag.Samples, ag.Reference]:
    made = simulate("flight", n=3000, rate_Hz=25.0, stray_nT_A=stray, **settings)
    return made.samples, ag.Reference.vector(made.field_n, frame="n")


def test_what_the_log_holds_decides() -> None:
    samples, field_n = flight()
    estimated = samples.with_columns(heading_estimated=True)
    bare = samples.with_columns(roll_deg=None)
    cases = [
        (samples, field_n, "vector", "whole attitude"),
        (estimated, field_n, "levelled", "roll and pitch were recorded"),
        (samples, PLACE, "levelled", "roll and pitch were recorded"),
    ]
    for given, reference, method, reason in cases:
        result = ag.calibrate(given, reference)
        assert (result.method, result.verdict) == (method, "good")
        assert reason in result.reason
    tumbled = simulate("tumble").samples
    cases = [
        (tumbled, ag.Reference.constant(50_000), "no reference but the magnitude"),
        (tumbled.with_columns(roll_deg=None), PLACE, "magnitude alone tells"),
        (tumbled.with_columns(roll_deg=None, acceleration=None), PLACE, "no roll and pitch"),
        (tumbled, None, "or date"),
    ]
    for given, reference, reason in cases:
        result = ag.calibrate(given, reference)
        assert (result.method, result.verdict) == ("ellipsoid", "good")
        assert reason in result.reason
    by_force = ag.calibrate(bare.with_columns(acceleration=None), field_n)
    assert by_force.method == "ellipsoid"


def test_the_user_may_decide() -> None:
    samples, field_n = flight()
    for kind in ("ellipsoid", "levelled", "vector"):
        result = ag.calibrate(samples, field_n, kind=kind)
        assert result.method == kind
        assert result.reason == "it was asked for"
    with pytest.raises(ag.AgonicError, match="use one of"):
        ag.calibrate(samples, field_n, kind="best")
    with pytest.raises(ag.AgonicError, match="--at"):
        ag.calibrate(samples, None, kind="levelled")


def test_a_current_joins_where_it_moves_the_readings_and_only_there() -> None:
    samples, field_n = flight(stray=(60.0, -35.0, 90.0))
    joined = ag.calibrate(samples.with_columns(heading_estimated=True), field_n)
    assert isinstance(joined.fit.calibration, Interference)
    assert "the current moves the readings" in joined.reason
    assert joined.verdict == "good"
    alone = ag.calibrate(flight()[0], field_n)
    assert not isinstance(alone.fit.calibration, Interference)


def test_a_sensor_in_other_axes_is_fitted_by_its_magnitude() -> None:
    made = simulate("tumble", n=3000)
    turned = made.samples.with_columns(field=made.samples.field[:, [1, 2, 0]])
    result = ag.calibrate(turned, ag.Reference.vector(made.field_n, frame="n"))
    assert result.method == "ellipsoid"
    assert "a vector fit was refused" in result.reason
    assert result.verdict == "good"


def test_halves_are_fitted_with_the_same_choices() -> None:
    samples, field_n = flight(stray=(60.0, -35.0, 90.0))
    result = ag.calibrate(samples.with_columns(heading_estimated=True), field_n)
    agree = next(c for c in result.verification.checks if c.name == "two halves of the log agree")
    assert agree.passed
    dip = next(c for c in result.verification.checks if c.name == "dip against the reference")
    assert dip.passed
    heading = next(c for c in result.verification.checks if c.name == "heading against the log")
    assert heading.passed is None
    assert heading.value < 1.0


def test_a_calibration_with_a_current_can_be_judged_again(tmp_path) -> None:
    samples, field_n = flight(stray=(60.0, -35.0, 90.0))
    made = ag.calibrate(samples.with_columns(heading_estimated=True), field_n)
    path = ag.save(made.fit.calibration, tmp_path / "mag.json")
    other, _ = flight(stray=(60.0, -35.0, 90.0), seed=7, calibration=None)
    again = judge(ag.load(path), samples, field_n)
    assert again.method == "levelled"
    assert again.verdict == "good"
    assert np.allclose(again.corrected, made.corrected)
    foreign = judge(ag.load(path), other, field_n)
    assert foreign.verdict != "good"
