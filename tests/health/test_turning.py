"""Units, signs and axes that do not go together: named, and never a good verdict on a wrong fit."""

import numpy as np
import pytest

import agonic as ag
from agonic.health.turning import check_turning
from tests.inertial.drives import drive, heading_error_deg

QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
MISTAKES = {
    "in degrees a second": lambda s: {"rotation_rate": np.degrees(s.rotation_rate)},
    "in radians a second": lambda s: {"rotation_rate": np.radians(s.rotation_rate)},
    "of the opposite sign": lambda s: {"rotation_rate": -s.rotation_rate},
    "lies along −y, x, z": lambda s: {"rotation_rate": s.rotation_rate @ QUARTER.T},
    "lies along y, −x, z": lambda s: {"field": s.field @ QUARTER.T},
    "x and z are reversed": lambda s: {"field": s.field * [1, -1, 1]},
}


@pytest.mark.parametrize("looks", list(MISTAKES))
def test_a_gyro_that_turns_otherwise_is_named(looks: str) -> None:
    _, logged, _ = drive(tilt_deg=10.0, n=2000)
    found = check_turning(logged.with_columns(**MISTAKES[looks](logged)))
    assert found is not None
    assert looks in found.what


@pytest.mark.parametrize(("kind", "tilt_deg"), [("circle", 5.0), ("boat", None)])
def test_a_gyro_in_another_unit_is_named_where_it_turns_slowly_or_little(kind, tilt_deg) -> None:
    """A slow turn stands out of the noise in long means only; a bias of 57 fields would explain
    the small turns of a boat by rates that are 57 times too small."""
    _, logged, _ = drive(kind, **({} if tilt_deg is None else {"tilt_deg": tilt_deg}), n=3000)
    found = check_turning(logged.with_columns(rotation_rate=np.radians(logged.rotation_rate)))
    assert found is not None
    assert "in radians a second" in found.what


@pytest.mark.parametrize("kind", ["circle", "hand", "car", "boat", "flight", "tumble"])
def test_a_gyro_as_it_should_be_is_not(kind: str) -> None:
    for seed in range(2):
        assert check_turning(drive(kind, seed, n=2000)[1]) is None


@pytest.mark.slow
def test_calibrate_goes_back_to_the_magnitude_and_says_why() -> None:
    made, logged, place = drive(tilt_deg=10.0)
    result = ag.calibrate(logged.with_columns(rotation_rate=-logged.rotation_rate), place)
    assert result.method == "ellipsoid"
    assert result.verdict == "check"
    assert "of the opposite sign" in result.status
    assert heading_error_deg(result.fit.calibration, made, 10.0) < 2.0


def test_a_gyro_in_another_unit_tells_no_delay() -> None:
    """Beside a gyro named in radians a second that is in degrees, a delay of a second fits best."""
    made, logged, _ = drive("hand", n=2000)
    wrong = logged.with_columns(rotation_rate=np.degrees(logged.rotation_rate))
    result = ag.calibrate(wrong)
    assert result.verdict == "check"
    assert "in degrees a second; it was left out" in result.status
    assert result.calibration.latency_s == 0.0
    sd = ag.calibrate(logged.with_columns(rotation_rate=None)).fit.coverage.heading_sd_deg
    assert result.fit.coverage.heading_sd_deg == pytest.approx(sd)
    beside = ag.calibrate(wrong, ag.Reference.vector(made.field_n, frame="n"))
    assert [one.name for one in beside.fit.findings if one.severity != "note"] == ["inertial unit"]
    with pytest.raises(ag.AgonicError, match="in degrees a second"):
        ag.fit_latency(wrong)
