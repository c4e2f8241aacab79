"""Where tilt comes from: the log, an accelerometer at rest, a gyro filter in motion."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.alignment import Alignment
from agonic.calibration.setup import Setup
from agonic.errors import LogError, MissingExtraError
from agonic.headings.tilt_source import find_attitude
from agonic.logs.read import read
from agonic.maths.rotations.angles import angle_deg
from agonic.maths.rotations.attitude import down_b
from agonic.samples import Samples
from agonic.simulation import simulate
from tests.headings.flights import each_row, flight, off_deg, plain, setup_for, truth_of

GRAVITY = 9.80665


def tilt_error_deg(samples: Samples, **settings) -> np.ndarray:
    found = find_attitude(samples, setup_for(plain(), **settings), plain())
    return angle_deg(
        down_b(found.roll_deg, found.pitch_deg), down_b(samples.roll_deg, samples.pitch_deg)
    )


def quarter_turn(axis: int) -> Samples:
    """Ten seconds level, 90° about a body axis within a second, ten seconds there; heading 30°."""
    time = np.arange(0, 21.0, 0.01)
    angle = np.clip(time - 10.0, 0.0, 1.0) * 90.0
    turn = Rotation.from_euler("z", 30.0, degrees=True) * Rotation.from_rotvec(
        np.outer(angle, np.eye(3)[axis]), degrees=True
    )
    rate = np.outer(np.gradient(np.radians(angle), time), np.eye(3)[axis])
    return Samples(
        time=time,
        field=turn.apply([20_000.0, 0, 40_000], inverse=True),
        rotation_rate=rate,
        acceleration=turn.apply([0.0, 0.0, -GRAVITY], inverse=True),
    )


@pytest.mark.parametrize(
    ("axis", "down"), [(0, [0.0, 1.0, 0.0]), (1, [-1.0, 0.0, 0.0]), (2, [0.0, 0.0, 1.0])]
)
def test_a_quarter_turn_ends_where_it_should(axis, down) -> None:
    """Right side down after rolling right, tail down after pitching up, level after yawing."""
    samples = quarter_turn(axis)
    for source in ("accelerometer", "gyro"):
        found = find_attitude(samples, setup_for(plain(), tilt=source), plain())
        ends = down_b(found.roll_deg, found.pitch_deg)[[0, -1]]
        assert angle_deg(ends, np.array([[0.0, 0, 1], down])).max() < 0.5
        halfway = down_b(found.roll_deg, found.pitch_deg)[1050]
        middle = np.array([0.0, 0, 1]) + down
        if axis != 2:
            assert angle_deg(halfway, middle) < 2.0
    turned = each_row(samples, setup_for(plain(), declination_deg=0.0, tilt="gyro"))
    assert off_deg(turned.true_deg[0], 30.0) == pytest.approx(0.0, abs=0.5)
    if axis == 2:
        assert off_deg(turned.true_deg[-1], 120.0) == pytest.approx(0.0, abs=0.5)


def test_the_accelerometer_is_turned_with_the_sensor() -> None:
    turn = Rotation.from_euler("ZYX", [120.0, 20.0, 90.0], degrees=True)
    rest = turn.apply([[0.0, 0.0, -GRAVITY]], inverse=True)
    found = find_attitude(
        Samples(field=[[1.0, 0, 0]], acceleration=rest),
        setup_for(plain(), tilt="accelerometer"),
        Alignment(rotation=turn),
    )
    assert (found.roll_deg[0], found.pitch_deg[0]) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_the_filter_holds_where_the_accelerometer_is_fooled() -> None:
    """A hand shakes the sensor: 3 m/s² to and fro, twice a second."""
    made = simulate("hand", n=6000, noise=0.0, seed=3)
    s = made.samples
    shake = 3.0 * np.sin(4 * np.pi * s.time)[:, None] * np.array([1.0, 0.5, 0.0])
    shaken = s.with_columns(acceleration=s.acceleration + shake)
    fooled, held = (tilt_error_deg(shaken, tilt=t) for t in ("accelerometer", "gyro"))
    assert np.sqrt(np.mean(fooled**2)) > 8.0
    assert np.sqrt(np.mean(held**2)) < 1.5


def test_turns_are_taken_out_at_the_speed_that_they_tell() -> None:
    """Half of this flight is turns at 18 m/s; believed, they pull the vertical by 8°."""
    s = flight(n=4000).samples.with_columns(latitude_deg=None, longitude_deg=None, altitude_m=None)
    found = find_attitude(s, setup_for(plain(), tilt="gyro"), plain())
    told = re.search(r"speed in turns is taken as ([0-9.]+) m/s", " ".join(found.notes))
    assert told is not None
    assert float(told[1]) == pytest.approx(18.0, rel=0.05)
    assert np.sqrt(np.mean(tilt_error_deg(s, tilt="gyro") ** 2)) < 0.5
    by_force = find_attitude(s, setup_for(plain(), tilt="accelerometer"), plain())
    error = tilt_error_deg(s, tilt="accelerometer")
    assert 0.3 < by_force.unsure.mean() < 0.8
    assert error[by_force.unsure].mean() > 10 * error[~by_force.unsure].mean()


def test_a_hand_has_no_speed() -> None:
    """Turning to and fro at 2 m/s² of swing is no way ahead, though |f| grows with the rate."""
    made = simulate("hand", n=6000, noise=0.0, seed=3)
    s = made.samples
    rate = np.sqrt((s.rotation_rate**2).sum(axis=1))[:, None]
    swung = s.with_columns(acceleration=s.acceleration * (1 + 0.05 * rate**2))
    found = find_attitude(swung, setup_for(plain(), tilt="gyro"), plain())
    assert not any("speed in turns" in note for note in found.notes)
    assert np.sqrt(np.mean(tilt_error_deg(swung, tilt="gyro") ** 2)) < 1.5


def test_auto_takes_the_best_there_is(monkeypatch) -> None:
    s = flight(n=500).samples
    bare = s.with_columns(roll_deg=None, pitch_deg=None)
    setup = setup_for(plain())
    assert find_attitude(s, setup, plain()).source == "log"
    by_gyro = find_attitude(bare, setup, plain())
    assert by_gyro.source == "gyro"
    assert "no roll and pitch: tilt is by the gyro filter" in by_gyro.notes[0]
    by_force = find_attitude(bare.with_columns(rotation_rate=None), setup, plain())
    assert by_force.source == "accelerometer"
    assert "nor a gyro to use: tilt is from the accelerometer alone" in by_force.notes[0]
    monkeypatch.setattr("agonic.headings.tilt_source.find_spec", lambda name: None)
    without = find_attitude(bare, setup, plain())
    assert without.source == "accelerometer"
    assert "agonic[gyro]" in without.notes[0]


def test_a_missing_filter_is_one_friendly_sentence(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "vqf", None)
    with pytest.raises(MissingExtraError, match=r"agonic\[gyro\]"):
        find_attitude(flight(n=500).samples, setup_for(plain(), tilt="gyro"), plain())


def test_free_fall_and_acceleration_have_no_tilt() -> None:
    force = [[0.0, 0, -GRAVITY], [0.0, 0, 0], [6.0, 0, -GRAVITY]]
    s = Samples(field=np.tile([20_000.0, 0, 40_000], (3, 1)), acceleration=force)
    found = each_row(s, setup_for(plain(), tilt="accelerometer", horizontal=20e3, vertical=40e3))
    assert found.flag_names() == ["", "no attitude", "disturbed+unsure tilt"]
    assert np.isnan(found.true_deg[1])
    assert np.isnan(found.sd_deg[1])


def test_pauses_start_the_filter_anew() -> None:
    s = quarter_turn(0)
    late = s.select((s.time < 9.0) | (s.time > 15.0))
    found = find_attitude(late, setup_for(plain(), tilt="gyro"), plain())
    expected = np.where(late.time < 12, 0.0, 90.0)
    assert np.abs(found.roll_deg - expected).max() < 0.5
    crumbs = s.with_columns(time=np.arange(len(s)) * 5.0)
    with pytest.raises(LogError, match="pauses"):
        find_attitude(crumbs, setup_for(plain(), tilt="gyro"), plain())


def test_headings_by_gyro_follow_the_truth() -> None:
    made = simulate("hand", n=5000, noise=0.0, inclination_deg=65.0, seed=4)
    setup = setup_for(made.truth, tilt="gyro", declination_deg=0.0)
    found = each_row(made.samples, setup)
    error = off_deg(found.true_deg, truth_of(made.samples))[found.trusted]
    assert found.tilt == "gyro"
    assert np.sqrt(np.mean(error**2)) < 1.0


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("trial", "limit_deg"),
    [
        ("02_undisturbed_slow_rotation_B", 0.5),
        ("12_undisturbed_slow_translation_C", 0.5),
        ("07_undisturbed_fast_rotation_B", 1.2),
    ],
)
def test_tilt_by_gyro_agrees_with_optical_truth(recordings: Path, trial, limit_deg) -> None:
    samples = read(recordings / "vehicle" / "broad" / f"{trial}.mat")
    error = tilt_error_deg(samples, tilt="gyro")
    assert np.sqrt(np.mean(error**2)) < limit_deg
    fooled = tilt_error_deg(samples, tilt="accelerometer")
    assert np.sqrt(np.mean(fooled**2)) > 5 * np.sqrt(np.mean(error**2))
    for tilt, angle in (("gyro", error), ("accelerometer", fooled)):
        sd = find_attitude(samples, setup_for(plain(), tilt=tilt), plain()).sd_deg
        assert np.sqrt(np.mean((angle / sd) ** 2) / 2) < 1.0  # both level axes


@pytest.mark.recordings
def test_tilt_by_gyro_beside_an_autopilot_s(recordings: Path) -> None:
    """A quadrotor whose gyros were logged at 10 Hz, and an estimate that errs by degrees itself."""
    whole = read(recordings / "vehicle" / "ardupilot" / "log171.bin")
    samples = whole.select((whole.time >= 84) & (whole.time <= 236))
    error = tilt_error_deg(samples, tilt="gyro")
    sd = find_attitude(samples, setup_for(plain(), tilt="gyro"), plain()).sd_deg
    assert np.sqrt(np.mean((error / sd) ** 2) / 2) < 1.6


def test_setups_that_cannot_be_are_refused() -> None:
    from agonic.errors import AgonicError

    good = setup_for(plain())
    known = {"compasses": good.compasses, "horizontal": 2e4, "vertical": 4e4}
    for wrong in (
        {"tilt": "sideways"},
        {"tilt_order": "yaw"},
        {"tilt_sd_deg": -1.0},
        {"settling_s": 0.0},
        {"declination_deg": 200.0},
        {"horizontal": None},
        {"compasses": ()},
        {"dip_limit_deg": "x"},
        {"tilt_sd_deg": float("nan")},
        {"compasses": good.compasses * 2},
    ):
        with pytest.raises(AgonicError):
            Setup(**known | wrong)
