"""What a fit must notice of its own model: silent on clean readings, sized right on wrong ones."""

import numpy as np
import pytest
from benchmarks.faults import (
    DIP_DEG,
    FIELD_N,
    MAGNITUDE,
    bursts,
    carried,
    circles,
    coloured,
    cubic,
    errs_between,
    follows_pitch,
    follows_turns,
    gains_by_sign,
    mixed_sensors,
    near_rebar,
    outliers,
    record,
    saturation_across,
    second_sensor,
    slow_step,
    soft_saturation,
    square_across,
    steady_drift,
    steel_below,
    still_then,
    stuck_bit,
    switching,
    tilts,
    tumble,
    two_circles,
    unequal_noise,
)
from benchmarks.torture import heading_error_deg

import agonic as ag
from agonic.model.terms import HIDDEN

KNOWN = ag.Reference.constant(MAGNITUDE)
CAUSES = {term.name for term in HIDDEN} | {"ripple", "field changed", "two sensors mixed"}
MOVING = {
    "field changed",
    "two sensors mixed",
    "bias drift",
    "turn-rate error",
    "correlated noise",
}


def causes(fit: ag.Fit) -> set[str]:
    return {finding.name for finding in fit.findings} & CAUSES


def fitted(seed: int, *faults, motion=tumble, **settings):
    recording = record(seed, motion, faults, **settings)
    return recording, ag.fit_ellipsoid(recording.samples, KNOWN)


@pytest.mark.slow
@pytest.mark.parametrize(
    "faults",
    [(), (outliers(0.02, 20_000.0),), (coloured(0.9, 200.0),), (unequal_noise(100, 200, 400),)],
    ids=["clean", "outliers", "AR 0.9", "unequal noise"],
)
def test_noise_of_any_kind_is_no_fault_of_the_model(faults) -> None:
    alarms = [fitted(seed, *faults, n=1000)[1] for seed in range(7)]
    assert sum(bool(causes(fit)) for fit in alarms) <= 1
    assert all(fit.verdict == "good" for fit in alarms)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        (soft_saturation(90_000.0), "non-linearity"),
        (cubic(0.02), "non-linearity"),
        (gains_by_sign(0.007), "non-linearity"),
        (second_sensor(3000.0), "alternating rows"),
        (second_sensor(3000.0, 3), "two sensors mixed"),
        (switching(2500.0), "field changed"),
        (slow_step(0.01), "bias drift"),
        (stuck_bit(100.0, 4), "ripple"),
        (follows_turns(500.0), "turn-rate error"),
    ],
    ids=[
        "saturation",
        "cubic",
        "gains by sign",
        "every other row",
        "every third row",
        "current",
        "slow step",
        "stuck bit",
        "turns",
    ],
)
def test_a_broken_model_is_named_and_the_stated_error_covers_the_true_one(fault, cause) -> None:
    over = []
    for seed in range(3):
        recording, fit = fitted(seed, fault)
        if fit.verdict == "refused":
            continue
        shown = causes(fit) | set(fit.shares)
        assert shown & {
            cause,
            "field changed",
            "bias drift",
            "direction-dependent error",
            "correlated noise",
        }
        over.append(heading_error_deg(fit.calibration, recording) / fit.coverage.heading_sd_deg)
    assert max(over, default=0.0) < 3.0
    assert np.median(over) > 0.005


@pytest.mark.parametrize(
    ("fault", "motion", "cause", "seeds"),
    [
        (cubic(0.005), tilts(30), None, [*range(4), *range(100, 105)]),  # 0.1° of heading
        (saturation_across(100_000.0), tumble, "saturation", range(9000, 9004)),
    ],
    ids=["cubic", "compression"],
)
def test_what_all_axes_share_is_in_the_stated_error(fault, motion, cause, seeds) -> None:
    seen, over = 0, []
    for seed in seeds:
        recording, fit = fitted(seed, fault, motion=motion)
        seen += cause is None or cause in causes(fit)
        over.append(heading_error_deg(fit.calibration, recording) / fit.coverage.heading_sd_deg)
    assert seen >= len(seeds) - 1
    assert max(over) < 3.0
    assert min(over) > 0.03  # and by no more than is there
    assert np.median(over) > 0.1


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        (bursts(1000.0), None),
        (follows_pitch(2500.0), None),
        (mixed_sensors(1500.0, 0.4, 0.02), "two sensors mixed"),
    ],
    ids=["bursts", "pitch", "two sensors"],
)
def test_some_dozens_of_changes_are_enough_to_tell_a_moving_bias(fault, cause) -> None:
    seen, over = 0, []
    for seed in range(6):
        recording, fit = fitted(seed, fault, motion=tilts(60), n=1500)
        lasts = cause is None and {
            "correlated noise",
            "direction-dependent error",
            "cross-axis error",
        } & set(fit.shares)
        seen += bool(lasts or {cause, *MOVING} & {finding.name for finding in fit.findings})
        over.append(heading_error_deg(fit.calibration, recording) / fit.coverage.heading_sd_deg)
    assert seen >= 5
    assert max(over) < 4.0
    assert np.median(over) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("fault", [steel_below(3000.0), carried(4000.0)], ids=["steel", "carried"])
