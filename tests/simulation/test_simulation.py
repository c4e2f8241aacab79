"""Simulated readings against the truth they claim, and defects against what they say they do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.errors import AgonicError
from agonic.maths.equation.coverage import count_visits
from agonic.samples import Samples
from agonic.simulation import (
    Simulated,
    clipped,
    delayed,
    drifting,
    duplicated,
    frozen,
    kinds,
    magnet_attached,
    mixed,
    quantised,
    random_calibration,
    simulate,
    with_correlated_noise,
    with_gap,
    with_nan,
    with_outliers,
)

nT = 1.0
SMOOTH = ("tumble", "hand", "circle", "flight", "boat", "car", "static")
MOVING = ("flight", "boat", "car")
IDENTITY = Affine(bias=np.zeros(3), matrix=np.eye(3))


def directions(simulated: Simulated) -> np.ndarray:
    """Unit field directions in sensor axes."""
    return simulated.field_b / np.linalg.norm(simulated.field_b, axis=1, keepdims=True)


def attitude(samples: Samples) -> Rotation:
    """rot_nb of the columns, by SciPy's own intrinsic yaw-pitch-roll."""
    angles = np.stack([samples.heading_deg, samples.pitch_deg, samples.roll_deg], axis=1)
    return Rotation.from_euler("ZYX", angles, degrees=True)


def specific_force_n(samples: Samples) -> np.ndarray:
    """The accelerometer's reading in north-east-down, (n, 3)."""
    return np.einsum("nij,nj->ni", attitude(samples).as_matrix(), samples.acceleration)


def stray(simulated: Simulated) -> np.ndarray:
    """The field of on-board current that the facts tell, (n, 3), or 0 where there is none."""
    if simulated.samples.current_A is None:
        return np.zeros(3)
    return np.outer(simulated.samples.current_A, simulated.facts["stray_nT_A"])


@pytest.mark.parametrize("kind", kinds())
def test_truth_gives_back_the_field(kind):
    s = simulate(kind, noise=0.0, seed=3)
    corrected = s.truth.correct(s.samples.field) - stray(s)
    np.testing.assert_allclose(corrected, s.field_b, atol=1e-6 * nT)
    np.testing.assert_allclose(np.linalg.norm(s.field_b, axis=1), 50_000, rtol=1e-12)


@pytest.mark.parametrize("kind", kinds())
def test_field_is_that_of_the_recorded_attitude(kind):
    s = simulate(kind, inclination_deg=-35.0, declination_deg=12.0, magnitude=30_000.0)
    level, dip, east = np.cos(np.radians(-35)), np.sin(np.radians(-35)), np.radians(12)
    field_n = 30_000 * np.array([level * np.cos(east), level * np.sin(east), dip])
    np.testing.assert_allclose(s.field_n, field_n)
    field_b = attitude(s.samples).apply(field_n, inverse=True)
    np.testing.assert_allclose(s.field_b, field_b, atol=1e-6 * nT)


@pytest.mark.parametrize(
    ("angle", "field_b"),
    [
        ({}, [300.0, 0, 400.0]),
        ({"heading_deg": 90.0}, [0, -300.0, 400.0]),  # nose east: north is on the left
        ({"pitch_deg": 90.0}, [-400.0, 0, 300.0]),  # nose up: down is behind, north is below
        ({"roll_deg": 90.0}, [300.0, 400.0, 0]),  # right wing down: down is on the right
    ],
)
def test_axes_and_signs(angle, field_b):
    dip = np.degrees(np.arctan2(400, 300))
    s = simulate(
        "static", magnitude=500, inclination_deg=dip, noise=0, calibration=IDENTITY, **angle
    )
    np.testing.assert_allclose(s.samples.field[0], field_b, atol=1e-9)


