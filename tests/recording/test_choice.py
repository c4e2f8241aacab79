"""Which fit `calibrate` takes, and why."""

import numpy as np
import pytest
from benchmarks.faults import (
    FIELD_N,
    axis_copied,
    axis_dead,
    follows_pitch,
    record,
    saturation_across,
    tilts,
    with_attitude,
)
from benchmarks.torture import heading_error_deg

import agonic as ag
from agonic.calibration.interference import Interference
from agonic.maths.rotations.attitude import down_b
from agonic.recording.calibrated import calibrate_as_named
from agonic.recording.comparison import judge
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
        (tumbled.with_columns(roll_deg=None), PLACE, "magnitude alone determines"),
        (tumbled.with_columns(roll_deg=None, acceleration=None), PLACE, "no roll and pitch"),
        (tumbled, None, "or date"),
    ]
    for given, reference, reason in cases:
        result = ag.calibrate(given, reference)
        assert (result.method, result.verdict) == ("ellipsoid", "good")
        assert reason in result.reason
    by_force = ag.calibrate(bare.with_columns(acceleration=None), field_n)
    assert by_force.method == "ellipsoid"


@pytest.mark.slow
def test_what_only_directions_show_is_not_left_for_a_fit_by_the_magnitude() -> None:
    for fault in (saturation_across(200_000.0), follows_pitch(2000.0)):
        for seed in range(2):
            recording = record(seed, tilts(30), (fault, with_attitude()), n=1500)
            result = ag.calibrate(recording.samples, ag.Reference.vector(FIELD_N, frame="n"))
            error = heading_error_deg(result.fit.calibration, recording)
            assert error < max(3 * result.fit.coverage.heading_sd_deg, 0.2)


@pytest.mark.parametrize("fault", [axis_copied, axis_dead])
def test_an_axis_that_says_nothing_of_its_own_is_refused_and_no_crash(fault) -> None:
    recording = record(1, tilts(45), (fault, with_attitude(heading=True)), n=300)
    try:
        fit = ag.fit_vector(recording.samples, ag.Reference.vector(FIELD_N, frame="n"))
        verdict = fit.verdict
    except ag.CoverageError:
        verdict = "refused"
    assert verdict == "refused"


@pytest.mark.slow
def test_the_user_may_decide() -> None:
    samples, field_n = flight()
    for kind in ("ellipsoid", "levelled", "vector"):
        result = ag.calibrate(samples, field_n, kind=kind)
        assert result.method == kind
        assert result.reason == "as asked for"
    with pytest.raises(ag.AgonicError, match="use one of"):
        ag.calibrate(samples, field_n, kind="best")
    with pytest.raises(ag.AgonicError, match="--at"):
        ag.calibrate(samples, None, kind="levelled")


@pytest.mark.slow
def test_a_current_joins_where_it_moves_the_readings_and_only_there() -> None:
    samples, field_n = flight(stray=(60.0, -35.0, 90.0))
    joined = ag.calibrate(samples.with_columns(heading_estimated=True), field_n)
    assert isinstance(joined.fit.calibration, Interference)
    assert "the current moves the readings" in joined.reason
    assert joined.verdict == "good"
    alone = ag.calibrate(flight()[0], field_n)
    assert not isinstance(alone.fit.calibration, Interference)


@pytest.mark.slow
def test_a_sensor_in_other_axes_is_turned_into_those_of_the_vehicle() -> None:
    made = simulate("tumble", n=3000)
    turned = made.samples.with_columns(field=made.samples.field[:, [1, 2, 0]])
    place = ag.Reference.vector(made.field_n, frame="n")
    result = ag.calibrate(turned, place)
    assert (result.method, result.verdict) == ("vector", "good")
    off = result.calibration.correct(turned.field) - made.field_b
    assert np.sqrt(np.mean(off**2)) < 1.5 * result.fit.noise
    named = calibrate_as_named(turned, place)
    assert (named.method, named.verdict) == ("ellipsoid", "check")
    assert "a levelled fit was refused" in named.reason


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


def in_a_room(seed: int, dip_off_deg: float) -> tuple[ag.Samples, np.ndarray]:
    """A tumble in a field whose dip swings to and fro on the way; its magnitude does not."""
    made = simulate("tumble", n=3000, noise=150.0, seed=seed)
    samples, field = made.samples, made.field_b
    down = down_b(samples.roll_deg, samples.pitch_deg)
    below = np.einsum("ni,ni->n", field, down)
    level = field - below[:, None] * down
    strength, flat = np.linalg.norm(field, axis=1), np.linalg.norm(level, axis=1)
    swing = np.radians(dip_off_deg) * np.sin(6 * np.pi * samples.time / samples.time[-1])
    dip = np.arctan2(below, flat) + swing
    bent = np.cos(dip)[:, None] * level / flat[:, None] + np.sin(dip)[:, None] * down
    moved = (strength[:, None] * bent - field) @ np.linalg.inv(made.truth.matrix).T
    return samples.with_columns(field=samples.field + moved, heading_deg=None), made.truth.bias


def test_where_the_dip_is_not_that_of_the_place_the_magnitude_alone_counts() -> None:
    samples, bias = in_a_room(0, dip_off_deg=20.0)
    result = ag.calibrate(samples, PLACE)
    assert (result.method, result.verdict) == ("ellipsoid", "check")
    assert "a levelled fit was refused" in result.reason
    assert "attitude" in {finding.name for finding in result.fit.findings}
    assert np.all(np.abs(result.fit.calibration.bias - bias) < 4 * result.fit.sd[:3])


@pytest.mark.parametrize("kind", ["tumble", "hand"])
def test_axes_that_are_mirrored_beside_an_attitude_are_told(kind: str) -> None:
    """The magnitude does not see it, and no mounting explains it: headings would be wrong."""
    made = simulate(kind, n=3000, noise=100.0, seed=3)
    mirrored = made.samples.with_columns(
        field=made.samples.field * [1.0, -1.0, 1.0], acceleration=None, heading_deg=None
    )
    result = ag.calibrate(mirrored, PLACE)
    assert (result.method, result.verdict) == ("ellipsoid", "check")
    assert "The axes are not those of roll and pitch: y is reversed" in result.status


def test_the_dip_at_which_the_heading_is_stated_is_that_of_the_place() -> None:
    samples = simulate("tumble").samples
    at = {
        reference: ag.fit_ellipsoid(samples, reference).coverage.inclination_deg
        for reference in (PLACE, ag.Reference.constant(50_000.0))
    }
    assert list(at.values()) == [pytest.approx(60.0, abs=1e-6), 60.0]
    steep = ag.Reference.horizontal_vertical(10_000.0, 48_989.794855663560)
    fit = ag.fit_ellipsoid(samples, steep)
    assert fit.coverage.inclination_deg == pytest.approx(78.463, abs=0.001)
    flat = ag.fit_ellipsoid(samples, steep, inclination_deg=60.0)
    ratio = np.cos(np.radians(60)) / np.cos(np.radians(78.463))
    told = fit.coverage.heading_sd_deg / flat.coverage.heading_sd_deg
    assert told == pytest.approx(ratio, rel=0.35)  # soft iron's part grows otherwise
