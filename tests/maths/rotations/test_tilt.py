"""Tilt compensation against rotations built by SciPy, against vectors, and against differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from agonic.maths.rotations import tilt
from agonic.maths.rotations.angles import angle_deg

TILTS = st.floats(-80.0, 80.0)
HEADINGS = st.floats(0.0, 359.99)
DIPS = st.floats(-85.0, 85.0)


def level_field(field, found, order="roll-pitch"):
    """The field (…, 3) in level axes."""
    return np.stack(tilt._level(field, found, order)[:3], axis=-1)


def apart(a, b) -> float:
    """Degrees between two headings, the short way."""
    return float(abs((np.asarray(a) - b + 180.0) % 360.0 - 180.0))


def field_n(dip_deg: float) -> np.ndarray:
    dip = np.radians(dip_deg)
    return 50_000.0 * np.array([np.cos(dip), 0.0, np.sin(dip)])


def field_b(axes: str, angles: list[float], dip_deg: float) -> np.ndarray:
    """The field in body axes, by SciPy: intrinsic turns, the first about the vertical."""
    return Rotation.from_euler(axes, angles, degrees=True).apply(field_n(dip_deg), inverse=True)


@given(HEADINGS, TILTS, TILTS, DIPS)
def test_aerospace_order_undoes_yaw_pitch_roll(heading, pitch, roll, dip) -> None:
    field = field_b("ZYX", [heading, pitch, roll], dip)
    found = tilt.tilt_from_angles(roll, pitch)
    assert apart(tilt.heading_deg(field, found), heading) < 1e-7
    level = level_field(field, found)
    assert np.hypot(level[0], level[1]) == pytest.approx(field_n(dip)[0], rel=1e-9)
    assert level[2] == pytest.approx(field_n(dip)[2], abs=1e-6)


@given(HEADINGS, TILTS, TILTS, DIPS)
def test_inclinometer_order_undoes_yaw_roll_pitch(heading, pitch, roll, dip) -> None:
    field = field_b("ZXY", [heading, roll, pitch], dip)
    found = tilt.tilt_from_angles(roll, pitch)
    assert apart(tilt.heading_deg(field, found, "pitch-roll"), heading) < 1e-7
    nose = Rotation.from_euler("ZXY", [heading, roll, pitch], degrees=True).apply([1.0, 0.0, 0.0])
    between = np.degrees(np.arctan2(found.sin_roll * found.sin_pitch, found.cos_pitch))
    assert apart(np.degrees(np.arctan2(nose[1], nose[0])), heading + between) < 1e-7


@given(TILTS, TILTS)
def test_inclinometer_order_is_the_published_one(pitch, roll) -> None:
    x, y, z = 12_000.0, -7_000.0, 31_000.0
    rho, gamma = np.radians(pitch), np.radians(roll)
    written = [
        x * np.cos(rho) + z * np.sin(rho),
        x * np.sin(gamma) * np.sin(rho) + y * np.cos(gamma) - z * np.sin(gamma) * np.cos(rho),
        -x * np.cos(gamma) * np.sin(rho) + y * np.sin(gamma) + z * np.cos(gamma) * np.cos(rho),
    ]
    found = level_field(np.array([x, y, z]), tilt.tilt_from_angles(roll, pitch), "pitch-roll")
    assert found == pytest.approx(written, abs=1e-8)


@given(HEADINGS, TILTS, st.floats(-179.0, 179.0), DIPS)
def test_vectors_and_angles_say_the_same(heading, pitch, roll, dip) -> None:
    turn = Rotation.from_euler("ZYX", [heading, pitch, roll], degrees=True)
    field, down = turn.apply(field_n(dip), inverse=True), turn.apply([0.0, 0, 1], inverse=True)
    assert apart(tilt.heading_by_vectors_deg(field, down), heading) < 1e-7
    assert apart(tilt.heading_deg(field, tilt.tilt_from_down(5.0 * down)), heading) < 1e-7
    assert tilt.roll_pitch_deg(tilt.tilt_from_down(down)) == pytest.approx((roll, pitch), abs=1e-9)


def test_at_rest_the_accelerometer_feels_up() -> None:
    turn = Rotation.from_euler(
        "ZYX", [[40.0, 0, 0], [40, 30, 0], [40, 0, 90], [40, -20, 100]], degrees=True
    )
    down = tilt.down_from_force(turn.apply([0.0, 0.0, -9.8], inverse=True))
    roll, pitch = tilt.roll_pitch_deg(tilt.tilt_from_down(down))
    assert roll == pytest.approx([0, 0, 90, 100])
    assert pitch == pytest.approx([0, 30, 0, -20])
    assert np.isnan(tilt.down_from_force(np.zeros(3))).all()


def test_a_nose_on_end_has_a_tilt_all_the_same() -> None:
    found = tilt.tilt_from_down(np.array([-1.0, 0.0, 0.0]))
    assert [float(part) for part in found] == [0.0, 1.0, 1.0, 0.0]


def test_two_axes_in_all_quadrants() -> None:
    headings = np.arange(0.0, 360.0, 7.5)
    x, y = 3.7 * np.cos(np.radians(headings)), -3.7 * np.sin(np.radians(headings))
    assert tilt.two_axis_deg(x, y) == pytest.approx(headings, abs=1e-10)
    level = np.stack([x, y, np.full_like(x, 9.0)], axis=1)
    assert tilt.heading_deg(level, tilt.tilt_from_angles(0.0, 0.0)) == pytest.approx(
        headings, abs=1e-10
    )


@given(st.lists(st.floats(-360.0, 719.9), min_size=1, max_size=5))
def test_headings_are_from_0_up_to_360(angles) -> None:
    turned = tilt.wrap_turn_deg(np.array(angles))
    assert np.all((turned >= 0.0) & (turned < 360.0))
    assert np.abs((turned - angles + 180) % 360 - 180).max() < 1e-9


@pytest.mark.parametrize("order", ["roll-pitch", "pitch-roll"])
def test_derivatives_are_those_of_small_steps(order) -> None:
    rng = np.random.default_rng(3)
    field = 50_000.0 * rng.standard_normal((200, 3))
    roll, pitch = rng.uniform(-75, 75, (2, 200))
    found = tilt.heading_with_derivatives(field, tilt.tilt_from_angles(roll, pitch), order)
    field = field[found.horizontal > 5_000]
    roll, pitch = roll[found.horizontal > 5_000], pitch[found.horizontal > 5_000]
    found = tilt.heading_with_derivatives(field, tilt.tilt_from_angles(roll, pitch), order)

    def slope(step_b=(0.0, 0.0, 0.0), step_roll=0.0, step_pitch=0.0) -> np.ndarray:
        ends = []
        for s in (1, -1):
            tilted = tilt.tilt_from_angles(roll + s * step_roll, pitch + s * step_pitch)
            ends.append(tilt.heading_deg(field + s * np.array(step_b), tilted, order))
        return np.radians((ends[0] - ends[1] + 180) % 360 - 180) / 2

    for axis in range(3):
        assert slope(step_b=np.eye(3)[axis]) == pytest.approx(found.by_field[axis], abs=1e-9)
    small = np.degrees(1e-5)
    assert slope(step_roll=small) / 1e-5 == pytest.approx(found.by_roll, rel=1e-4, abs=1e-6)
    assert slope(step_pitch=small) / 1e-5 == pytest.approx(found.by_pitch, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("heading", [0.0, 90.0, 217.0])
def test_about_level_a_tilt_error_counts_with_the_tangent_of_the_dip(heading) -> None:
    found = tilt.heading_with_derivatives(
        field_b("ZYX", [heading, 0, 0], 65.0), tilt.tilt_from_angles(0.0, 0.0)
    )
    either = np.hypot(found.by_roll, found.by_pitch)
    assert either == pytest.approx(np.tan(np.radians(65.0)))
    assert found.by_roll == pytest.approx(either * np.cos(np.radians(heading)), abs=1e-12)


def test_a_field_straight_down_has_no_heading_and_no_crash() -> None:
    down = np.array([0.0, 0.0, 1.0])
    assert np.isfinite(tilt.heading_deg(down, tilt.tilt_from_angles(0.0, 0.0)))
    assert angle_deg(level_field(down, tilt.tilt_from_angles(10.0, 0.0)), down) == pytest.approx(
        10.0
    )