@pytest.mark.parametrize("pitch_deg", [90.0, -90.0])
def test_nose_on_end_keeps_the_attitude(pitch_deg):
    s = simulate("static", n=1, noise=0.0, heading_deg=30.0, pitch_deg=pitch_deg, roll_deg=20.0)
    asked = Rotation.from_euler("ZYX", [30.0, pitch_deg, 20.0], degrees=True)
    np.testing.assert_allclose(s.field_b[0], asked.inv().apply(s.field_n), atol=1e-6 * nT)
    np.testing.assert_allclose(s.truth.correct(s.samples.field), s.field_b, atol=1e-6 * nT)


def test_noise_is_white_and_isotropic_in_the_readings():
    s = simulate("sphere", n=100_000, noise=300.0)
    noise = s.samples.field - s.truth.bias - s.field_b @ np.linalg.inv(s.truth.matrix).T
    np.testing.assert_allclose(np.cov(noise.T) / 300**2, np.eye(3), atol=0.02)
    assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.02


@pytest.mark.parametrize("kind", [kind for kind in kinds() if kind not in MOVING])
def test_specific_force_is_gravity(kind):
    s = simulate(kind)
    force_n = specific_force_n(s.samples)
    np.testing.assert_allclose(force_n, np.tile([0, 0, -9.80665], (3000, 1)), atol=1e-9)


@pytest.mark.parametrize("kind", kinds())
def test_rotation_rate_joins_successive_attitudes(kind):
    s = simulate(kind, rate_Hz=200.0)
    rate = s.samples.rotation_rate
    if kind not in SMOOTH:
        assert rate is None
        return
    turned = (attitude(s.samples)[:-1].inv() * attitude(s.samples)[1:]).as_rotvec() * 200.0
    np.testing.assert_allclose(turned, (rate[1:] + rate[:-1]) / 2, atol=2e-3)


@pytest.mark.parametrize("kind", MOVING)
def test_specific_force_is_that_of_the_way(kind):
    """The change of the velocity that the recorded positions tell, less gravity."""
    s = simulate(kind, rate_Hz=50.0, seed=4).samples
    north = np.radians(s.latitude_deg) * 6_371_008.8
    east = np.radians(s.longitude_deg) * 6_371_008.8 * np.cos(np.radians(s.latitude_deg[0]))
    way = np.stack([north, east, -s.altitude_m], axis=1)
    acceleration = np.gradient(np.gradient(way, s.time, axis=0), s.time, axis=0)
    wanted = acceleration - [0.0, 0, 9.80665]
    inside = slice(5, -5)
    np.testing.assert_allclose(specific_force_n(s)[inside], wanted[inside], atol=0.02)
    assert np.abs(acceleration).max() > 0.5


def test_a_car_turns_flat_and_a_boat_rolls():
    car, boat = simulate("car").samples, simulate("boat", roll_sd_deg=6.0, n=12_000).samples
    assert np.abs(car.roll_deg).max() < 12.0
    assert boat.roll_deg.std() == pytest.approx(6.0, rel=0.2)


def test_level_circle_turns_clockwise_at_its_period():
    s = simulate("circle", tilt_deg=0.0, period_s=10.0)
    np.testing.assert_allclose(s.samples.rotation_rate, [[0, 0, 2 * np.pi / 10]] * 3000, atol=1e-9)
    turned = np.unwrap(s.samples.heading_deg, period=360)
    assert turned[-1] - turned[0] == pytest.approx(360 * s.samples.duration_s / 10)


def test_tumble_covers_the_sphere_evenly():
    filled = [np.mean(count_visits(directions(simulate("tumble", seed=k))) > 0) for k in range(10)]
    assert min(filled) > 0.95
    long = directions(simulate("tumble", n=100_000, rate_Hz=0.7))
    np.testing.assert_allclose(long.T @ long / len(long), np.eye(3) / 3, atol=0.01)
    np.testing.assert_allclose(long.mean(axis=0), 0, atol=0.01)


def test_tumble_is_as_brisk_as_a_hand_can_be():
    speed = np.linalg.norm(simulate("tumble", n=30_000).samples.rotation_rate, axis=1)
    assert np.mean(speed) == pytest.approx(np.radians(126.5), rel=0.1)  # mean angle under Haar
    assert speed.max() < np.radians(500)


