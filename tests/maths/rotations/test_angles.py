"""The angle between vectors: closed forms, symmetries, small angles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agonic.maths.rotations.angles import angle_deg, wrap_deg

SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ([1, 0, 0], [0, 0, 5], 90.0),
        ([1, 2, 3], [2, 4, 6], 0.0),
        ([1, 2, 3], [-1, -2, -3], 180.0),
        ([1, 0, 0], [1, 1, 0], 45.0),
        ([0, 1, 0], [0, -1, np.sqrt(3)], 120.0),
    ],
)
def test_known_angles(a: list[float], b: list[float], expected: float) -> None:
    assert angle_deg(np.array(a, float), np.array(b, float)) == pytest.approx(expected, abs=1e-12)


@given(SEEDS, st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_order_and_lengths_do_not_matter(seed: int, k: float, m: float) -> None:
    a, b = np.random.default_rng(seed).normal(size=(2, 10, 3))
    assert angle_deg(k * a, m * b) == pytest.approx(angle_deg(b, a), abs=1e-9)


@given(st.floats(1e-12, 1e-3))
def test_small_angles_keep_all_their_digits(radians: float) -> None:
    turned = np.array([np.cos(radians), np.sin(radians), 0.0])
    assert angle_deg(np.array([3.0, 0, 0]), turned) == pytest.approx(np.degrees(radians), rel=1e-9)


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_are_the_same_direction(angle: float) -> None:
    wrapped = float(wrap_deg(angle))
    assert -180.0 <= wrapped < 180.0 or wrapped == pytest.approx(180.0)
    assert np.cos(np.radians(wrapped)) == pytest.approx(np.cos(np.radians(angle)), abs=1e-9)
    assert np.sin(np.radians(wrapped)) == pytest.approx(np.sin(np.radians(angle)), abs=1e-9)
