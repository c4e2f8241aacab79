"""Headings by compass and gyro together: nearer to the truth than row by row, and told how near."""

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.headings.compute import heading
from agonic.headings.maths.gyro_heading import carry_heading, level_axes
from agonic.maths.rotations.tilt import tilt_from_angles
from agonic.samples import Samples
from agonic.simulation import simulate, with_inertial_unit
from tests.headings.flights import FIELD, each_row, off_deg, plain, setup_for, truth_of

TRACK = {"latitude_deg": None, "longitude_deg": None, "altitude_m": None}


def driven(kind: str, seed: int, **settings) -> tuple[Samples, Samples, Affine]:
    """What is true, what is logged, and a calibration that is off by what it states."""
    made = simulate(
        kind, n=2400, rate_Hz=20.0, seed=seed, noise=100.0, inclination_deg=65.0,
        declination_deg=2.0, calibration=plain(), magnitude=FIELD, **settings,
    )  # fmt: skip
    sd = np.array([150.0] * 3 + [3e-3] * 6)
    off = sd * np.random.default_rng(seed + 500).standard_normal(9)
    xx, yy, zz, xy, xz, yz = off[3:]
    matrix = np.eye(3) + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    calibration = Affine(
        bias=off[:3], matrix=matrix, covariance=np.diag(sd**2), noise=100.0, magnitude=FIELD
    )
    logged = with_inertial_unit(seed=seed + 7)(made.samples)
    return made.samples, logged.with_columns(**TRACK), calibration


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hand", "car", "flight"])
def test_it_is_nearer_than_each_row_and_says_how_near(kind) -> None:
    still = {"stray_nT_A": (0.0, 0.0, 0.0)} if kind == "flight" else {}
    smoothed, alone, z = [], [], []
    for seed in range(2):
        true, logged, calibration = driven(kind, seed, **still)
        setup = setup_for(calibration, tilt="gyro")
        rows = np.abs(true.pitch_deg) < 75.0
        both = [heading(logged, setup, smooth=smooth) for smooth in (True, False)]
        error, before = (off_deg(one.true_deg, truth_of(true))[rows] for one in both)
        smoothed.append(rms(error))
        alone.append(rms(before))
        z.append(rms(error / both[0].sd_deg[rows]))
    assert rms(np.array(smoothed)) < 0.8 * rms(np.array(alone))
    assert 0.3 < rms(np.array(z)) < 1.7


@pytest.mark.slow
def test_the_gyro_bridges_a_magnet() -> None:
    true, logged, calibration = driven("hand", 1)
    near = (true.time > 50.0) & (true.time < 65.0)
    field = logged.field + np.where(near[:, None], [30_000.0, -20_000.0, 9_000.0], 0.0)
    logged = logged.with_columns(field=field)
    setup = setup_for(calibration, tilt="gyro")
    rows = near & (np.abs(true.pitch_deg) < 75.0)
    found = heading(logged, setup, smooth=True)
    assert rms(off_deg(found.true_deg, truth_of(true))[rows]) < 2.0
    assert rms(off_deg(each_row(logged, setup).true_deg, truth_of(true))[rows]) > 20.0
    assert found.method == "smoothed with the gyro"
    assert any("the gyro bridges" in note for note in found.notes)
    assert not found.flags["disturbed"][rows].any()


def test_without_a_gyro_each_row_is_taken_by_itself() -> None:
    _, logged, calibration = driven("car", 0)
    setup = setup_for(calibration, tilt="accelerometer")
    both = [heading(logged, setup), each_row(logged, setup)]
    assert both[0].method == "each row by itself"
    assert np.array_equal(both[0].true_deg, both[1].true_deg)
    assert (
        "the gyro is not used: tilt from the accelerometer does not follow the motion"
        in both[0].notes
    )
    bare = heading(logged.with_columns(rotation_rate=None), setup)
    assert (bare.method, "gyro is not used" in " ".join(bare.notes)) == (both[0].method, False)


@pytest.mark.slow
def test_it_is_taken_where_nobody_says_and_says_why() -> None:
    _, logged, calibration = driven("hand", 0)
    found = heading(logged, setup_for(calibration, tilt="gyro"))
    assert found.method == "smoothed with the gyro"
    assert any("by itself" in note and "standard error" in note for note in found.notes)


def test_the_gyro_carries_the_heading_through_any_tilt() -> None:
    made = simulate("hand", n=1500, rate_Hz=50.0, seed=3).samples
    level = level_axes(tilt_from_angles(made.roll_deg, made.pitch_deg), "roll-pitch")
    carried = carry_heading(made.time, made.rotation_rate, level)
    turned = np.degrees(carried.heading) + made.heading_deg[0]
    assert np.abs(off_deg(turned, made.heading_deg)).max() < 0.05


def test_a_gyro_in_another_unit_or_axes_is_named_and_left_out() -> None:
    """By such rates every row's tilt was unsure, and nothing said why."""
    true, logged, calibration = driven("hand", 1)
    rows = np.abs(true.pitch_deg) < 75.0
    bare = heading(logged.with_columns(rotation_rate=None), setup_for(calibration))
    turned = np.degrees(logged.rotation_rate)[:, [1, 0, 2]] * [1, -1, 1]
    for rate, looks in ((np.degrees(logged.rotation_rate), "degrees"), (turned, "other axes")):
        wrong = logged.with_columns(rotation_rate=rate)
        found = heading(wrong, setup_for(calibration))
        assert looks in found.notes[0]
        assert "it was left out" in found.notes[0]
        assert np.array_equal(found.true_deg, bare.true_deg)
        assert rms((off_deg(found.true_deg, truth_of(true)) / found.sd_deg)[rows]) < 1.7
        with pytest.raises(ag.AgonicError, match=looks):
            heading(wrong, setup_for(calibration, tilt="gyro"))
