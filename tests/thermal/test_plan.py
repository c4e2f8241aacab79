"""The plan: its profile against the published programme, its standard errors against fits."""

import numpy as np
import pytest

import agonic as ag
from agonic.maths.equation import affine
from agonic.maths.rotations.attitude import yaw_pitch_roll
from agonic.thermal.campaign.description import (
    Sensor,
    Station,
    list_standard_stations,
    parse_sensors,
)
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.fit.fit import fit_thermal
from agonic.thermal.plan.document import describe_plan
from agonic.thermal.plan.plan import plan_thermal
from agonic.thermal.plan.standard_errors import expect_errors


def test_the_standard_programme() -> None:
    profile = Profile()
    words = [segment.words for segment in profile.recording]
    assert words[0] == "cool to -10 °C in 120 min (0.5 °C/min)"
    assert words[1] == "hold -10 °C for 15 min"
    assert words[-1] == "hold +50 °C for 15 min"
    assert [s.recorded for s in profile.before] == [False, False]
    assert profile.before[-1].words == "hold +50 °C for 15 min"
    assert profile.heating_levels_C == [0, 10, 20, 30, 40, 50]
    assert profile.at([0, profile.recorded_s / 2, profile.recorded_s]).tolist()[::2] == [50, 50]


@pytest.mark.slow
def test_stations_recorded_again_show_a_step_between_two() -> None:
    """Of the standard twelve alone it was good, and wrong by up to 16 standard errors."""
    plan = plan_thermal("1xMMC5883MA", repeat=3, rate_Hz=0.05)
    again = plan.stations[12:]
    assert [station.number for station in again] == [13, 14, 15]
    assert len({station.pose.split()[0] for station in again}) == 3
    assert plan.turns[12] == "turn it until it stands top up, front to the back"
    made = ag.thermal.simulate_campaign(plan, rate_Hz=0.05, seed=2)
    samples = made.campaign.samples("MMC5883MA")
    step = np.outer(samples.station > 6, [577.0, -577.0, 577.0])
    knocked = samples.with_columns(field=samples.field + step)
    place = ag.Reference.constant(48_000.0)
    fit = fit_thermal(knocked, place, bin_width_C=2.0, stations=made.description.rotations)
    assert fit.verdict == "check"
    at, truth = fit.calibration.at(20.0), made.truth["MMC5883MA"].at(20.0)
    for bias in (truth.bias, truth.bias + step[-1]):
        assert (np.abs(at.bias - bias) < 3.0 * np.sqrt(np.diag(at.covariance))[:3]).all()


@pytest.mark.parametrize("count", [-1, 13])
def test_no_more_stations_are_repeated_than_there_are(count: int) -> None:
    with pytest.raises(ag.AgonicError, match="give 0 to 12"):
        plan_thermal("1xMMC5883MA", repeat=count)


def test_every_second_of_the_recording_is_in_one_bin() -> None:
    profile = Profile(lowest_C=-20, highest_C=45, step_C=7)
    level, seconds = profile.spread(0.5)
    time = np.arange(0.5, profile.recorded_s)
    seen, _ = np.histogram(profile.at(time), bins=np.linspace(-20, 45, 131))
    assert len(level) == 130
    assert seconds.sum() == pytest.approx(profile.recorded_s)
    inner = slice(1, -1)  # holds at the ends lie on an edge
    np.testing.assert_allclose(
        np.convolve(seconds, [1, 1, 1])[inner], np.convolve(seen, [1, 1, 1])[inner], atol=362
    )
    assert seconds[[0, -1]] == pytest.approx(seen[[0, -1]], abs=5)


def test_the_published_campaign_in_numbers() -> None:
    plan = plan_thermal("2xMMC5883MA,3xMPU-9255", rate_Hz=10.0)
    assert plan.rows == 5 * 12 * 4 * 3600 * 10
    assert [s.name for s in plan.sensors][::2] == ["MMC5883MA-1", "MPU-9255-1", "MPU-9255-3"]
    assert plan.duration_s / 3600 == pytest.approx(4.75 + 11 * (10 + 15 + 240) / 60)
    assert len(plan.turns) == 12
    assert all("90°" in turn for turn in plan.turns[1:])


def simulated_error(noise: float, seeds: int) -> tuple[float, float]:
    """The rms error of bias and matrix × field of ellipsoids through noisy stations."""
    rot_nb = np.array([s.rot_nb.as_matrix() for s in list_standard_stations()])
    field_n = 48_000 * np.array([np.cos(1.134), 0.0, np.sin(1.134)])
    truth = np.swapaxes(rot_nb, 1, 2) @ field_n
    rng = np.random.default_rng(5)
    basis = affine.model_basis("full")
    errors = []
    for _ in range(seeds):
        raw = truth + noise * rng.standard_normal(truth.shape)
        params = basis.T @ affine.join(np.zeros(3), np.eye(3)) / np.diag(basis.T @ basis)
        for _ in range(8):
            bias, matrix = affine.split(basis @ params)
            r, local = affine.magnitude_residual(raw, bias, matrix, 48_000.0)
            params = params - np.linalg.lstsq(local @ basis, r, rcond=None)[0]
        errors.append(params - [0, 0, 0, 1, 1, 1, 0, 0, 0])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    return float(np.sqrt(np.mean(rms[:3] ** 2))), float(np.sqrt(np.mean(rms[3:] ** 2)) * 48_000)


