"""Headings against simulated truth: the chain, several sensors, flags, and what is refused."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.calibration.deviation import Deviation
from agonic.calibration.interference import Interference
from agonic.calibration.setup import Compass, Setup
from agonic.errors import FrameError, LogError, UnitError, ValidityError
from agonic.field import wmm
from agonic.samples import Samples
from agonic.simulation import delayed, magnet_attached, simulate
from tests.headings.flights import FIELD, each_row, flight, off_deg, plain, setup_for, truth_of


def test_a_banked_flight_without_noise_is_exact() -> None:
    made = flight()
    found = each_row(made.samples, setup_for(made.truth))
    assert np.abs(off_deg(found.true_deg, truth_of(made.samples))).max() < 1e-6
    assert np.abs(off_deg(found.magnetic_deg, truth_of(made.samples) - 2.0)).max() < 1e-6
    assert found.trusted.all()
    assert found.disagreement_deg is None
    assert found.roll_deg.tolist() == made.samples.roll_deg.tolist()


def test_a_mounted_sensor_is_turned_into_body_axes() -> None:
    made = flight()
    turn = Rotation.from_euler("ZYX", [90.0, 10.0, -120.0], degrees=True)
    s = made.samples
    tilted = s.with_columns(
        field=turn.apply(made.truth.correct(s.field), inverse=True),
        acceleration=turn.apply(s.acceleration.copy(), inverse=True),
    )
    chain = Chain(steps=(plain(), Alignment(rotation=turn)))
    found = each_row(tilted, setup_for(chain))
    assert np.abs(off_deg(found.true_deg, truth_of(s))).max() < 1e-6


def test_currents_and_a_second_sensor_are_taken_out() -> None:
    stray = (300.0, -200.0, 500.0)
    made = flight(stray_nT_A=stray)
    inverse = np.linalg.inv(made.truth.matrix)
    motors = Interference(
        bias=made.truth.bias,
        matrix=made.truth.matrix,
        sources=("current_A",),
        coefficients=(inverse @ stray)[:, None],
        noise=0.0,
    )
    dirty = each_row(made.samples, setup_for(made.truth))
    clean = each_row(made.samples, setup_for(motors))
    assert np.abs(off_deg(dirty.true_deg, truth_of(made.samples))).max() > 5
    assert np.abs(off_deg(clean.true_deg, truth_of(made.samples))).max() < 1e-6


def test_deviation_comes_before_declination() -> None:
    made = flight()
    card = Deviation(coefficients=[1.0, 6.0, -4.0, 2.0, 1.0], heel=[0.05, -0.1, 0.02, 0.03])
    bare = each_row(made.samples, setup_for(made.truth))
    found = each_row(made.samples, setup_for(made.truth, deviation=card))
    s = made.samples
    added = card.at(bare.compass_deg, s.roll_deg, s.pitch_deg)
    assert found.compass_deg == pytest.approx(bare.compass_deg)
    assert np.abs(off_deg(found.magnetic_deg, bare.compass_deg + added)).max() < 1e-9
    assert np.abs(off_deg(found.true_deg, found.magnetic_deg + 2.0)).max() < 1e-9


@pytest.mark.parametrize("late_s", [0.04, 0.093, -0.02, -0.1])
def test_late_readings_are_put_back_and_late_attitudes(late_s) -> None:
    """Readings that seem early are on time, beside an attitude that came late."""
    made = flight(defects=[delayed(late_s)])
    ignored = each_row(made.samples, setup_for(made.truth))
    found = each_row(made.samples, setup_for(made.truth, latency_s=late_s))
    time, truth = made.samples.time, truth_of(made.samples)
    moved = np.interp(time - min(late_s, 0.0), time, np.unwrap(truth, period=360.0))
    truth = np.where(found.flags["no reading"], truth, moved % 360.0)
    there = ~found.flags["no reading"]
    assert 2000 - there.sum() <= 12
    assert np.isnan(found.true_deg[~there]).all()
    left = np.abs(off_deg(found.true_deg, truth)[there]).max()
    assert left < 0.1 * np.abs(off_deg(ignored.true_deg, truth)).max()
    assert left < 0.05


def test_an_attitude_that_is_held_for_rows_is_filled_in() -> None:
    """Beside one that is written five times as often as it is known, headings are right between."""
    made = flight()
    s, held = made.samples, np.arange(len(made.samples)) // 5 * 5
    slow = s.with_columns(roll_deg=s.roll_deg[held], pitch_deg=s.pitch_deg[held])
    found = each_row(slow, setup_for(made.truth)).true_deg[:-5]
    assert np.abs(off_deg(found, truth_of(s)[:-5])).max() < 0.3
    noise = 0.01 * np.random.default_rng(1).normal(size=s.field.shape)
    still = slow.with_columns(field=s.field[held] + noise)  # in each pose: nothing lies between
    found = each_row(still, setup_for(made.truth))
    assert np.abs(off_deg(found.true_deg, truth_of(s)[held])).max() < 1e-3


def test_a_two_axis_compass_needs_no_vertical_axis() -> None:
    made = simulate("circle", tilt_deg=1e-9, n=300, noise=0.0, calibration=plain(), seed=2)
    flat = made.samples.with_columns(field=made.samples.field * [0.7, 0.7, 0.0])
    setup = Setup(
        compasses=(Compass(calibration=plain(), latency_sd_s=0.0),),
        tilt="level",
        declination_deg=0.0,
        horizontal=17_500.0,
        vertical=30_000.0,
    )
    found = each_row(flat, setup)
    assert np.abs(off_deg(found.true_deg, truth_of(flat))).max() < 1e-6
    assert found.trusted.all()
    assert found.sd_deg == pytest.approx(0.5 * 30_000 / 17_500)
    blind = each_row(flat, replace(setup, horizontal=None, vertical=None))
    assert "the vertical intensity is not known" in " ".join(blind.notes)


def test_inclinometer_angles_are_understood_by_name() -> None:
    turn = Rotation.from_euler("ZXY", [[70.0, 20.0, -35.0], [200.0, -40.0, 15.0]], degrees=True)
    field_n = np.array([20_000.0, 0.0, 40_000.0])
    samples = Samples(
        field=turn.apply(field_n, inverse=True), roll_deg=[20.0, -40.0], pitch_deg=[-35.0, 15.0]
    )
    setup = Setup(
        compasses=(Compass(calibration=plain()),), tilt_order="pitch-roll", declination_deg=0.0
    )
    assert each_row(samples, setup).true_deg == pytest.approx([70.0, 200.0])


def two_sensors(defect=None):
    """A vehicle with two magnetometers, the second read at other times and other axes' gains."""
    first, second = flight(seed=5, n=1000), flight(seed=5, n=1000)
    one = first.samples.with_columns(field=first.field_b, name="MAG1")
    field = second.field_b * [1.0, 1.1, 0.9] + [500.0, 0.0, 0.0]
    two = second.samples.with_columns(field=field, name="MAG2")
    if defect is not None:
        one = defect(one)
    calibrations = (
        plain("MAG1"),
        replace(plain("MAG2"), bias=[500.0, 0, 0], matrix=np.diag([1.0, 1 / 1.1, 1 / 0.9])),
    )
    compasses = tuple(Compass(calibration=c) for c in calibrations)
    setup = replace(setup_for(plain()), compasses=compasses)
    return one, two.select(np.arange(1, 999)), setup


