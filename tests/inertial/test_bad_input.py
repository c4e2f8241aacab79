"""Sensors that are slow, clipped, late or of the opposite sign: handled or named."""

import numpy as np
import pytest

import agonic as ag
from agonic.recording.choice.choose import choose
from tests.inertial.drives import drive, heading_error_deg
from tests.live import rover


def hold(values, rows):
    """Each reading repeated for so many rows."""
    return values[np.arange(len(values)) // rows * rows]


def clip(values, share):
    """Readings held within a share of the largest."""
    limit = share * np.abs(values).max()
    return np.clip(values, -limit, limit)


HANDLED = {
    "acceleration and rates ten times slower": lambda s: {
        "acceleration": hold(s.acceleration, 10),
        "rotation_rate": hold(s.rotation_rate, 10),
    },
    "readings ten times slower": lambda s: {"field": hold(s.field, 10)},
    "a gyro that clips": lambda s: {"rotation_rate": clip(s.rotation_rate, 0.5)},
}


@pytest.mark.slow
@pytest.mark.parametrize("what", list(HANDLED))
def test_slow_and_clipped_sensors_are_handled(what: str) -> None:
    made, logged, place = drive(tilt_deg=10.0, n=2000)
    fit = ag.fit_inertial(logged.with_columns(**HANDLED[what](logged)), place)
    error = heading_error_deg(fit.calibration, made, 10.0)
    assert error < 1.5
    assert (np.abs(fit.calibration.bias - made.truth.bias) < 4 * fit.sd[:3]).all()


@pytest.mark.slow
def test_clocks_that_differ_are_brought_together() -> None:
    """A second was beyond the search once, and the gyro was blamed for it."""
    for late_s in (0.1, 1.0):
        made, logged, place = drive(tilt_deg=10.0, n=2000, unit={"late_s": late_s})
        fit = ag.fit_inertial(logged, place)
        assert heading_error_deg(fit.calibration, made, 10.0) < 1.5
        found = fit.calibration
        assert abs(found.latency_s + late_s) < 4 * found.latency_sd_s
        assert not any(finding.name == "heading" for finding in fit.findings)


def test_a_gyro_that_clips_in_every_turn_of_a_rover_is_named() -> None:
    ramp = (rover.stand(0, pitch=5.0), rover.stand(0, roll=-5.0))
    driven = rover.drive(rover.turn(0, 720), rover.stand(0, seconds=10), *ramp)
    clipped = driven.with_columns(rotation_rate=clip(driven.rotation_rate, 0.4))
    result = ag.calibrate(clipped, rover.PLACE)
    assert result.verdict != "good"
    assert "it clips" in result.fit.status
    assert (np.abs(result.fit.calibration.bias - rover.BIAS) < 4 * result.fit.sd[:3]).all()


@pytest.mark.parametrize("column", ["field", "acceleration"])
def test_a_field_that_dips_towards_the_sky_is_not_good(column: str) -> None:
    """The magnitude of a tumbled sensor tells nothing of its sign, nor of that of gravity."""
    _, logged, place = drive("tumble", n=1000, rate_Hz=25.0)
    assert ag.calibrate(logged, place).verdict == "good"
    reversed_ = logged.with_columns(**{column: -getattr(logged, column)})
    result = ag.calibrate(reversed_, place)
    assert result.verdict == "check"
    assert "seems to dip by -65° where it should by 65°" in result.status


@pytest.mark.slow
def test_acceleration_of_the_opposite_sign_is_named() -> None:
    _, logged, place = drive(tilt_deg=10.0, n=2000)
    fit = ag.fit_inertial(logged.with_columns(acceleration=-logged.acceleration), place)
    assert fit.verdict == "refused"
    named = [finding.what for finding in fit.findings if finding.name == "inertial unit"]
    assert len(named) == 1
    assert "opposite sign" in named[0]


@pytest.mark.slow
def test_sensors_that_no_attitude_fits_are_refused_and_named() -> None:
    """The joint estimate has no minimum there: its steps leave every possible calibration."""
    _, logged, place = drive("boat", n=800)
    fit = ag.fit_inertial(logged.with_columns(acceleration=-logged.acceleration), place)
    assert fit.verdict == "refused"
    assert "no attitude fits all three; check their units, signs" in fit.status


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda s: {"rotation_rate": np.degrees(s.rotation_rate)}, "in degrees a second"),
        (lambda s: {"acceleration": -s.acceleration}, "the acceleration has the opposite sign"),
    ],
)
def test_what_was_recorded_wrongly_is_named_where_the_magnitude_alone_is_refused_too(
    wrong, named: str
) -> None:
    _, logged, place = drive(tilt_deg=5.0, n=1000)
    chosen = choose(logged.with_columns(**wrong(logged)), place, "auto", {})
    assert chosen.fit.verdict == "refused"
    assert named in chosen.fit.status


@pytest.mark.slow
def test_a_log_whose_attitudes_nothing_holds_is_refused_in_words(recordings) -> None:
    """Turned by hand; acceleration and rates do not go with the readings of such a field."""
    (logged,) = ag.open_log(recordings / "ros/sparkfun_razor.bag").sensors
    size = float(np.median(np.linalg.norm(logged.field, axis=1)))
    field = np.array([18_000.0, 500.0, 46_000.0])
    place = ag.Reference.vector(size * field / np.linalg.norm(field), frame="n")
    fit = ag.fit_inertial(logged, place)
    assert fit.verdict == "refused"
    assert fit.status.startswith("All readings have exactly the same length")
    for kind in ("inertial", "auto"):  # readings of one length are the cause of it all
        made = ag.calibrate(logged, place, kind=kind)
        assert made.verdict == "refused"
        assert "exactly the same length" in made.status
