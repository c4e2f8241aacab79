"""`Coverage`: what was visited, what that leaves open, and which turns to add."""

import numpy as np
import pytest

from agonic.calibration.affine import Affine
from agonic.coverage import Coverage, compute_coverage, describe_missing_orientations
from agonic.maths.equation.coverage import icosphere

ALL_SEEN = np.full(80, 10)


def cover(cells, covariance: np.ndarray, *, gain: float = 1.0, inclination_deg=60.0) -> Coverage:
    """The coverage of a calibration without bias."""
    made = Affine(
        bias=np.zeros(3), matrix=gain * np.eye(3), covariance=covariance, magnitude=50_000.0
    )
    return compute_coverage(made, cells, inclination_deg)


def test_an_error_of_the_bias_is_the_same_in_all_directions() -> None:
    covariance = np.diag([9.0] * 3 + [0.0] * 6)
    found = cover(ALL_SEEN, covariance, gain=2.0)
    assert found.filled == 1.0
    assert found.field_sd == pytest.approx(np.full(80, 6.0))
    assert found.field_sd_max == pytest.approx(6.0)
    assert found.heading_sd_deg == pytest.approx(np.degrees(6.0 / 25_000.0))
    assert found.turns == ""


def test_an_error_of_one_gain_shows_along_its_axis() -> None:
    covariance = np.zeros((9, 9))
    covariance[5, 5] = 1e-6  # matrix_zz
    found = cover(ALL_SEEN, covariance)
    assert found.field_sd == pytest.approx(50.0 * np.abs(icosphere()[0][:, 2]))
    assert found.heading_sd_deg == pytest.approx(0.0, abs=1e-9)


def test_heading_suffers_where_the_field_is_steep() -> None:
    covariance = np.diag([9.0] * 3 + [0.0] * 6)
    flat, steep = (cover(ALL_SEEN, covariance, inclination_deg=dip) for dip in (0.0, 80.0))
    ratio = np.cos(np.radians(80))
    assert flat.heading_sd_deg == pytest.approx(ratio * steep.heading_sd_deg)


def test_what_was_not_seen_is_to_be_turned_to() -> None:
    upper = np.where(icosphere()[0][:, 2] > 0, 5, 0)
    found = cover(upper, np.eye(9))
    assert found.filled == pytest.approx(0.5, abs=0.05)
    assert "points along −z (field never within 40° of it)" in found.turns


def test_turns_in_words() -> None:
    assert describe_missing_orientations(["+x", "−x", "+z"]).endswith(
        "along +x, −x and +z (field never within 40° of them)"
    )
