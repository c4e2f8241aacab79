"""Errors that all rows share, turns that no test sees, and columns that mean something else."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.attitude.fit import fit_levelled, fit_vector
from agonic.attitude.known_heading import check_heading_column
from agonic.maths.equation.coverage import level_directions
from agonic.simulation import simulate

PLACE = ag.Reference.horizontal_vertical(25_000.0, 43_301.27018922)


def flown(seed: int, n: int = 2000, **settings):
    return simulate("flight", n=n, rate_Hz=25.0, stray_nT_A=(0.0, 0.0, 0.0), seed=seed, **settings)


def rough(samples: ag.Samples, sd_deg: float, seed: int) -> ag.Samples:
    """Roll and pitch with white errors."""
    white = sd_deg * np.random.default_rng(seed).standard_normal((2, len(samples)))
    roll, pitch = samples.roll_deg + white[0], samples.pitch_deg + white[1]
    return samples.with_columns(roll_deg=roll, pitch_deg=pitch)


def level_error_deg(
    calibration: ag.Affine, truth: ag.Affine, turn: Rotation | None = None
) -> float:
    """Error of a level heading, rms over all headings."""
    directions, across = level_directions(60.0)
    field = 50_000.0 * directions
    sensed = field if turn is None else turn.apply(field)
    found = calibration.correct(sensed @ np.linalg.inv(truth.matrix).T + truth.bias)
    aside = np.einsum("ni,ni->n", found - field, across) / 25_000.0
    return float(np.degrees(np.sqrt(np.mean(aside**2))))


@pytest.mark.slow
def test_a_turn_that_no_test_sees_is_in_the_standard_errors() -> None:
    """0.06° about y, in flights that rarely show it; without it the bias is off by 2 σ."""
    turn = Rotation.from_euler("y", 0.06, degrees=True)
    z, seen = [], 0
    for seed in range(10):
        made = flown(seed, noise=50.0)
        added = turn.apply(made.field_b) - made.field_b
        field = made.samples.field + added @ np.linalg.inv(made.truth.matrix).T
        fit = fit_levelled(rough(made.samples.with_columns(field=field), 0.5, seed), PLACE)
        seen += fit.tests[0].p_value < 1e-4
        z.append((fit.calibration.bias - made.truth.bias) / fit.sd[:3])
    assert seen < 4
    assert np.sqrt(np.mean(np.square(z))) < 1.3


@pytest.mark.slow
@pytest.mark.parametrize("fit", [fit_levelled, fit_vector])
def test_the_error_of_the_reference_reaches_dip_and_azimuth(fit) -> None:
    """The field of the place is wrong by what its source states."""
    z = []
    for seed in range(8):
        made = flown(seed, noise=50.0)
        wrong = made.field_n + 150.0 * np.random.default_rng(seed + 50).standard_normal(3)
        reference = ag.Reference.vector(wrong, frame="n", sd=150.0)
        found = fit(made.samples, reference)
        z.append(level_error_deg(found.calibration, made.truth) / found.coverage.heading_sd_deg)
        exact = fit(made.samples, ag.Reference.vector(made.field_n, frame="n"))
        assert exact.coverage.heading_sd_deg < found.coverage.heading_sd_deg
    assert np.sqrt(np.mean(np.square(z))) < 1.4


@pytest.mark.parametrize("biased_deg", [1.0, 3.0])
def test_a_zero_of_roll_that_is_off_is_in_the_vehicles_heading(biased_deg: float) -> None:
    made = flown(3)
    samples = made.samples.with_columns(roll_deg=made.samples.roll_deg + biased_deg)
    fit = fit_levelled(samples, PLACE)
    assert level_error_deg(fit.calibration, made.truth) < 3 * fit.coverage.heading_sd_deg
    assert "misaligned by" in fit.status
    assert (fit.verdict == "check") == (biased_deg > 2.0)


def test_a_level_vehicle_is_told_that_its_mounting_is_not_seen() -> None:
    made = simulate("circle", n=600, tilt_deg=0.6, noise=50.0)
    samples = rough(made.samples, 0.5, 1)
    fit = fit_levelled(samples, ag.Reference.vector(made.field_n, frame="n"))
    note = next(f for f in fit.findings if f.name == "mounting about the vertical")
    assert note.severity == "note"
    assert "own axes" in note.what
    assert fit.coverage.heading_sd_deg > 0.5


LAWS = {
    "negated": lambda h: -h % 360,
    "counted from east": lambda h: (90 - h) % 360,
    "off by 180°": lambda h: (h + 180) % 360,
    "in radians": np.radians,
}


@pytest.mark.slow
@pytest.mark.parametrize("looks", LAWS)
def test_a_heading_that_means_something_else_is_told_and_not_used(looks: str) -> None:
    made = flown(1)
    samples = made.samples.with_columns(heading_deg=LAWS[looks](made.samples.heading_deg))
    reference = ag.Reference.vector(made.field_n, frame="n")
    assert fit_vector(samples, reference).verdict == "refused"
    result = ag.calibrate(samples, reference)
    turned = looks == "off by 180°"  # as a sensor is that sits turned
    assert (result.method, result.verdict) == ("levelled", "check" if turned else "good")
    name = "mounting" if turned else "heading"
    told = next(f for f in result.fit.findings if f.name == name)
    assert looks in told.what
    assert "clockwise from north" in told.move


def test_a_magnetic_heading_is_told_by_the_declination() -> None:
    heading = np.arange(0.0, 360.0, 7.0)
    found = check_heading_column(heading, (heading - 12.4) % 360, 12.0)
    assert found is not None
    assert "magnetic: it is off by the declination of 12°" in found.what
    assert check_heading_column(heading, (heading - 0.4) % 360, 12.0) is None
    found = check_heading_column(heading, (90.0 - heading) % 360, 3.0)
    assert "looks negated, counted anticlockwise, counted from east" in found.what
    found = check_heading_column(heading, (heading + 11.8) % 360, -12.0)
    assert "looks magnetic: it is off by the declination of -12°" in found.what
    noisy = heading + np.random.default_rng(0).normal(size=len(heading)) * 60
    assert check_heading_column(heading, noisy, 12.0) is None


@pytest.mark.slow
def test_roll_and_pitch_of_another_vehicle_are_refused_and_left_out() -> None:
    made, other = flown(1), flown(2)
    samples = made.samples.with_columns(
        roll_deg=3 * other.samples.roll_deg,
        pitch_deg=3 * other.samples.pitch_deg + 20.0,
        heading_deg=None,
    )
    reference = ag.Reference.vector(made.field_n, frame="n")
    fit = fit_levelled(samples, reference)
    assert [f.severity for f in fit.findings if f.name == "attitude"] == ["refuse"]
    result = ag.calibrate(samples, reference)
    assert result.method == "ellipsoid"
    assert result.verdict != "good"
    assert "a levelled fit was refused" in result.reason


def test_a_weaker_fit_never_undoes_a_refusal() -> None:
    made = flown(3, n=12_000, noise=50.0)
    samples = made.samples.with_columns(heading_estimated=True)
    level = np.abs(samples.roll_deg) < 6.0
    half = samples.select(level & (np.abs(samples.heading_deg - 180.0) < 95.0))
    result = ag.calibrate(half, ag.Reference.vector(made.field_n, frame="n"))
    assert (result.method, result.verdict) == ("levelled", "refused")


def test_a_current_that_switches_unseen_is_in_the_standard_errors() -> None:
    """3 µT along a horizontal axis, on and off at random; no column tells of it."""
    made = flown(5, n=4000, noise=100.0)
    on = np.cumsum(np.random.default_rng(4).random(4000) < 1 / 100) % 2
    samples = made.samples.with_columns(field=made.samples.field + on[:, None] * [3000.0, 0, 0])
    fit = fit_levelled(samples, PLACE)
    assert level_error_deg(fit.calibration, made.truth) < 3 * fit.coverage.heading_sd_deg


@pytest.mark.slow
def test_a_disturbance_that_follows_the_pitch_is_in_the_standard_errors() -> None:
    """3 µT at 20° nose up, none level; no column tells of it."""
    for seed in range(3):
        made = flown(seed, n=4000, noise=100.0)
        way = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
        added = 3000.0 * (made.samples.pitch_deg / 20.0)[:, None] * way
        fit = fit_levelled(made.samples.with_columns(field=made.samples.field + added), PLACE)
        error = level_error_deg(fit.calibration, made.truth)
        assert error < 3 * fit.coverage.heading_sd_deg or fit.verdict != "good"


@pytest.mark.parametrize("bend", [0.003, 0.01, 0.02])
def test_a_fit_with_a_current_is_examined_as_well(bend: float) -> None:
    """The current is known, and beside it the sensor is not linear."""
    made = simulate("flight", n=4000, rate_Hz=25.0, noise=100.0, seed=6)
    field = made.samples.field * (1 + bend * (made.samples.field / 50_000.0) ** 2)
    samples = made.samples.with_columns(field=field)
    fit = fit_levelled(samples, PLACE, sources=("current_A",))
    if bend > 0.003:  # less moves a heading by less than anybody looks for
        assert "non-linearity" in {finding.name for finding in fit.findings}
    error = level_error_deg(fit.calibration.at(np.zeros(1)), made.truth)
    assert error < 3 * fit.coverage.heading_sd_deg
