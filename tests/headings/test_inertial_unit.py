"""Headings beside an accelerometer of another unit, of other axes, or of the opposite sign."""

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.headings import Heading, heading
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2
from tests.headings.flights import setup_for
from tests.inertial.drives import drive

MADE, LOGGED, _ = drive("boat", n=2500, rate_Hz=25.0)
SETUP = setup_for(MADE.truth)


@pytest.fixture(scope="module")
def right() -> Heading:
    """Headings of the log as it is."""
    return heading(LOGGED, SETUP)


def of_acceleration(force: np.ndarray) -> Samples:
    return LOGGED.with_columns(acceleration=force)


def test_an_acceleration_in_g_gives_the_same_headings(right: Heading) -> None:
    """Its headings were "unsure", for it seemed to fall freely."""
    found = heading(of_acceleration(LOGGED.acceleration / STANDARD_GRAVITY_M_S2), SETUP)
    assert np.abs(found.true_deg - right.true_deg).max() < 1e-4
    assert any("it is in g" in note for note in found.notes)


def test_an_accelerometer_of_other_axes_tells_no_tilt() -> None:
    with pytest.raises(LogError, match="x and y are exchanged"):
        heading(of_acceleration(LOGGED.acceleration[:, [1, 0, 2]]), SETUP)


def test_a_tilt_from_the_log_needs_no_accelerometer() -> None:
    angles = {name: getattr(MADE.samples, name) for name in ("roll_deg", "pitch_deg")}
    wrong = of_acceleration(LOGGED.acceleration[:, [1, 0, 2]]).with_columns(**angles)
    found = heading(wrong, SETUP)
    assert found.tilt == "log"
    assert any("x and y are exchanged" in note and "left out" in note for note in found.notes)


def test_gravity_of_the_opposite_sign_is_named(right: Heading) -> None:
    found = heading(of_acceleration(-LOGGED.acceleration), SETUP)
    assert any("opposite sign" in note for note in found.notes)
    assert not found.trusted.any()
    assert not any("opposite sign" in note for note in right.notes)


def test_what_a_gyro_cannot_have_told_is_named(right: Heading) -> None:
    rate = LOGGED.rotation_rate
    most = 0.5 * np.abs(rate).max()
    clipped = LOGGED.with_columns(rotation_rate=np.clip(rate, -most, most))
    assert any("it clips" in note for note in heading(clipped, SETUP).notes)
    slow = LOGGED.with_columns(rotation_rate=rate[np.arange(len(rate)) // 10 * 10])
    assert any("one of 10 rows" in note for note in heading(slow, SETUP).notes)
    assert not any("gyro" in note and "rows only" in note for note in right.notes)
