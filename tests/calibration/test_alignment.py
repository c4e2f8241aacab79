"""`Alignment`: a rotation from one set of axes to another."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag


@pytest.mark.parametrize(
    ("axis", "reading", "expected"),
    [("z", [1, 0, 0], [0, 1, 0]), ("x", [0, 1, 0], [0, 0, 1]), ("y", [0, 0, 1], [1, 0, 0])],
)
def test_a_quarter_turn(axis: str, reading: list[float], expected: list[float]) -> None:
    alignment = ag.alignment.Alignment(rotation=Rotation.from_euler(axis, 90, degrees=True))
    assert alignment.correct(reading) == pytest.approx(expected, abs=1e-15)


def test_it_is_the_rotation_row_by_row_and_keeps_lengths_and_unit() -> None:
    rotation = Rotation.from_euler("ZYX", [30, -20, 70], degrees=True)
    alignment = ag.alignment.Alignment(
        rotation=rotation, unit_in="raw", frame_in="m", frame_out="b"
    )
    rows = np.random.default_rng(0).normal(size=(20, 3))
    assert alignment.correct(rows) == pytest.approx(rotation.apply(rows))
    assert alignment.correct(rows.reshape(4, 5, 3))[2, 3] == pytest.approx(rotation.apply(rows[13]))
    assert alignment.unit_out == "raw"
    assert alignment.equation == "field_b = rotation.apply(field_m)"
