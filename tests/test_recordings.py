"""Real recordings: each opens and gets a verdict, and those that are known get the right one."""

import re
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.tilt import heading_by_vectors_deg

pytestmark = pytest.mark.recordings

KNOWN = [
    "vehicle/ardupilot/center_0003.bin",
    "vehicle/ardupilot/log171.bin",
    "vehicle/ardusub/small.BIN",
    "vehicle/ardusub/small.tlog",
    "vehicle/broad/02_undisturbed_slow_rotation_B.mat",
    "vehicle/broad/05_undisturbed_slow_rotation_with_breaks_B.mat",
    "vehicle/broad/07_undisturbed_fast_rotation_B.mat",
    "vehicle/broad/12_undisturbed_slow_translation_C.mat",
    "vehicle/broad/28_disturbed_stationary_magnet_A.mat",
    "vehicle/broad/32_disturbed_attached_magnet_1cm.mat",
    "vehicle/broad/34_disturbed_attached_magnet_3cm.mat",
    "vehicle/fusion/sensor_data.csv",
    "vehicle/px4/sample.ulg",
    "vehicle/px4/sample_log_small.ulg",
    "pointclouds/aleksandrbazhin_mag_out.txt",
]


@pytest.fixture(scope="session")
def calibrated(recordings: Path) -> dict[str, list[ag.Calibrated]]:
    """What `calibrate` makes of every sensor of every recording, by the recording's path."""

    class OnceAsked(dict[str, list[ag.Calibrated]]):
        def __missing__(self, name: str) -> list[ag.Calibrated]:
            log = ag.open_log(recordings / name)
            self[name] = [ag.calibrate(sensor) for sensor in log.sensors]
            return self[name]

    return OnceAsked()


def names(results: list[ag.Calibrated]) -> dict[str, str]:
    return {finding.name: finding.severity for r in results for finding in r.fit.findings}


def check_verdicts(results: list[ag.Calibrated]) -> None:
    assert results
    for result in results:
        assert result.verdict in ("good", "check", "refused")
        assert result.status
        grave = [f for f in result.fit.findings if f.severity != "note"]
        assert all(finding.move for finding in grave)
        if result.verdict == "refused":
            assert "refuse" in {finding.severity for finding in grave}
        assert np.isfinite(result.fit.sd).all()
        assert np.isfinite(result.verification.spread_after)


def test_no_recording_is_forgotten(recordings: Path, calibrated) -> None:
    """Nor those that are in the folder besides."""
    there = {
        path.relative_to(recordings).as_posix()
        for folder in ("vehicle", "pointclouds")
        for path in (recordings / folder).rglob("*")
        if path.is_file()
    }
    assert there >= set(KNOWN)
    for name in sorted(there - set(KNOWN)):
        check_verdicts(calibrated[name])


SLOW = ("sensor_data.csv", "small.tlog")  # they take their time


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] if n.endswith(SLOW) else []) for n in KNOWN],
)
def test_every_sensor_gets_a_verdict_with_reasons(calibrated, name: str) -> None:
    check_verdicts(calibrated[name])


@pytest.mark.parametrize("number", ["02", "07"])
def test_undisturbed_rotations_in_a_room_are_not_refused(calibrated, number: str) -> None:
    name = next(name for name in KNOWN if f"broad/{number}_" in name)
    (result,) = calibrated[name]
    assert result.verdict != "refused"
    assert "field changed" not in names([result])


def test_a_translation_is_refused(calibrated) -> None:
    found = names(calibrated["vehicle/broad/12_undisturbed_slow_translation_C.mat"])
    (result,) = calibrated["vehicle/broad/12_undisturbed_slow_translation_C.mat"]
    assert result.verdict == "refused"
    assert found["few orientations"] in {"check", "refuse"}
    assert "field changed" not in found


@pytest.mark.parametrize(("number", "on_s", "off_s"), [("32", 38.0, 95.2), ("34", 44.8, 99.6)])
def test_a_magnet_attached_and_taken_off_is_named_and_the_rest_calibrated(
    calibrated, number: str, on_s: float, off_s: float
) -> None:
    """When it was there, by the optical orientation and the field of the room.

    Without the magnet the sensor's own bias is some 500 nT and its axes are square to 2 %; it lay
    still before it came.
    """
    name = next(name for name in KNOWN if f"broad/{number}_" in name)
    (result,) = calibrated[name]
    assert result.verdict == "check"
    finding = result.fit.findings[0]
    assert (finding.name, finding.severity) == ("field changed", "check")
    assert finding.moments == pytest.approx([on_s, off_s], abs=1.0)
    on, off = finding.moments
    time = result.samples.time
    assert f"from t = {off:.1f} s" in finding.what.partition("hold only for the stretch")[2]
    assert not ((on < time) & (time < off)).any()
    assert time[time > off][0] < off + 3.0
    assert np.linalg.norm(result.calibration.bias) < 2500
    assert (abs(result.calibration.bias) < 3 * result.fit.sd[:3]).all()


