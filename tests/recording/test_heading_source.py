"""`calibrate` with headings of other origin: used where right, found out where wrong."""

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.heading_source import with_course
from agonic.maths.rotations import tilt as kernel
from agonic.simulation import simulate

LEVEL_DEG = 12.0


def drive(seed: int = 0) -> tuple[ag.Samples, ag.Reference, object]:
    """Circles over a ramp with roll, pitch and heading, and the field of the place."""
    made = simulate("circle", n=3000, tilt_deg=LEVEL_DEG, inclination_deg=65.0, seed=seed)
    place = ag.Reference.vector(made.field_n, frame="n")
    return made.samples.with_columns(frame="b"), place, made.truth


def noisy(samples: ag.Samples, sd_deg: float, seed: int = 1, **columns) -> ag.Samples:
    off = sd_deg * np.random.default_rng(seed).standard_normal(len(samples))
    heading = (samples.heading_deg + off) % 360
    given = {"heading_sd_deg": np.full(len(samples), sd_deg), "heading_source": "GPS yaw"}
    return samples.with_columns(heading_deg=heading, **{**given, **columns})


def test_a_heading_by_gps_is_used_and_named() -> None:
    samples, place, truth = drive()
    found = ag.calibrate(noisy(samples, 1.0), place)
    assert found.method == "vector"
    assert "the heading comes from GPS yaw" in found.reason
    off = found.fit.calibration.bias - truth.bias
    assert np.abs(off / found.fit.sd[:3]).max() < 4


def test_rows_without_a_known_heading_do_no_harm() -> None:
    sd = np.where(np.arange(3000) < 1000, 180.0, 1.0)
    z = []
    for seed in range(4):
        samples, place, truth = drive(seed)
        wild = np.where(np.arange(3000) < 1000, 90.0, samples.heading_deg)
        fit = ag.fit_vector(
            noisy(samples.with_columns(heading_deg=wild), 1.0, seed, heading_sd_deg=sd), place
        )
        z.append((fit.calibration.bias - truth.bias) / fit.sd[:3])
    assert np.sqrt(np.mean(np.square(z))) < 1.6


def test_calibrate_leaves_out_what_came_before_a_source_had_settled() -> None:
    samples, place, truth = drive()
    early = np.arange(3000) < 900
    logged = samples.with_columns(heading_deg=np.where(early, 10.0, samples.heading_deg))
    found = ag.calibrate(noisy(logged, 1.0, heading_sd_deg=np.where(early, 180.0, 1.0)), place)
    assert found.method == "vector"
    assert found.verdict != "refused"
    assert np.abs((found.fit.calibration.bias - truth.bias) / found.fit.sd[:3]).max() < 4


@pytest.mark.slow
def test_worse_headings_count_less() -> None:
    """A third of the headings with eight times the error, by their own account."""
    worse, weighed = [], []
    for seed in range(6):
        samples, place, truth = drive(seed)
        sd = np.where(np.arange(3000) % 3 == 0, 8.0, 1.0)
        off = sd * np.random.default_rng(seed).standard_normal(3000)
        given = samples.with_columns(heading_deg=(samples.heading_deg + off) % 360)
        told = given.with_columns(heading_sd_deg=sd, heading_source="GPS yaw")
        for one, into in ((given, worse), (told, weighed)):
            fit = ag.fit_vector(one, place, gauge="free", turn_sd_deg=None)
            turn = fit.calibration.matrix @ np.linalg.inv(truth.matrix)
            into.append((turn[0, 1] - turn[1, 0]) / 2)
    assert np.std(weighed) < np.std(worse)


@pytest.mark.slow
def test_a_heading_that_follows_the_magnetometer_is_found_out() -> None:
    samples, place, truth = drive()
    tilt = kernel.tilt_from_angles(samples.roll_deg, samples.pitch_deg)
    follows = kernel.heading_deg(samples.field, tilt)
    wrong = samples.with_columns(heading_deg=follows, heading_source="EKF yaw")
    found = ag.calibrate(wrong, place)
    assert found.method == "levelled"
    names = [finding.name for finding in found.fit.findings]
    assert "heading follows the magnetometer" in names
    assert "EKF yaw follows" in found.fit.status
    assert np.abs((found.fit.calibration.bias - truth.bias) / found.fit.sd[:3]).max() < 4
    asked = ag.calibrate(wrong, place, kind="vector")
    assert asked.fit.verdict == "refused"


def test_a_heading_that_has_not_settled_is_found_out_by_the_gyro() -> None:
    samples, place, _ = drive()
    time = samples.time
    wander = 60.0 * np.sin(2 * np.pi * time / 15.0)
    wrong = noisy(samples.with_columns(heading_deg=(samples.heading_deg + wander) % 360), 2.0)
    assert samples.rotation_rate is not None
    found = ag.calibrate(wrong, place)
    assert found.method == "levelled"
    assert "heading against the gyro" in [finding.name for finding in found.fit.findings]


def test_the_course_of_a_car_is_its_heading() -> None:
    samples, place, _ = drive()
    heading = np.radians(samples.heading_deg)
    steps = np.diff(samples.time, prepend=samples.time[0])
    north, east = (np.cumsum(4.0 * part * steps) for part in (np.cos(heading), np.sin(heading)))
    rng = np.random.default_rng(3)
    moved = samples.with_columns(
        heading_deg=None,
        latitude_deg=45.0 + np.degrees((north + 0.02 * rng.standard_normal(3000)) / 6378137.0),
        longitude_deg=np.degrees(east / 6378137.0 / np.cos(np.radians(45.0))),
    )
    driven = with_course(moved)
    apart = (driven.heading_deg - samples.heading_deg + 180) % 360 - 180
    known = driven.heading_sd_deg < 20
    assert known.mean() > 0.95
    assert np.sqrt(np.mean((apart[known] / driven.heading_sd_deg[known]) ** 2)) < 1.2
    found = ag.calibrate(driven, place)
    assert "the heading comes from the course over ground" in found.reason


def test_what_stands_still_has_no_course() -> None:
    samples, _, _ = drive()
    still = samples.with_columns(latitude_deg=np.full(3000, 45.0), longitude_deg=np.zeros(3000))
    with pytest.raises(ag.LogError, match="never moved"):
        with_course(still)
    with pytest.raises(ag.LogError, match="needs times and positions"):
        with_course(samples)