def test_sphere_is_uniform_over_attitudes():
    s = simulate("sphere", n=50_000)
    seen = directions(s)
    np.testing.assert_allclose(seen.mean(axis=0), 0, atol=0.015)
    assert np.mean(np.abs(seen[:, 2]) < 0.5) == pytest.approx(0.5, abs=0.01)  # Archimedes
    angle = attitude(s.samples).magnitude()
    assert angle.mean() == pytest.approx(np.pi / 2 + 2 / np.pi, abs=0.015)


def test_belt_keeps_to_its_belt_and_fills_it():
    axis = np.array([1.0, 2.0, -2.0]) / 3
    s = simulate("belt", n=20_000, tilt_deg=15.0, axis=(1.0, 2.0, -2.0))
    height = directions(s) @ axis / np.sin(np.radians(15))
    assert np.abs(height).max() <= 1 + 1e-12
    np.testing.assert_allclose(np.quantile(height, [0.25, 0.5, 0.75]), [-0.5, 0, 0.5], atol=0.03)
    across = directions(s) @ np.linalg.svd(axis[None])[2][1:].T
    np.testing.assert_allclose(across.mean(axis=0), 0, atol=0.02)


def test_hand_covers_the_most_part():
    filled = [np.mean(count_visits(directions(simulate("hand", seed=k))) > 0) for k in range(10)]
    assert min(filled) > 0.8
    assert np.mean(filled) < 1.0


@pytest.mark.parametrize("smooth", [True, False])
def test_circle_has_all_headings_and_keeps_its_tilt(smooth):
    s = simulate("circle", n=30_000, tilt_deg=25.0, smooth=smooth)
    down_b = attitude(s.samples).apply([0.0, 0.0, 1.0], inverse=True)
    tilt = np.degrees(np.arccos(down_b[:, 2]))
    assert tilt.max() <= 25 + 1e-6
    np.testing.assert_allclose(np.quantile(tilt, [0.2, 0.5, 0.8]), [5, 12.5, 20], atol=1.0)
    headings = np.histogram(s.samples.heading_deg, bins=36, range=(0, 360))[0]
    assert headings.min() > 0.7 * 30_000 / 36
    sides = np.histogram(np.arctan2(down_b[:, 1], down_b[:, 0]), bins=12)[0]
    assert sides.min() > 0.7 * 30_000 / 12
    assert (s.samples.rotation_rate is not None) == smooth


@pytest.fixture(scope="module")
def flown() -> Simulated:
    return simulate("flight", n=30_000, noise=0.0, seed=5)


class TestFlight:
    def test_position_follows_the_speed_and_the_nose(self, flown):
        s = flown.samples
        north, east = (
            np.radians(np.gradient(c, s.time)) * 6_371_008.8 * factor
            for c, factor in ((s.latitude_deg, 1), (s.longitude_deg, np.cos(np.radians(47.0))))
        )
        speed = np.sqrt(north**2 + east**2 + np.gradient(s.altitude_m, s.time) ** 2)
        np.testing.assert_allclose(speed[5:-5], 18.0, rtol=1e-3)
        off = (np.degrees(np.arctan2(east, north)) - s.heading_deg + 180) % 360 - 180
        assert np.std(off) < 2.0  # gusts only

    def test_acceleration_is_that_of_the_path(self, flown):
        s = flown.samples
        force_n = specific_force_n(s)
        east = np.radians(s.longitude_deg) * 6_371_008.8 * np.cos(np.radians(47.0))
        twice = np.gradient(np.gradient(east, s.time), s.time)
        np.testing.assert_allclose(force_n[9:-9, 1], twice[9:-9], atol=0.05)

    def test_turns_are_coordinated_and_go_both_ways(self, flown):
        s = flown.samples
        assert np.std(s.acceleration[:, 1]) < 0.5  # no side force but for gusts
        assert s.roll_deg.max() > 25
        assert s.roll_deg.min() < -25
        assert np.histogram(s.heading_deg, bins=12, range=(0, 360))[0].min() > 0

    def test_current_adds_its_field(self, flown):
        s = flown
        added = s.truth.correct(s.samples.field) - s.field_b
        fitted = np.linalg.lstsq(s.samples.current_A[:, None], added, rcond=None)[0][0]
        np.testing.assert_allclose(fitted, [60.0, -35.0, 90.0], rtol=1e-9)
        assert np.ptp(s.samples.current_A) > 5.0
        assert 0 <= s.samples.throttle.min() < s.samples.throttle.max() <= 1

    def test_copter_leans_forward_and_flies_slower(self, flown):
        copter = simulate("flight", n=30_000, noise=0.0, seed=5, vehicle="copter").samples
        assert np.mean(copter.pitch_deg) < -5 < np.mean(flown.samples.pitch_deg)
        assert np.ptp(copter.roll_deg) < np.ptp(flown.samples.roll_deg)


