"""`fit_inflight` with the attitude, with currents, with temperature and time, and with rows left
out: each against simulated truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.inflight.fit.pointing import find_eclipse, local_vertical_nb
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.rotations.attitude import rot_nb
from tests.inflight.orbits import ARCSEC, SENSOR, coefficients, efficient, precise, rescaled

PLAIN = {"n": 4000, "rate_Hz": 0.1, "thermal": 0.0, "external": 0.0, "noise": 50.0}


def ground_of(made: ag.inflight.SimulatedOrbit) -> Affine:
    held = made.ground.at(20.0)
    return replace(held, covariance=np.diag([100.0] * 3 + [1e-8] * 6))


def off(found: Affine, made: ag.inflight.SimulatedOrbit) -> np.ndarray:
    return found.bias - made.bias[-1]


# --- attitude ----------------------------------------------------------------------------------


def test_a_logged_attitude_teaches_the_turn_of_the_sensor() -> None:
    made = ag.inflight.simulate_orbit(**PLAIN, attitude_sd_deg=0.1, mounting_deg=75.0, seed=2)
    alone = ag.fit_inflight(made.samples, drift_knots=0)
    fit = ag.fit_inflight(made.samples, drift_knots=0, attitude="logged")
    assert fit.ok, fit.status
    error = (fit.alignment.rotation * made.rot_bm.inv()).as_rotvec()
    sd = np.sqrt(np.diag(fit.alignment.covariance))
    assert np.abs(error / sd).max() < 4
    assert np.degrees(sd).max() < 0.02
    assert set(fit.channels) == {"magnitude", "azimuth", "dip"}
    middle = np.linalg.norm(made.field_n, axis=1).mean()
    across = np.hypot(50.0, np.radians(0.1) * middle)
    assert fit.channels["azimuth"].noise == pytest.approx(across, rel=0.1)
    assert fit.channels["magnitude"].noise == pytest.approx(50.0, rel=0.1)
    assert np.median(fit.direction_error_deg) == pytest.approx(0.14, rel=0.2)
    assert (fit.sd < alone.sd).all()  # three numbers a reading instead of one
    assert np.abs((fit.change.bias - made.bias[-1]) / fit.sd[:3]).max() < 4
    field_b = fit.alignment.rotation.apply(fit.field)
    truth_b = made.rot_nb.apply(made.field_n, inverse=True)
    assert np.sqrt(np.mean((field_b - truth_b) ** 2)) < 60.0


def test_the_local_vertical_is_that_of_the_simulated_track() -> None:
    made = ag.inflight.simulate_orbit(n=500, rate_Hz=0.1, noise=0.0, pointing="nadir", seed=1)
    nb = Rotation.from_matrix(local_vertical_nb(made.samples))
    wobble = np.degrees((nb.inv() * made.rot_nb).magnitude())
    assert np.sqrt(np.mean(wobble**2)) == pytest.approx(3 * np.sqrt(3), rel=0.4)
    assert wobble.max() < 15.0
    s = made.samples
    assert (find_eclipse(s) == made.eclipse).mean() > 0.99
    roll, pitch = np.abs(s.roll_deg).max(), np.abs(s.pitch_deg).max()
    assert max(roll, pitch) < 20.0


def test_nadir_pointing_needs_no_logged_attitude() -> None:
    made = ag.inflight.simulate_orbit(**PLAIN, attitude_sd_deg=None, mounting_deg=40.0, seed=3)
    fit = ag.fit_inflight(made.samples, drift_knots=0, attitude="nadir", ground=ground_of(made))
    assert fit.verdict == "good", fit.status
    turn = np.degrees((fit.alignment.rotation * made.rot_bm.inv()).magnitude())
    assert turn < 1.5  # it wobbles by 3° about the vertical, slowly
    assert 1.0 < np.median(fit.direction_error_deg) < 5.0


def test_a_wrong_attitude_is_found_out() -> None:
    made = ag.inflight.simulate_orbit(**PLAIN, pointing="tumble", seed=4)
    wrong = made.samples.with_columns(
        roll_deg=made.samples.pitch_deg, pitch_deg=made.samples.roll_deg
    )
    fit = ag.fit_inflight(wrong, drift_knots=0, attitude="logged")
    assert "attitude in flight" in {finding.name for finding in fit.findings}
    without = made.samples.with_columns(roll_deg=None)
    with pytest.raises(ag.LogError, match="no attitude"):
        ag.fit_inflight(without, attitude="logged")
    follows = made.samples.with_columns(heading_estimated=True)
    with pytest.raises(ag.LogError, match="follows the magnetometer"):
        ag.fit_inflight(follows, attitude="logged")
    with pytest.raises(ag.AgonicError, match="use one of"):
        ag.fit_inflight(made.samples, attitude="stars")


@pytest.mark.slow
def test_standard_errors_with_the_attitude_are_honest() -> None:
    z = []
    for seed in range(12):
        made = ag.inflight.simulate_orbit(
            **PLAIN | {"n": 1500}, attitude_sd_deg=0.2, mounting_deg=20.0, seed=seed
        )
        fit = ag.fit_inflight(made.samples, drift_knots=0, attitude="logged")
        turn = (fit.alignment.rotation * made.rot_bm.inv()).as_rotvec()
        truth = pack_symmetric(made.truth.matrix[0])
        found = pack_symmetric(fit.change.matrix)
        errors = np.concatenate([off(fit.change, made), found - truth, turn])
        sds = np.concatenate([fit.sd, np.sqrt(np.diag(fit.alignment.covariance))])
        z.append(errors / sds)
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.15)
    assert np.abs(np.mean(z, axis=0)).max() < 4 / np.sqrt(12)  # noisy readings make no bias


# --- currents, temperature, time ---------------------------------------------------------------


def test_a_current_on_board_is_taken_out() -> None:
    made = ag.inflight.simulate_orbit(**PLAIN, pointing="tumble", seed=5)
    rng = np.random.default_rng(0)
    current = 2.0 + 1.5 * np.repeat(rng.random(400), 10)
    stray = np.array([120.0, -60.0, 200.0])
    disturbed = made.samples.with_columns(
        field=made.samples.field + np.outer(current, stray), current_A=current
    )
    fit = ag.fit_inflight(disturbed, ground=ground_of(made), drift_knots=0, sources=["current_A"])
    assert fit.ok, fit.status
    gain = made.ground.at(20.0).matrix
    z = (fit.sources[:, 0] - gain @ stray) / fit.sources_sd[:, 0]
    assert np.abs(z).max() < 4
    assert fit.sources_sd.max() < 10.0
    assert isinstance(fit.calibration, Chain)
    clean = fit.calibration.correct(disturbed.field, current_A=current)
    assert np.sqrt(np.mean((clean - made.field_m()) ** 2)) < 60.0
    alone = ag.fit_inflight(disturbed, drift_knots=0, sources=["current_A"])
    assert isinstance(alone.calibration, Interference)
    assert np.abs(alone.calibration.bias - made.bias[-1]).max() < 4 * alone.sd[:3].max()
    assert alone.calibration.covariance.shape == (12, 12)
    with pytest.raises(ag.LogError, match="no throttle"):
        ag.fit_inflight(disturbed, sources=["throttle"])
    with pytest.raises(ag.CoverageError, match="never changes"):
        ag.fit_inflight(
            disturbed.with_columns(current_A=np.ones(len(disturbed))), sources=["current_A"]
        )


def test_the_second_sensor_is_named() -> None:
    made = ag.inflight.simulate_orbit(**PLAIN, pointing="tumble", seed=5)
    added = np.random.default_rng(3).normal(0.0, 300.0, made.samples.field.shape)
    samples = made.samples.with_columns(
        field=made.samples.field + 0.5 * added, second=added, second_sensor="boom"
    )
    fit = ag.fit_inflight(samples, drift_knots=0, sources=["second"])
    assert fit.calibration.second_sensor == "boom"
    assert np.abs((fit.sources - 0.5 * np.eye(3)) / fit.sources_sd).max() < 4


def test_bias_and_matrix_follow_temperature_and_time() -> None:
    made = ag.inflight.simulate_orbit(
        **PLAIN | {"n": 6000, "noise": 5.0}, pointing="tumble", sensor=SENSOR, seed=6
    )
    s = made.samples
    aged = 1.0 + 2e-3 * (s.time / s.time[-1] - 1.0)  # x gain: 0 at the end, −0.2 % at the start
    field = s.field.copy()
    field[:, 0] = made.bias[:, 0] + (field[:, 0] - made.bias[:, 0]) / aged
    fit = ag.fit_inflight(
        s.with_columns(field=field), drift_knots=0, temperature_degree=3, matrix_rate=True
    )
    assert isinstance(fit.calibration, Thermal)
    truth = rescaled(SENSOR, fit.calibration.centre_C, fit.calibration.half_range_C)
    z = (coefficients(fit.calibration) - coefficients(truth)) / fit.calibration.sd
    # the rotation of a symmetric matrix with a gain that ages is of second order, 1e-6
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.35)
    assert fit.noise == pytest.approx(5.0, rel=0.05)
    still = ag.fit_inflight(s.with_columns(field=field), drift_knots=0, temperature_degree=3)
    assert still.noise > 1.5 * fit.noise


def test_a_ground_calibration_keeps_its_shape_and_takes_a_slope_on_top() -> None:
    made = ag.inflight.simulate_orbit(
        **PLAIN | {"thermal": 1500.0}, pointing="tumble", moved=900.0, seed=7
    )
    x = (made.samples.temperature - 10.0) / 25.0
    steeper = made.samples.with_columns(field=made.samples.field + np.outer(x, [80.0, -40.0, 60.0]))
    flat = ag.fit_inflight(steeper, ground=made.ground, drift_knots=0)
    fit = ag.fit_inflight(steeper, ground=made.ground, drift_knots=0, temperature_degree=1)
    assert isinstance(fit.calibration, Chain)
    for one, limit in ((fit, 55.0), (flat, 200.0)):
        left = one.calibration.correct(steeper.field, temperature=steeper.temperature)
        rms = np.sqrt(np.mean((left - made.field_m()) ** 2))
        assert rms < limit
    assert flat.noise > 1.08 * fit.noise
    assert fit.before.bias == pytest.approx(made.ground.bias_at(fit.calibration.steps[1].centre_C))
    shift = np.linalg.norm(fit.after.bias - fit.before.bias)
    assert shift == pytest.approx(900.0, abs=60.0)
    with pytest.raises(ag.LogError, match="no temperature"):
        ag.fit_inflight(steeper.with_columns(temperature=None), temperature_degree=1)


# --- rows left out -----------------------------------------------------------------------------


def test_flagged_rows_and_far_residuals_are_left_out() -> None:
    made = ag.inflight.simulate_orbit(**PLAIN, pointing="tumble", torquer=4000.0, seed=8)
    on = made.samples.flagged != 0
    assert on.any()
    fit = ag.fit_inflight(made.samples, ground=ground_of(made), drift_knots=0)
    assert fit.ok, fit.status
    assert fit.n == (~on).sum()
    assert (fit.weights[on] == 0).all()
    assert np.abs((fit.after.bias - made.bias[-1]) / fit.sd[:3]).max() < 4
    unmarked = made.samples.with_columns(flagged=None)
    near = ag.fit_inflight(unmarked, ground=ground_of(made), drift_knots=0, residual_limit=250.0)
    assert np.abs(near.residuals[near.weights > 0]).max() < 250.0
    assert near.n < len(unmarked)
    assert np.abs(near.after.bias - made.bias[-1]).max() < 20.0
    with pytest.raises(ag.AgonicError, match="above 0"):
        ag.fit_inflight(unmarked, residual_limit=0.0)


# --- a scalar instrument and a star camera -----------------------------------------------------


@pytest.mark.slow
def test_the_precise_case_is_at_its_bound() -> None:
    """0.1 nT scalar, 0.3 nT vector noise, a star camera of 4″: sub-nT and sub-arcsecond."""
    errors, best, bounds, stated = [], [], [], []
    for seed in range(3):
        made, fit = precise(seed, 6000, 10.0)
        found = fit.calibration
        truth = rescaled(SENSOR, found.centre_C, found.half_range_C)
        turn = (fit.alignment.rotation * made.rot_bm.inv()).as_rotvec()
        errors.append(np.concatenate([coefficients(found) - coefficients(truth), turn]))
        linear, covariance = efficient(made, truth)
        best.append(linear)
        bounds.append(np.sqrt(np.diag(covariance)))
        stated.append(
            np.concatenate([found.sd, np.sqrt(np.diag(fit.alignment.covariance))]) / bounds[-1]
        )
        assert fit.noise == pytest.approx(np.hypot(0.3, 0.1), rel=0.03)
    error, bound = np.array(errors), np.array(bounds)
    luck = np.sqrt(np.mean((np.array(best) / bound) ** 2))
    assert np.sqrt(np.mean((error / bound) ** 2)) / luck < 1.05
    assert 0.7 < luck < 1.3
    assert np.mean(stated) == pytest.approx(1.0, abs=0.05)
    assert np.abs(error[:, :12:4]).max() < 0.2  # nT
    assert np.abs(error[:, 24:36:4]).max() * ARCSEC < 1.0
    assert np.abs(error[:, 36:]).max() * ARCSEC < 0.5


def test_rotation_matrices_of_the_log_are_those_of_the_simulation() -> None:
    made = ag.inflight.simulate_orbit(n=50, attitude_sd_deg=0.0)
    s = made.samples
    np.testing.assert_allclose(
        rot_nb(s.roll_deg, s.pitch_deg, s.heading_deg), made.rot_nb.as_matrix(), atol=1e-9
    )
