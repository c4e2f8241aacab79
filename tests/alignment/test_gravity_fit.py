"""`fit_gravity` against simulated truth."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.alignment import gravity as kernel
from agonic.alignment.gravity import fit_gravity
from agonic.alignment.simulation.laboratory import simulate_gravity
from agonic.calibration.affine import Affine
from agonic.calibration.base import apply
from agonic.errors import LogError
from agonic.maths.estimation.changes.rest import find_rest


def turn_between(a, b):
    """Rotation vector, rad, from one rotation to the other."""
    return Rotation.from_matrix(a @ b.T).as_rotvec()


@pytest.mark.slow
@pytest.mark.parametrize("bias", [False, True])
def test_the_turn_is_found_and_its_error_honest(bias: bool) -> None:
    q = []
    zero = (200.0, -300.0, 100.0) if bias else (0.0, 0.0, 0.0)
    for seed in range(40):
        made = simulate_gravity(bias=zero, orientations=20, seed=seed)
        fit = fit_gravity(made.samples, bias=bias)
        assert fit.ok
        off = turn_between(fit.rot_bm, made.rot_bm)
        q.append(off @ np.linalg.solve(fit.estimate.covariance[:3, :3], off))
    # three times an F of 3 and 16 (13) degrees of freedom: mean 3.4 (3.5)
    assert np.mean(q) == pytest.approx(3.4, abs=1.2)


def test_exact_readings_give_the_exact_turn_even_by_right_angles() -> None:
    """The starts by right angles find a sensor that was mounted on its side."""
    for seed, turn in enumerate((3.0, 100.0, 170.0)):
        made = simulate_gravity(noise=1e-6, force_noise=1e-9, turn_deg=turn, seed=seed)
        fit = fit_gravity(made.samples)
        assert np.linalg.norm(turn_between(fit.rot_bm, made.rot_bm)) < 1e-8
        assert fit.inclination_deg == pytest.approx(67.53, abs=0.01)


@pytest.mark.parametrize("seed", range(12))
def test_any_turn_is_found_from_few_orientations(seed: int) -> None:
    """No start is near: a turn at random, eight orientations, the noise that is usual."""
    rng = np.random.default_rng(seed)
    turn, poses = Rotation.random(rng=rng), Rotation.random(8, rng=rng)
    seen = turn.inv().apply(poses.inv().apply([18_870.0, 1_390.0, 45_750.0]))
    down = poses.inv().apply([0.0, 0.0, 1.0]) + 0.001 * rng.standard_normal((8, 3))
    field = seen + 50.0 * rng.standard_normal((8, 3))
    found = kernel.estimate(down / np.linalg.norm(down, axis=1, keepdims=True), field)
    away = turn_between(found.rotation, turn.as_matrix())
    assert np.linalg.norm(away) < np.radians(1.5)
    assert found.vertical == pytest.approx(45_750.0, abs=500.0)


def test_what_stands_still_is_found() -> None:
    made = simulate_gravity(orientations=10, still_s=3.0, turn_s=2.0, seed=2)
    samples = made.samples
    number = find_rest(samples.time, samples.acceleration, samples.field)
    assert number.max() == 9
    resting = number >= 0
    phase = samples.time % 5.0
    assert (phase[resting] <= 3.0 + 0.3).all()
    assert resting.mean() > 0.4
    # a turn about the vertical is seen by the magnetometer alone
    time = np.arange(0, 20, 0.02)
    rng = np.random.default_rng(0)
    force = np.tile([0.0, 0, -9.8], (1000, 1)) + 0.02 * rng.standard_normal((1000, 3))
    angle = np.clip(time - 8, 0, 4)
    field = 2e4 * np.stack([np.cos(angle), np.sin(angle), 2 + 0 * angle], axis=1)
    turned = find_rest(time, force, field + 50 * rng.standard_normal((1000, 3)))
    assert turned.max() == 1
    assert (turned[(time > 8.3) & (time < 11.7)] == -1).all()


def test_stations_are_taken_as_numbered() -> None:
    made = simulate_gravity(seed=1)
    samples = made.samples
    number = find_rest(samples.time, samples.acceleration, samples.field)
    numbered = samples.with_columns(station=number.astype(float), time=None)
    np.testing.assert_allclose(
        fit_gravity(numbered).rot_bm, fit_gravity(samples).rot_bm, atol=1e-12
    )


def test_a_body_that_stays_level_is_refused() -> None:
    made = simulate_gravity(tilt_deg=0.05, seed=3)
    fit = fit_gravity(made.samples)
    assert fit.verdict == "refused"
    assert fit.findings[0].name == "turn undetermined"
    assert "1.00) of the accelerometer's axes" in fit.findings[0].what.replace("−", "-")


def test_an_uncalibrated_magnetometer_is_noticed_and_its_calibration_used() -> None:
    made = simulate_gravity(bias=(4_000.0, -7_000.0, 3_000.0), seed=4)
    plain = fit_gravity(made.samples)
    assert "vertical varies" in {f.name for f in plain.findings}
    own = Affine(bias=[4_000.0, -7_000.0, 3_000.0], matrix=np.eye(3))
    fit = fit_gravity(made.samples, own)
    assert fit.ok
    assert np.degrees(np.linalg.norm(turn_between(fit.rot_bm, made.rot_bm))) < 0.1
    turned = apply(fit.calibration, made.samples)
    assert turned.frame == "b"
    expected = (made.samples.field - own.bias) @ fit.rot_bm.T
    np.testing.assert_allclose(turned.field, expected, atol=1e-6)


def test_logs_that_will_not_do() -> None:
    made = simulate_gravity(orientations=3)
    with pytest.raises(LogError, match="3 orientations at rest were found and 6 are needed"):
        fit_gravity(made.samples)
    with pytest.raises(LogError, match="without acceleration"):
        fit_gravity(made.samples.with_columns(acceleration=None))


@pytest.mark.slow
@pytest.mark.parametrize("orientations", [6, 8])
def test_few_orientations_state_an_error_that_holds(orientations: int) -> None:
    """Six orientations leave two residuals to tell the noise: Student's t, not Gauss."""
    z = []
    for seed in range(40):
        made = simulate_gravity(orientations=orientations, seed=seed)
        fit = fit_gravity(made.samples)
        off = Rotation.from_matrix(fit.rot_bm @ made.rot_bm.T).as_rotvec(degrees=True)
        z.append(off / fit.sd_deg)
    assert np.mean(np.abs(z) < 1.96) > 0.92