def test_random_calibration_keeps_its_limits():
    rng = np.random.default_rng(0)
    drawn = [random_calibration(rng, soft_iron=0.1, cross=0.05, bias=7e4) for _ in range(300)]
    matrices = np.array([c.matrix for c in drawn])
    np.testing.assert_array_equal(matrices, np.swapaxes(matrices, 1, 2))
    diagonal = np.abs(np.diagonal(matrices, axis1=1, axis2=2) - 1)
    cross = np.abs(matrices[:, *np.triu_indices(3, 1)])
    assert 0.09 < diagonal.max() <= 0.1
    assert 0.045 < cross.max() <= 0.05
    biases = np.array([c.bias for c in drawn])
    np.testing.assert_allclose(np.linalg.norm(biases, axis=1), 7e4)
    assert np.linalg.norm(biases.mean(axis=0)) < 0.15 * 7e4


@pytest.mark.parametrize(("model", "gains"), [("sphere", 1), ("diagonal", 3)])
def test_smaller_models_have_fewer_gains_and_no_cross_terms(model, gains):
    truth = random_calibration(np.random.default_rng(2), model=model)
    assert truth.model == model
    assert len(set(np.diag(truth.matrix))) == gains
    np.testing.assert_array_equal(truth.matrix, np.diag(np.diag(truth.matrix)))


def test_given_calibration_is_the_truth():
    turned = Affine(bias=[1e4, 0, -2e4], matrix=[[1.1, 0.2, 0], [-0.1, 0.9, 0.1], [0, 0, 1]])
    s = simulate("tumble", noise=0.0, calibration=turned)
    np.testing.assert_allclose(turned.correct(s.samples.field), s.field_b, atol=1e-6 * nT)


def test_counts_scale_readings_and_truth_alike():
    in_nT, counts = (simulate("tumble", counts_per_nT=c) for c in (None, 0.25))
    assert counts.samples.unit == counts.truth.unit_in == "raw"
    np.testing.assert_allclose(counts.samples.field, in_nT.samples.field * 0.25)
    np.testing.assert_allclose(
        counts.truth.correct(counts.samples.field), in_nT.truth.correct(in_nT.samples.field)
    )
    assert counts.truth.noise == pytest.approx(50.0)
    with pytest.raises(AgonicError, match="counts already"):
        simulate("tumble", calibration=counts.truth, counts_per_nT=0.25)


@pytest.mark.parametrize("kind", kinds())
def test_same_seed_same_readings(kind):
    first, again, other = (simulate(kind, n=100, seed=k) for k in (7, 7, 8))
    np.testing.assert_array_equal(first.samples.field, again.samples.field)
    assert not np.allclose(first.samples.field, other.samples.field)


def test_noise_leaves_motion_and_calibration_alone():
    quiet, loud = (simulate("hand", noise=sd, seed=4) for sd in (0.0, 500.0))
    np.testing.assert_array_equal(quiet.field_b, loud.field_b)
    np.testing.assert_array_equal(quiet.truth.matrix, loud.truth.matrix)


@pytest.mark.parametrize("kind", kinds())
def test_one_row_is_enough(kind):
    assert len(simulate(kind, n=1).samples) == 1


