"""The standard twelve stations."""

from itertools import pairwise

import numpy as np
import pytest

from agonic.maths.equation.affine import magnitude_residual, model_basis
from agonic.maths.estimation.leastsq import condition
from agonic.thermal.maths import stations


def test_they_are_rotations_each_face_up_twice_a_quarter_turn_apart() -> None:
    turned = stations.list_standard_rotations()
    assert np.linalg.det(turned) == pytest.approx(np.ones(12))
    assert turned @ np.swapaxes(turned, 1, 2) == pytest.approx(np.tile(np.eye(3), (12, 1, 1)))
    faces = [stations.find_face(r, (0.0, 0.0, -1.0)) for r in turned]
    assert {face: faces.count(face) for face in faces} == dict.fromkeys(stations.FACES.values(), 2)
    for face in stations.FACES.values():
        first, second = (r for r, f in zip(turned, faces, strict=True) if f == face)
        assert np.trace(second @ first.T) == pytest.approx(1.0)  # 90° apart


def test_neighbours_are_one_quarter_turn_apart_in_words() -> None:
    turned = stations.list_standard_rotations()
    words = [stations.describe_turn(a, b) for a, b in pairwise(turned)]
    assert words == [stations.TURNS[name][2] for name in stations.SEQUENCE]
    assert stations.describe_turn(turned[0], turned[0]) == "leave it"
    assert len({stations.describe_pose(r) for r in turned}) == 12


@pytest.mark.parametrize("azimuth_deg", range(0, 90, 15))
def test_the_magnitude_determines_all_nine_whatever_the_azimuth(azimuth_deg: float) -> None:
    a, dip = np.radians(azimuth_deg), np.radians(65.0)
    field = [np.cos(dip) * np.cos(a), np.cos(dip) * np.sin(a), np.sin(dip)]
    seen = np.swapaxes(stations.list_standard_rotations(), 1, 2) @ field
    jacobian = magnitude_residual(seen, np.zeros(3), np.eye(3), 1.0)[1] @ model_basis("full")
    assert condition(jacobian.T @ jacobian) < 300.0


def test_twelve_gives_a_copy() -> None:
    stations.list_standard_rotations()[0] = 7.0
    assert stations.list_standard_rotations()[0] == pytest.approx(np.eye(3))
