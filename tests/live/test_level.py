"""A vehicle that stays level: fitted beside its accelerometer and gyro, and told what to drive."""

import numpy as np
import pytest

import agonic as ag
from agonic.live.fit import LiveFit
from agonic.live.level import Level, find_gap, list_steps
from agonic.live.track import MAX_ROWS, extend_track
from tests.live.rover import BIAS, FIELD_N, PLACE, drive, get_motion, heading_error_deg, stand, turn

LEVEL = turn(0, 720)
RAMP = (stand(0), stand(0, pitch=5.0), stand(0, roll=-5.0))


def streamed(samples, pieces=1, **settings):
    live = LiveFit(field_n=tuple(FIELD_N), **settings)
    for rows in np.array_split(np.arange(len(samples)), pieces):
        live.add(samples.time[rows], samples.field[rows], get_motion(samples)[rows])
    return live


@pytest.mark.slow
def test_the_way_is_the_same_however_it_is_cut_and_bounded():
    rng = np.random.default_rng(0)
    n = 300_000  # an hour and a half at 60 readings a second, half of it at rest
    time = np.arange(n) / 60
    moving = (time // 600) % 2 == 0
    field = np.stack([np.cos(time), np.sin(time), 0 * time], axis=1) * moving[:, None]
    rows = np.column_stack([time, 1e4 * field + rng.normal(size=(n, 3)) + 1e4])
    motion = np.tile([0.1, 0.0, -9.8, 0.0, 0.0, 1.0], (n, 1))
    whole, pieces = extend_track(None, rows, motion), None
    for cut in np.array_split(np.arange(n), 71):
        pieces = extend_track(pieces, rows[cut], motion[cut])
    np.testing.assert_array_equal(whole.slots, pieces.slots)
    np.testing.assert_allclose(whole.sums, pieces.sums, rtol=1e-9)
    assert len(whole.slots) <= MAX_ROWS
    kept = (whole.start + whole.sums[:, 1] / whole.sums[:, 0]) // 600 % 2 == 0
    assert kept.mean() > 0.97  # what moved is kept, all but the last stretch
    assert np.diff(whole.make_samples("mag", "nT").time).min() > 0


def test_readings_without_an_acceleration_leave_no_way():
    rows = np.arange(40.0).reshape(10, 4)
    assert extend_track(None, rows, np.full((10, 6), np.nan)) is None
    assert extend_track(None, rows, np.zeros((10, 6))) is None
    track = extend_track(None, rows, np.column_stack([np.ones((10, 3)), np.zeros((10, 3))]))
    assert track.make_samples("mag", "nT").rotation_rate is None  # a device without a gyro
    assert len(extend_track(track, rows, np.ones((10, 6))).slots) == 10  # not later than before


@pytest.fixture(scope="module")
def rovers():
    """Rovers that drove circles, then stood on a ramp: the live fit, and what it was told."""
    made = [drive(LEVEL, *RAMP, seed=seed) for seed in range(6)]
    return [(streamed(samples, target_deg=0.3), samples) for samples in made]


@pytest.mark.slow
def test_a_rover_on_a_ramp_ends_well_and_its_error_is_what_is_stated(rovers):
    ratios = []
    for seed, (live, _) in enumerate(rovers):
        assert live.guidance.done, live.guidance.findings
        assert live.aided.method == "inertial"
        stated = [live.coverage.heading_sd_deg, live.aided.vehicle_sd_deg]
        ratios.append(heading_error_deg(live.calibration, seed) / stated)
        assert np.abs((live.calibration.bias - BIAS) / live.calibration.sd[:3]).max() < 4
    rms = np.sqrt(np.mean(np.square(ratios), axis=0))
    assert ((rms > 0.5) & (rms < 1.5)).all()


@pytest.mark.slow
def test_it_accepts_what_calibrate_gives_for_the_same_rows(rovers):
    live, samples = rovers[0]
    accepted, whole = ag.calibrate(live.samples, PLACE), ag.calibrate(samples, PLACE)
    assert accepted.method == whole.method == "inertial"
    assert accepted.verdict == whole.verdict == "good"
    moved = np.abs(accepted.calibration.bias - whole.calibration.bias)
    assert (moved < whole.fit.sd[:3]).all()
    np.testing.assert_allclose(live.calibration.bias, accepted.calibration.bias, rtol=1e-6)


@pytest.mark.slow
def test_missing_headings_are_named_and_what_a_step_brings_is_what_comes(rovers):
    samples = drive(turn(0, 220))
    live = streamed(samples)
    told = live.guidance
    assert told.say.startswith("turn slowly through headings 240° to 0°: heading error then ±")
    assert told.level.seen.tolist() == [True] * 8 + [False] * 4
    live = streamed(drive(LEVEL, seed=2), target_deg=0.1)
    plan = live.guidance.plan
    assert "ramp of 5°: nose up, then left side up" in plan.step.say
    after, _ = rovers[2]
    assert plan.after_deg == pytest.approx(after.coverage.heading_sd_deg, rel=0.6)
    assert after.coverage.heading_sd_deg < 0.4 * live.coverage.heading_sd_deg
    assert after.guidance.level.tilt_deg == pytest.approx(5.0, abs=1.0)


def test_without_a_place_it_is_asked_for():
    samples = drive(LEVEL)
    live = LiveFit(magnitude=50_000.0)
    live.add(samples.time, samples.field, get_motion(samples))
    told = live.guidance
    assert [one.name for one in told.findings if one.name == "place"] == ["place"]
    assert told.say == "turn slowly through a full circle, and tilt it where it can be tilted"
    assert not told.done


@pytest.mark.slow
def test_what_is_saved_of_a_level_vehicle_gives_the_same_calibration_again(tmp_path):
    """Acceleration and rates are saved with the readings, also where no place told their use."""
    samples = drive(LEVEL, *(stand(0, pitch=tilt) for tilt in (8.0, -8.0)), turn(0, 720, 5.0))
    live = LiveFit(magnitude=50_000.0)
    live.add(samples.time, samples.field, get_motion(samples))
    kept = ag.calibrate(live.samples)
    saved = ag.read(ag.write_csv(live.samples, tmp_path / "readings.csv"))
    assert saved.acceleration is not None
    assert saved.rotation_rate is not None
    again = ag.calibrate(saved)
    assert again.method == kept.method == "inertial"
    assert again.verdict == kept.verdict
    np.testing.assert_allclose(again.calibration.bias, kept.calibration.bias)


@pytest.mark.slow
def test_what_is_turned_over_is_fitted_by_the_magnitude_as_before():
    made = ag.simulate("tumble", n=1500, noise=150.0).samples
    bare = LiveFit(magnitude=50_000.0)
    bare.add(made.time, made.field)
    place = ag.Reference.vector([25_000.0, 0.0, 43_301.27], frame="n")
    live = LiveFit(field_n=tuple(place.values[0]))
    live.add(made.time, made.field, get_motion(made))
    assert live.guidance.level is None
    assert live.aided.method == "ellipsoid"
    np.testing.assert_allclose(live.calibration.bias, bare.calibration.bias, rtol=1e-6)
    np.testing.assert_array_equal(live.samples.field, bare.samples.field)
    assert live.guidance.done == bare.guidance.done


def test_a_session_goes_on_with_its_way(tmp_path):
    samples = drive(turn(0, 360))
    live = streamed(samples)
    again = LiveFit.resume(live.save(tmp_path / "mag.live"))
    np.testing.assert_array_equal(again.state.track.sums, live.state.track.sums)
    assert again.params.reference.kind == "vector"


def test_steps_of_one_who_has_seen_nothing_and_who_has_seen_all():
    assert find_gap(np.zeros(12, dtype=bool)) == (0, 12)
    blank = Level(np.array([0.0, 0.0, 1.0]), np.zeros(12, int), np.zeros(12), 0.0, 0.0, 0.0)
    assert [step.say for step in list_steps(blank)] == ["turn slowly through a full circle"]
    steep = blank._replace(counts=np.full(12, 9), tilts_deg=np.full(12, 25.0))
    assert [step.say for step in list_steps(steep)] == ["turn a full circle more"]