def test_facts_tell_how_it_was_made():
    facts = simulate("belt", tilt_deg=3.0, seed=9).facts
    assert (facts["kind"], facts["seed"], facts["tilt_deg"]) == ("belt", 9, 3.0)
    assert facts["axis"] == (0.0, 0.0, 1.0)  # defaults too


@pytest.mark.parametrize(
    ("kind", "settings", "says"),
    [
        ("spin", {}, "choose from tumble"),
        ("belt", {"tilt": 3.0}, "it takes tilt_deg, axis"),
        ("sphere", {"tilt_deg": 3.0}, "none of its own"),
        ("flight", {"vehicle": "boat"}, "choose from plane, copter"),
        ("tumble", {"n": 0}, "n is 0"),
        ("tumble", {"rate_Hz": -1.0}, "rate_Hz"),
        ("tumble", {"pace_s": 0.0}, "pace_s"),
        ("tumble", {"magnitude": float("nan")}, "magnitude"),
    ],
)
def test_bad_settings_are_named(kind, settings, says):
    with pytest.raises(AgonicError, match=says):
        simulate(kind, **settings)


@pytest.fixture(scope="module")
def samples() -> Samples:
    return simulate("tumble", n=2000, noise=100.0).samples


class TestDefects:
    def test_the_input_stays_as_it_was(self, samples):
        before = samples.field.copy()
        for defect in (quantised(5), clipped(1e4), with_outliers(), frozen(1), drifting([1, 2, 3])):
            assert not np.array_equal(defect(samples).field, before)
        np.testing.assert_array_equal(samples.field, before)

    def test_quantised_to_the_nearest_step(self, samples):
        field = quantised(150.0)(samples).field
        np.testing.assert_allclose(field / 150, np.round(field / 150), atol=1e-9)
        assert np.abs(field - samples.field).max() <= 75

    def test_clipped_only_beyond_the_limit(self, samples):
        field = clipped(40_000)(samples).field
        inside = np.abs(samples.field) <= 40_000
        assert 0 < inside.mean() < 1
        np.testing.assert_array_equal(field[inside], samples.field[inside])
        np.testing.assert_array_equal(np.abs(field[~inside]), 40_000)
        np.testing.assert_array_equal(np.sign(field), np.sign(samples.field))

    def test_outliers_have_the_share_and_lengths_asked_for(self, samples):
        added = with_outliers(0.1, smallest=2e4, largest=3e4, seed=1)(samples).field
        added = added - samples.field
        length = np.linalg.norm(added, axis=1)
        hit = length > 0
        assert hit.sum() == 200
        assert 2e4 <= length[hit].min() < 2.1e4
        assert 2.9e4 < length[hit].max() <= 3e4 + 1e-6
        assert np.linalg.norm((added[hit] / length[hit, None]).mean(axis=0)) < 0.2  # all sides

    def test_nan_rows_are_counted(self, samples):
        lost = with_nan(0.02)(samples)
        assert (len(lost), sum(lost.rejected.values())) == (1960, 40)

    def test_gap_leaves_the_rest(self, samples):
        left = with_gap(10.0, 25.0)(samples)
        assert len(left) == 2000 - 750
        assert np.diff(left.time).max() == pytest.approx(15.0 + 0.02)

    def test_frozen_axis_keeps_its_last_value(self, samples):
        field = frozen(2, start=20.0)(samples).field
        np.testing.assert_array_equal(field[1000:, 2], samples.field[1000, 2])
        np.testing.assert_array_equal(field[:1000], samples.field[:1000])
        np.testing.assert_array_equal(field[:, :2], samples.field[:, :2])
        assert np.ptp(frozen(0)(samples).field[:, 0]) == 0

    def test_magnet_moves_the_bias_while_it_is_there(self, samples):
        offset = np.array([3000.0, -500.0, 700.0])
        moved = magnet_attached(10.0, offset, until=30.0)(samples).field - samples.field
        there = (samples.time >= 10) & (samples.time < 30)
        np.testing.assert_allclose(moved[there], np.tile(offset, (1000, 1)), atol=1e-9)
        np.testing.assert_array_equal(moved[~there], 0)

    def test_drift_is_steady(self, samples):
        moved = drifting([900.0, 0, -300.0])(samples).field - samples.field
        np.testing.assert_allclose(moved[-1], [900.0, 0, -300.0])
        np.testing.assert_allclose(np.diff(moved, axis=0), [[900 / 1999, 0, -300 / 1999]] * 1999)

    def test_correlated_noise_has_its_sd_and_time(self):
        still = simulate("static", n=100_000, rate_Hz=10.0).samples
        noise = with_correlated_noise(250.0, 2.0)(still).field - still.field
        np.testing.assert_allclose(noise.std(axis=0), 250, rtol=0.05)
        after = np.mean(noise[20:] * noise[:-20]) / np.mean(noise**2)  # 2 s later
        assert after == pytest.approx(np.exp(-1), abs=0.03)
        assert np.abs(np.corrcoef(noise.T)[np.triu_indices(3, 1)]).max() < 0.05

    def test_delay_of_whole_rows_is_exact(self, samples):
        late = delayed(0.1)(samples)
        np.testing.assert_allclose(late.field, samples.field[:-5], atol=1e-6 * nT)
        np.testing.assert_array_equal(late.heading_deg, samples.heading_deg[5:])

    def test_delay_shows_the_field_of_before(self):
        slow = simulate("circle", noise=0.0, calibration=IDENTITY)
        late = delayed(0.25)(slow.samples)
        past = np.interp(late.time - 0.25, slow.samples.time, slow.field_b[:, 0])
        np.testing.assert_allclose(late.field[:, 0], past, atol=5 * nT)

    def test_delay_can_run_ahead(self, samples):
        early = delayed(-0.1)(samples)
        np.testing.assert_allclose(early.field, samples.field[5:], atol=1e-6 * nT)

    def test_duplicated_holds_each_reading(self, samples):
        field = duplicated(4)(samples).field
        np.testing.assert_array_equal(field[::4], samples.field[::4])
        for k in (1, 2, 3):
            np.testing.assert_array_equal(field[k::4], field[::4])

    def test_mixed_takes_turns(self, samples):
        other = simulate("tumble", n=2000, seed=1).samples.with_columns(temperature=np.zeros(2000))
        both = mixed(other)(samples.with_columns(current_A=np.ones(2000)))
        np.testing.assert_array_equal(both.field[::2], samples.field)
        np.testing.assert_array_equal(both.field[1::2], other.field)
        assert not both.rejected
        assert both.temperature is None
        assert both.current_A is None  # only one of the two had it

    def test_mixed_keeps_times_that_differ(self, samples):
        other = samples.with_columns(time=samples.time + 0.003)
        times = mixed(other)(samples).time
        np.testing.assert_array_equal(times[1::2], other.time)

    def test_truth_stays_beside_the_rows_that_are_left(self):
        s = simulate("tumble", noise=0.0, defects=[with_nan(0.1), with_gap(5, 9)])
        assert len(s.field_b) == len(s.samples) < 3000
        np.testing.assert_allclose(s.truth.correct(s.samples.field), s.field_b, atol=1e-6 * nT)

    def test_defects_come_in_order(self, samples):
        s = simulate("tumble", n=2000, noise=100.0, defects=[clipped(40_000), drifting([9, 9, 9])])
        wanted = drifting([9, 9, 9])(clipped(40_000)(samples))
        np.testing.assert_array_equal(s.samples.field, wanted.field)

    def test_a_defect_in_time_needs_times(self):
        with pytest.raises(AgonicError, match="the samples have none"):
            with_gap(1, 2)(Samples(field=np.ones((5, 3))))

    def test_a_share_is_a_share(self, samples):
        with pytest.raises(AgonicError, match="from 0 to 1"):
            with_outliers(5)(samples)

    def test_the_attitude_must_stay_until_the_truth_is_known(self):
        with pytest.raises(AgonicError, match="took the attitude away"):
            simulate("tumble", n=10, defects=[lambda s: s.with_columns(roll_deg=None)])

    def test_frozen_needs_an_axis(self):
        with pytest.raises(AgonicError, match="0, 1 or 2"):
            frozen(3)