@pytest.mark.slow
def test_the_expected_errors_are_those_that_fits_make() -> None:
    rot_nb = np.array([s.rot_nb.as_matrix() for s in list_standard_stations()])
    field_n = 48_000 * np.array([np.cos(1.134), 0.0, np.sin(1.134)])
    given = (np.ones((1, 1)), np.ones(1), 20.0)
    expected = expect_errors(rot_nb, field_n, *given, fixture_sd_deg=None)
    bias, matrix = simulated_error(20.0, 1500)
    assert expected.bias == pytest.approx(bias, rel=0.04)
    assert expected.matrix == pytest.approx(matrix, rel=0.04)


def test_known_turns_help_and_never_hurt() -> None:
    rot_nb = np.array([s.rot_nb.as_matrix() for s in list_standard_stations()])
    field_n = np.array([20_000.0, 0.0, 43_600.0])
    given = (np.ones((1, 1)), np.array([1e4]), 100.0)
    exact, fine, coarse, alone = (
        expect_errors(rot_nb, field_n, *given, fixture_sd_deg=sd) for sd in (0, 1, 30, None)
    )
    assert exact.bias == pytest.approx(100 / np.sqrt(12e4), rel=0.1)  # a mean of all readings
    assert exact.bias < fine.bias < coarse.bias <= alone.bias * 1.001
    assert coarse.matrix == pytest.approx(alone.matrix, rel=0.01)


def test_a_changing_field_is_what_limits() -> None:
    plans = [plan_thermal("MPU-9255", chamber_sd=sd) for sd in (0.0, 50.0)]
    quiet, real = (plan.expected["MPU-9255"]["magnitude"].bias for plan in plans)
    assert quiet < 2.0
    assert 20.0 < real < 100.0


def test_stations_that_do_not_determine_the_numbers_are_seen() -> None:
    flat = [Station(number=k, rot_nb=yaw_pitch_roll(30.0 * k, 0.0, 0.0)) for k in range(1, 13)]
    plan = plan_thermal("MPU-9255", stations=flat)
    assert plan.expected["MPU-9255"]["magnitude"].bias > 1e4
    standard = plan_thermal("MPU-9255").expected["MPU-9255"]["magnitude"].bias
    assert standard < 2.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no sensors"),
        ("LIS3MDL", "LIS3MDL:NOISE"),
        ("0xMMC5883MA", "is not a sensor"),
        ("MMC5883MA:x", "is not a sensor"),
    ],
)
def test_lists_of_sensors_that_are_none(text, says) -> None:
    with pytest.raises(ag.AgonicError, match=says):
        parse_sensors(text)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"range_C": (50, -10)}, "lower end first"),
        ({"rate_Hz": 0.0}, "rate 0 Hz"),
        ({"noise": 0.0}, "noise of each"),
        ({"stations": list_standard_stations()[:8]}, "nine stations"),
    ],
)
def test_plans_that_cannot_be(given, says) -> None:
    with pytest.raises(ag.AgonicError, match=says):
        plan_thermal([Sensor(name="a", noise=100.0)], **given)


def test_cooling_above_its_limit_is_no_profile() -> None:
    with pytest.raises(ag.AgonicError, match="cool more slowly"):
        Profile(cooling_C_per_min=2.0)


def test_condensation_is_warned_of_and_how_dry_the_air_must_be() -> None:
    """At 20 °C and 50 % tables have a dew point of 9.3 °C; 2.87 hPa of 23.4 are 12 %."""
    plan = plan_thermal("MPU-9255")
    assert plan.dew_point_C == pytest.approx(9.3, abs=0.1)
    assert plan.dry_percent == pytest.approx(12.3, abs=0.1)
    said = " ".join(describe_plan(plan).to_text().split())
    assert "water will condense: the programme goes to −10 °C" in said
    assert "below 12 % relative humidity at 20 °C" in said
    for safe in (
        plan_thermal("MPU-9255", humidity_percent=12.0),
        plan_thermal("MPU-9255", range_C=(15.0, 60.0)),
    ):
        assert "condense" not in describe_plan(safe).to_text()
    with pytest.raises(ag.AgonicError, match="relative humidity"):
        plan_thermal("MPU-9255", humidity_percent=0.0)