def test_a_field_that_differs_by_attitude_is_seen_by_what_lasts_on_one_side_or_about_an_axis(
    fault,
) -> None:
    over, seen = [], []
    for seed in range(4):
        recording, fit = fitted(seed, fault)
        over.append(heading_error_deg(fit.calibration, recording) / fit.coverage.heading_sd_deg)
        seen.append(
            bool(set(fit.shares) & {"direction-dependent error", "correlated noise", *MOVING})
        )
    assert sum(seen) >= 2
    assert max(over) < 3.0
    assert np.median(over) > 0.05


def test_what_of_the_error_is_for_noise_that_lasts_is_among_the_shares() -> None:
    for faults, told in (((coloured(0.9, 200.0),), True), ((), False)):
        _, fit = fitted(3, *faults, n=2000)
        assert ("correlated noise" in fit.shares) == told
        assert fit.verdict == "good"


@pytest.mark.slow
def test_what_lasts_may_go_with_the_turning_and_counts_for_the_heading() -> None:
    """Noise with memory and a field that differs by place look alike: the standard errors are those
    of noise, the heading's holds what a bias may have of the other."""
    over = []
    for seed in range(10):
        recording, fit = fitted(seed, carried(2000.0), motion=tilts(45), n=2000)
        over.append(heading_error_deg(fit.calibration, recording) / fit.coverage.heading_sd_deg)
    assert np.count_nonzero(np.array(over) > 3.0) <= 3  # one is the aim
    assert 0.4 < np.median(over) < 2.5


def test_directions_tell_half_of_what_goes_with_the_turns() -> None:
    for seed in range(3):
        recording, fit = fitted(seed, follows_turns(500.0), motion=tilts(45))
        assert "turn-rate error" in causes(fit)
        error = heading_error_deg(fit.calibration, recording)
        assert 0.3 < error / fit.coverage.heading_sd_deg < 3.0


@pytest.mark.xfail(
    strict=True,
    reason="1.3° at 0.11° stated: what no residual shows only nature's scale could hold",
)
def test_a_bend_that_chance_would_rarely_show_is_in_the_stated_error() -> None:
    recording = record(24_004, tumble, (saturation_across(200_000.0),))
    fit = ag.fit_ellipsoid(recording.samples, KNOWN)
    assert "saturation" not in causes(fit)
    error = heading_error_deg(fit.calibration, recording)
    assert 0.2 < error / fit.coverage.heading_sd_deg < 3.0


def test_a_bend_counts_what_of_it_no_magnitude_shows() -> None:
    over = []
    for seed in (5, 6, 22, 26):
        recording, fit = fitted(seed, square_across(0.007))
        over.append(heading_error_deg(fit.calibration, recording) / fit.coverage.heading_sd_deg)
    assert max(over) < 2.2


@pytest.mark.slow
def test_outliers_that_gather_where_an_axis_reads_something_are_a_check() -> None:
    for seed in (0, 2):
        _, fit = fitted(seed, errs_between(10e3, 11e3, 8e3))
        (finding,) = (finding for finding in fit.findings if finding.name == "outliers")
        assert finding.severity == "check"
        assert "gather where y reads" in finding.what
    for seed in range(5):
        _, fit = fitted(seed, outliers(0.05, 5000.0), motion=tilts(45))
        assert fit.verdict == "good"


@pytest.mark.slow
def test_noise_of_all_directions_is_no_moving_bias() -> None:
    names = {"field changed", "two sensors mixed"}
    for seed in range(4):
        for fault in (coloured(0.95, 300.0), unequal_noise(100, 200, 600)):
            _, fit = fitted(seed, fault, motion=tilts(60), n=1200)
            assert not causes(fit) & names


def test_a_drift_does_not_hide_as_noise_with_a_long_memory() -> None:
    for seed in range(300, 304):
        recording, fit = fitted(seed, steady_drift(1000.0), motion=tilts(30), n=2000)
        assert {"bias drift", "field changed"} & {finding.name for finding in fit.findings}
        error = heading_error_deg(fit.calibration, recording)
        assert 0.1 < error / fit.coverage.heading_sd_deg < 3.0