def test_a_disturbed_sensor_gives_way_to_the_next() -> None:
    magnet = magnet_attached(5.0, [9000.0, -6000.0, 3000.0], until=9.0)
    one, two, setup = two_sensors(magnet)
    found = each_row([two, one], setup)
    during = (one.time >= 5.0) & (one.time < 9.0)
    assert found.sensors == ("MAG1", "MAG2")
    assert (found.used == during).all()
    assert np.abs(off_deg(found.true_deg, truth_of(one))[1:-1]).max() < 1e-6
    assert not found.flags["disturbed"].any()
    assert not found.flags["disagreement"].any()  # one of them is known to be wrong
    assert found.disagreement_deg[during].min() > 5.0
    assert found.disagreement_deg[1:200].max() < 1e-6
    alone = each_row(one, replace(setup, compasses=setup.compasses[:1]))
    assert (alone.flags["disturbed"] == during).all()


def test_sensors_that_disagree_unseen_are_flagged() -> None:
    """A field that keeps magnitude and dip turns one heading: nobody can say which."""
    one, two, setup = two_sensors()
    by = Rotation.from_euler("z", 15.0, degrees=True)
    level = Rotation.from_euler(
        "ZYX", np.stack([np.zeros(len(one)), one.pitch_deg, one.roll_deg], 1), degrees=True
    )
    turned = one.with_columns(
        field=level.apply(by.apply(level.apply(one.field.copy())), inverse=True)
    )
    found = each_row([turned, two], setup)
    inside = slice(2, -2)
    assert found.disagreement_deg[inside] == pytest.approx(15.0, abs=0.1)
    assert not found.flags["disturbed"].any()
    assert found.flags["disagreement"][inside].all()
    assert set(found.flag_names()[inside]) == {"disagreement"}
    wide = each_row([turned, two], replace(setup, disagreement_limit_deg=20.0))
    assert not wide.flags["disagreement"].any()
    vague = each_row([turned, two], replace(setup, tilt_sd_deg=4.0))
    assert not vague.flags["disagreement"][inside].any()