def test_a_mirrored_axis_is_named() -> None:
    """It fits as well as a turn; the field then dips up, which it does in the south only."""
    made = simulate_gravity(rate_Hz=10.0, seed=5).samples
    mirrored = made.with_columns(field=made.field * [1.0, 1.0, -1.0])
    assert [f.name for f in fit_gravity(mirrored).findings] == ["dips the wrong way"]
    swapped = made.with_columns(field=made.field[:, [1, 0, 2]])
    assert fit_gravity(swapped).verdict == "check"
    south = simulate_gravity(field_n=(18_870.0, 1_390.0, -45_750.0), rate_Hz=10.0, seed=5).samples
    assert fit_gravity(south).ok
    at = np.full(len(south.field), -33.0)
    turned = south.with_columns(field=south.field * [-1.0, -1.0, 1.0], latitude_deg=at)
    assert fit_gravity(turned).ok
    mirrored_south = south.with_columns(field=south.field * [1.0, -1.0, 1.0], latitude_deg=at)
    assert fit_gravity(mirrored_south).verdict == "check"


def test_six_sides_are_sure_of_no_more_than_the_sizes_of_field_and_gravity_allow() -> None:
    """Two residuals are small by chance, and a turn was then known too well."""
    sides = Rotation.from_euler(
        "xyz",
        [[0, 0, 0], [180, 0, 0], [90, 0, 0], [-90, 0, 0], [0, 90, 0], [0, -90, 0]],
        degrees=True,
    )
    z = []
    for seed in (*range(12), 30, 90, 107, 121):  # of the last four two residuals told 4 to 6 sd
        rng = np.random.default_rng(seed)
        poses = Rotation.from_rotvec(np.radians(10) * rng.standard_normal((6, 3))) * sides
        turn = Rotation.from_rotvec(np.radians(3) * rng.standard_normal(3))
        seen = turn.inv().apply(poses.inv().apply([18_870.0, 1_390.0, 45_750.0]))
        force = poses.inv().apply([0.0, 0.0, -9.81]) + 0.01 * rng.standard_normal(3)
        size = np.linalg.norm(force, axis=1)
        field = seen + 50.0 * rng.standard_normal((6, 3))
        found = kernel.estimate(-force / size[:, None], field, gravity=size)
        away = turn_between(found.rotation, turn.as_matrix())
        z.append(np.linalg.norm(away) / np.sqrt(np.trace(found.covariance[:3, :3])))
    assert max(z) < 1.5
    assert np.median(z) > 0.15