def test_a_long_rest_and_few_tilts_show_no_drift() -> None:
    for seed in range(3):
        _, fit = fitted(seed, motion=still_then(0.8, tilts(30)))
        assert not causes(fit)
        assert fit.verdict == "good"


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("attitudes", [60, 90])
def test_a_few_attitudes_after_a_long_rest_are_not_taken_for_outliers(
    attitudes: int, seed: int
) -> None:
    """The noise of the readings at rest is a small ellipsoid of its own; and where all turns lie in
    one part of the log, the others foretell nothing of it."""
    rng = np.random.default_rng(seed)
    field = rng.normal(size=(3000, 3))
    field *= MAGNITUDE / np.linalg.norm(field, axis=1)[:, None]
    field[:-attitudes] = field[0]
    iron = 30_000.0 * rng.normal(size=3)
    readings = field + iron + 300.0 * rng.normal(size=field.shape)
    fit = ag.fit_ellipsoid(ag.Samples(field=readings, time=0.02 * np.arange(3000)))
    assert fit.verdict == "good"
    assert np.all(abs(fit.calibration.bias - iron) < 4 * fit.sd[:3])


def test_clean_readings_of_few_tilts_show_no_common_bend() -> None:
    clean = [fitted(seed, motion=tilts(30), n=300 + 90 * seed)[1] for seed in range(12)]
    assert not any(causes(fit) & {"non-linearity", "saturation"} for fit in clean)


@pytest.mark.slow
def test_two_exact_circles_do_not_determine_an_ellipsoid_and_three_do() -> None:
    for seed in range(30, 34):
        _, fit = fitted(seed, motion=two_circles)
        assert fit.verdict != "good"
        assert {"prior", "coverage", "plane"} & {finding.name for finding in fit.findings}
    for seed in range(30, 33):
        recording, fit = fitted(seed, motion=circles)
        assert fit.verdict == "good"
        error = heading_error_deg(fit.calibration, recording)
        assert error < 3 * fit.coverage.heading_sd_deg < 0.3


def test_non_linearity_that_matters_is_in_the_stated_error() -> None:
    for seed in range(3):
        recording, fit = fitted(seed, soft_saturation(90_000.0))
        assert causes(fit)
        error = heading_error_deg(fit.calibration, recording)
        assert error < 3 * fit.coverage.heading_sd_deg


def test_standard_errors_of_clean_readings_stay_as_they_were() -> None:
    recording, fit = fitted(3)
    assert fit.coverage.heading_sd_deg < 0.035  # the bound is 0.017
    assert heading_error_deg(fit.calibration, recording) < 4 * fit.coverage.heading_sd_deg


def test_what_only_the_prior_knows_is_not_stated_as_known() -> None:
    rng = np.random.default_rng(0)
    recording, _ = fitted(0, motion=tilts(60))
    u = rng.normal(size=(3000, 3)) * 0.12 + FIELD_N / MAGNITUDE
    field = MAGNITUDE * u / np.linalg.norm(u, axis=1, keepdims=True)
    readings = recording.reads(field) + 150.0 * rng.normal(size=field.shape)
    samples = ag.Samples(field=readings, time=np.arange(3000) / 10)
    fit = ag.fit_ellipsoid(samples, KNOWN, inclination_deg=DIP_DEG)
    without = ag.fit_ellipsoid(samples, KNOWN, soft_iron_sd=None, inclination_deg=DIP_DEG)
    stated, alone = fit.coverage.heading_sd_deg, without.coverage.heading_sd_deg
    assert fit.verdict != "good"
    assert stated > 0.1 * alone


def test_what_lasts_is_not_hidden_behind_its_own_correlation() -> None:
    """Tumbled above magnetised iron: residuals that last are nearly all there is."""
    recording = record(9, tumble, (near_rebar(1.8),))
    fit = ag.fit_ellipsoid(recording.samples, ag.Reference.constant(MAGNITUDE))
    error = heading_error_deg(fit.calibration, recording)
    assert 0.9 < error < 1.5 * fit.coverage.heading_sd_deg


@pytest.mark.parametrize(
    "faults",
    [(soft_saturation(70_000.0),), (saturation_across(100_000.0),), (cubic(0.1),)],
    ids=["soft saturation", "saturation across", "cubic"],
)
def test_one_cause_is_told_once(faults) -> None:
    """As a check where it makes most of the heading's error, and not as a note again."""
    _, fit = fitted(0, *faults)
    told = [finding.name for finding in fit.findings]
    assert causes(fit)
    assert len(told) == len(set(told))