def test_where_all_are_disturbed_the_nearest_is_taken() -> None:
    one, two, setup = two_sensors(magnet_attached(0.0, [0.0, 0.0, 20_000.0]))
    two = two.with_columns(field=two.field + np.array([0.0, 0.0, 9_000.0]))
    found = each_row([one, two], setup)
    assert found.flags["disturbed"][1:-1].all()
    assert (found.used[1:-1] == 1).all()


def test_a_sensor_with_a_pause_gives_way_too() -> None:
    one, two, setup = two_sensors()
    setup = replace(setup, compasses=setup.compasses[::-1])  # times are those of MAG2
    holes = one.select((one.time < 5.0) | (one.time > 6.0))
    found = each_row([two, holes], replace(setup, compasses=setup.compasses))
    pause = (two.time >= 5.0) & (two.time <= 6.0)
    assert np.isnan(found.disagreement_deg[pause]).all()
    assert np.isfinite(found.disagreement_deg[~pause]).all()
    assert found.trusted.all()


def test_steep_vertical_and_disturbed_rows_are_flagged() -> None:
    turn = Rotation.from_euler(
        "ZYX", [[10.0, 0.0, 0.0], [10.0, 85.0, 0.0], [10.0, 0.0, 95.0]], degrees=True
    )
    field_n = np.array([20_000.0, 0.0, 40_000.0])
    roll, pitch = np.array([0.0, 0.0, 95.0]), np.array([0.0, 85.0, 0.0])
    samples = Samples(field=turn.apply(field_n, inverse=True), roll_deg=roll, pitch_deg=pitch)
    setup = Setup(
        compasses=(Compass(calibration=plain()),),
        declination_deg=0.0,
        horizontal=20_000.0,
        vertical=40_000.0,
    )
    assert each_row(samples, setup).flags["tilted"].tolist() == [False, True, True]
    polar = Samples(field=[[1500.0, 0, 55_000.0]], roll_deg=[0.0], pitch_deg=[0.0])
    found = each_row(polar, replace(setup, horizontal=1500.0, vertical=55_000.0))
    assert [name for name, rows in found.flags.items() if rows[0]] == ["vertical field"]
    assert found.flag_names() == ["vertical field"]
    bent = Samples(field=[[20_000.0, 0, 56_000.0]], roll_deg=[0.0], pitch_deg=[0.0])
    assert each_row(bent, setup).flag_names() == ["disturbed"]


def test_declination_and_field_are_the_world_model_s_along_the_track() -> None:
    latitude, longitude = np.linspace(50.0, 54.0, 400), np.linspace(3.0, 9.0, 400)
    there = wmm().at(latitude, longitude, 2000.0, 2026.162)
    samples = Samples(
        time=np.arange(400.0) * 10,
        field=np.stack([there.horizontal, np.zeros(400), there.down], axis=1),
        roll_deg=np.zeros(400),
        pitch_deg=np.zeros(400),
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=np.full(400, 2000.0),
        epoch=datetime(2026, 3, 1, tzinfo=UTC),
    )
    found = each_row(samples, Setup(compasses=(Compass(calibration=plain()),), tilt_sd_deg=0.0))
    assert found.declination_deg == pytest.approx(there.declination_deg, abs=1e-3)
    assert found.true_deg == pytest.approx(there.declination_deg, abs=1e-3)
    assert found.sd_deg == pytest.approx(there.declination_sd_deg, rel=1e-3)
    early = samples.with_columns(epoch=datetime(1850, 1, 1, tzinfo=UTC))
    with pytest.raises(ValidityError, match=r"1900\.0"):
        each_row(early, Setup(compasses=(Compass(calibration=plain()),)))
    known = Setup(compasses=(Compass(calibration=plain()),), declination_deg=1.0)
    assert "1900.0" in " ".join(each_row(early, known).notes)