def test_a_magnet_that_is_passed_is_named_with_its_times(calibrated) -> None:
    """By the optical orientation from 34.1 s to 38.6 s and from 143.7 s to 146.7 s."""
    (result,) = calibrated["vehicle/broad/28_disturbed_stationary_magnet_A.mat"]
    (finding,) = [f for f in result.fit.findings if f.name == "outliers"]
    assert "a heading at those times is wrong" in finding.what
    said = [float(number) for number in re.findall(r"([\d.]+) s\b", finding.what)]
    assert said == pytest.approx([34.1, 38.6, 143.7, 146.7], abs=1.0)


@pytest.mark.parametrize(
    ("name", "finding"),
    [
        ("vehicle/ardusub/small.BIN", "static"),
        ("vehicle/px4/sample.ulg", "prior"),
        ("vehicle/px4/sample_log_small.ulg", "too few readings"),
        ("vehicle/ardupilot/center_0003.bin", "small tilt"),
    ],
)
def test_logs_that_hardly_turn_are_refused_for_that(calibrated, name: str, finding: str) -> None:
    for result in calibrated[name]:
        whole = result.samples.name.startswith("vehicle_")  # 319 readings beside 6 raw ones
        assert names([result])["static" if whole else finding] == "refuse"


@pytest.mark.parametrize("part", [(0.0, 0.33), (0.25, 0.75), (0.0, 0.5)])
def test_a_part_of_a_log_whose_fit_makes_it_worse_is_refused(recordings, part) -> None:
    """The vehicle hardly turned; gains of 10 to 20 were checks at 9° to 31°, off by 17° to 30°."""
    samples = ag.read(recordings / "vehicle/px4/sample_log_small.ulg", sensor=0)
    first, last = (int(share * len(samples)) for share in part)
    some = samples.select(np.arange(first, last))
    assert ag.calibrate(some, ag.igrf().along(some)).verdict == "refused"


def test_a_motor_field_is_named_in_the_compass_beside_it(calibrated) -> None:
    results = calibrated["vehicle/ardupilot/log171.bin"]
    assert [r.samples.name for r in results] == ["MAG", "MAG2", "MAG3"]
    named = {one.partition("^")[0] for one in results[1].disturbers.sources}
    assert named >= {f"output{k}_duty" for k in (1, 2, 3, 4)}
    assert results[1].verdict != "good"


@pytest.mark.slow
def test_a_poor_swing_does_not_determine_an_ellipsoid(calibrated) -> None:
    (result,) = calibrated["vehicle/fusion/sensor_data.csv"]
    assert result.verdict != "good"


def test_spreads_of_the_point_cloud(recordings: Path, calibrated) -> None:
    cloud = ag.read(recordings / "pointclouds" / "aleksandrbazhin_mag_out.txt")
    assert (len(cloud), cloud.unit) == (347, "raw")

    def spread(field: np.ndarray) -> float:
        size = np.linalg.norm(field, axis=1)
        return float(100 * size.std() / size.mean())

    assert spread(cloud.field) == pytest.approx(36.8, rel=0.1)
    for model, expected in (("sphere", 4.25), ("diagonal", 3.42), ("full", 2.06)):
        fit = ag.fit_ellipsoid(cloud, model=model)
        assert spread(fit.calibration.correct(cloud.field)) == pytest.approx(expected, rel=0.1)
    (result,) = calibrated["pointclouds/aleksandrbazhin_mag_out.txt"]
    assert result.verdict == "good"
    assert result.fit.calibration.model == "full"


def test_a_car_in_circles_is_no_sphere_about_their_centre(recordings: Path) -> None:
    """It is level and its iron halves the field along the road. A circle of readings is a sphere of
    its own, five times too small, in which the field never dips; its gyro tells how it turned."""
    whole = ag.read(recordings / "ros" / "data_going_in_circles.csv")
    car = whole.select(whole.time > 55)
    fit = ag.fit_levelled(car, ag.igrf().along(car))
    assert 1.5 < np.trace(fit.calibration.matrix) / 3 < 2.5
    down = down_b(car.roll_deg, car.pitch_deg)
    heading = heading_by_vectors_deg(fit.calibration.correct(car.field), down)
    rate = np.sum(car.rotation_rate * down, axis=1)
    turned = np.r_[0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(car.time))]
    left = np.unwrap(np.radians(heading)) - turned
    left -= np.polyval(np.polyfit(car.time, left, 1), car.time)
    assert np.degrees(np.std(left)) < 8.0
