"""`fit_inertial`: truth, honesty, speed in turns, and what `calibrate` chooses."""

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.known_heading import compute_mounted_heading
from tests.inertial.drives import drive, heading_error_deg, used_error_deg


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.slow
@pytest.mark.parametrize("tilt_deg", [5.0, 20.0])
def test_better_than_the_magnitude_alone_and_honest(tilt_deg: float) -> None:
    """A minute each, five turns: little enough for noise that lasts to matter."""
    errors, z, alone = [], [], []
    for seed in range(3):
        made, logged, place = drive(tilt_deg=tilt_deg, seed=seed)
        fit = ag.fit_inertial(logged, place)
        assert fit.verdict != "refused"
        errors.append(heading_error_deg(fit.calibration, made, tilt_deg))
        z.append((fit.calibration.bias - made.truth.bias) / fit.sd[:3])
        magnitude = ag.fit_ellipsoid(logged, ag.Reference.constant(50_000.0))
        alone.append(heading_error_deg(magnitude.calibration, made, tilt_deg))
    assert rms(errors) < 1.05 * rms(alone)
    assert 0.6 < rms(z) < 1.4  # four draws of three
    assert rms(errors) < (0.9 if tilt_deg < 10 else 0.3)


@pytest.mark.slow
def test_finds_the_errors_of_the_inertial_unit() -> None:
    for seed in range(2):
        _, logged, place = drive("hand", seed, unit={"accelerometer_bias": 0.1})
        fit = ag.fit_inertial(logged, place)
        lean = np.random.default_rng(seed).spawn(3)[0].standard_normal((3, 3))
        np.testing.assert_allclose(fit.accelerometer_bias, 0.1 * lean[0], atol=0.04)
        np.testing.assert_allclose(fit.gyro_bias, np.radians(0.5) * lean[2], atol=2e-3)
        np.testing.assert_allclose(fit.inertial_errors[6:9], 0.01 * lean[1], atol=3e-3)
        assert abs(fit.inertial_errors[9:]).max() < 0.5  # it is turned where it is


@pytest.mark.slow
def test_the_speed_of_a_plane_is_found_in_its_turns() -> None:
    made, logged, place = drive("flight", n=4000, rate_Hz=25.0, stray_nT_A=(0.0, 0.0, 0.0))
    fit = ag.fit_inertial(logged, place)
    assert fit.verdict == "good"
    ahead, aside = fit.inertial_errors[9:11]
    assert ahead == pytest.approx(18.0, abs=1.5)
    assert abs(aside) < 1.5
    assert heading_error_deg(fit.calibration, made, 25.0) < 0.3
    # as well as with roll and pitch recorded: the vertical is no worse than the readings
    assert fit.channels["dip"].noise < 1.5 * fit.channels["magnitude"].noise


@pytest.mark.slow
def test_a_car_that_brakes_and_turns_is_not_told_that_its_gyro_is_wrong() -> None:
    """Braking leans the felt vertical by degrees, and with it the azimuth; wrong axes turn it."""
    for seed in (2, 3):
        made, logged, place = drive("car", seed, n=4000, rate_Hz=25.0)
        fit = ag.fit_inertial(logged, place)
        assert fit.verdict == "good"
        assert (np.abs(fit.calibration.bias - made.truth.bias) < 4 * fit.sd[:3]).all()
    turned = logged.with_columns(rotation_rate=logged.rotation_rate[:, [1, 2, 0]])
    assert ag.fit_inertial(turned, place).verdict == "refused"


def test_an_accelerometer_alone_is_enough() -> None:
    made, logged, place = drive(tilt_deg=8.0)
    fit = ag.fit_inertial(logged.with_columns(rotation_rate=None, time=None), place)
    assert set(fit.channels) == {"magnitude", "dip"}
    assert fit.gyro_bias is None
    own = compute_mounted_heading(fit.calibration, fit.coverage).own_sd_deg
    assert used_error_deg(fit.calibration, made, 8.0) < 3 * own < 3.0


@pytest.mark.slow
def test_calibrate_takes_it_where_it_is_surer() -> None:
    _, logged, place = drive(tilt_deg=5.0)
    result = ag.calibrate(logged, place)
    assert (result.method, result.verdict) == ("inertial", "good")
    assert "accelerometer and gyro" in result.reason
    assert ag.calibrate(logged, place, kind="ellipsoid").verdict == "refused"
    _, tumbled, place = drive("tumble")
    assert ag.calibrate(tumbled, place).method == "ellipsoid"


def test_settings_have_to_make_sense() -> None:
    _, logged, place = drive(n=500)
    with pytest.raises(ag.AgonicError, match="above zero"):
        ag.fit_inertial(logged, place, stretch_s=0.0)
    with pytest.raises(ag.LogError, match="no acceleration"):
        ag.fit_inertial(logged.with_columns(acceleration=None), place)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "tilt_deg", "worst"), [("circle", 5.0, 0.9), ("hand", 60.0, 0.06)]
)
def test_dip_and_magnitude_are_found_where_the_log_tells(kind, tilt_deg, worst) -> None:
    settings = {"tilt_deg": tilt_deg} if kind == "circle" else {}
    made, logged, _ = drive(kind, 1, **settings)
    for given in (None, ag.Reference.constant(50_000.0)):
        fit = ag.fit_inertial(logged, given)
        assert fit.verdict == "good"
        assert heading_error_deg(fit.calibration, made, tilt_deg) < worst
        assert (np.abs(fit.calibration.bias - made.truth.bias) < 4 * fit.sd[:3]).all()
        level, below = fit.reference.values[0]
        dip_sd = np.degrees(fit.inertial_sd[-1])
        assert np.degrees(np.arctan2(below, level)) == pytest.approx(65.0, abs=4 * dip_sd)
        gain = 1.0 if given is None else np.trace(made.truth.matrix) / 3
        assert np.trace(fit.calibration.matrix) / 3 == pytest.approx(gain, rel=0.1)


@pytest.mark.slow
def test_calibrate_takes_it_without_a_place_where_it_is_asked_for() -> None:
    made, logged, _ = drive(tilt_deg=8.0, n=1500)
    for given in (None, ag.Reference.constant(50_000.0)):
        result = ag.calibrate(logged, given, kind="inertial")
        assert (result.method, result.verdict) == ("inertial", "good")
        assert heading_error_deg(result.calibration, made, 8.0) < 1.0
    with pytest.raises(ag.AgonicError, match="needs the field of the place"):
        ag.calibrate(made.samples, kind="levelled")


@pytest.mark.slow
def test_a_dip_that_the_log_does_not_tell_is_named() -> None:
    _, logged, _ = drive(tilt_deg=0.1)
    fit = ag.fit_inertial(logged)
    assert fit.verdict != "good"
    assert any(finding.name == "inclination" for finding in fit.findings)