def test_declination_follows_time_and_no_jump() -> None:
    """Rows crowd before and after a pause on the way; then the log goes on somewhere else."""
    time = np.concatenate(
        [np.linspace(0, 10, 3000), np.linspace(2000, 3000, 200), 3001 + np.linspace(0, 10, 3000)]
    )
    latitude = np.where(time < 3000.5, 50.0 + time / 1000, 20.0)
    samples = Samples(
        time=time,
        field=np.tile([19_000.0, 0, 45_000.0], (len(time), 1)),
        roll_deg=np.zeros(len(time)),
        pitch_deg=np.zeros(len(time)),
        latitude_deg=latitude,
        longitude_deg=np.full(len(time), 20.0),
        epoch=datetime(2026, 3, 1, tzinfo=UTC),
    )
    found = each_row(samples, Setup(compasses=(Compass(calibration=plain()),)))
    there = wmm().at(latitude, 20.0, 0.0, 2026.162)
    assert np.ptp(there.declination_deg) > 1.0
    assert np.abs(found.declination_deg - there.declination_deg).max() < 2e-3


def test_magnitude_alone_still_finds_gross_disturbance() -> None:
    made = flight(defects=[magnet_attached(10.0, [0.0, 0.0, 30_000.0])])
    setup = replace(setup_for(replace(made.truth, magnitude=FIELD)), horizontal=None, vertical=None)
    found = each_row(made.samples, setup)
    assert not found.flags["disturbed"][:500].any()
    assert found.flags["disturbed"][500:].mean() > 0.95
    blind = each_row(
        made.samples, setup_for(replace(made.truth, magnitude=None), horizontal=None, vertical=None)
    )
    assert "disturbances of mag were not looked for" in " ".join(blind.notes)


def test_what_is_missing_is_said() -> None:
    made = flight(n=50)
    s, setup = made.samples, setup_for(made.truth)
    bare = s.with_columns(roll_deg=None, pitch_deg=None, acceleration=None)
    with pytest.raises(LogError, match="neither roll and pitch nor an accelerometer"):
        each_row(bare, setup)
    with pytest.raises(LogError, match="tilt from the log needs roll_deg"):
        each_row(bare, replace(setup, tilt="log"))
    with pytest.raises(LogError, match="no position and no date"):
        each_row(s.with_columns(latitude_deg=None), replace(setup, declination_deg=None))
    with pytest.raises(UnitError, match="in raw"):
        each_row(s.with_columns(unit="raw"), setup)
    with pytest.raises(FrameError):
        each_row(s.with_columns(frame="b"), setup)
    two = replace(setup, compasses=(*setup.compasses, Compass(calibration=plain("MAG2"))))
    with pytest.raises(LogError, match="a compass for MAG2 and the samples are of mag"):
        each_row(s, two)
    with pytest.raises(LogError, match="time column"):
        each_row(s.with_columns(time=None), setup_for(made.truth, latency_s=0.1))


def test_columns_are_as_long_as_the_log() -> None:
    made = flight(n=60)
    found = each_row(made.samples, setup_for(made.truth))
    assert len(found) == 60
    assert {len(column) for column in found.columns().values()} == {60}
    assert found.flag_names() == [""] * 60


def test_a_magnitude_that_is_another_throughout_is_said_once() -> None:
    """Scaled by a room's field, every row would be disturbed, without a reason."""
    made = flight()
    scaled = replace(made.truth, magnitude=0.88 * FIELD, matrix=0.88 * made.truth.matrix)
    found = each_row(made.samples, setup_for(scaled))
    (said,) = [note for note in found.notes if "throughout" in note]
    assert "12 % below that of the place throughout (44.0 µT for 50.0 µT)" in said
    right = each_row(made.samples, setup_for(made.truth))
    assert not any("throughout" in note for note in right.notes)
