"""Attitudes against SciPy's Euler angles and against quarter turns worked out by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.maths.rotations.attitude import angles_deg, down_b, rot_nb, yaw_pitch_roll

RNG = np.random.default_rng(1)
ROLL, HEADING = RNG.uniform(-180, 180, 500), RNG.uniform(0, 360, 500)
PITCH = RNG.uniform(-89.9, 89.9, 500)


def test_matrices_and_rotations_agree_with_scipy():
    scipy = Rotation.from_euler(
        "ZYX", np.stack([HEADING, PITCH, ROLL], axis=1), degrees=True
    ).as_matrix()
    np.testing.assert_allclose(rot_nb(ROLL, PITCH, HEADING), scipy, atol=1e-14)
    np.testing.assert_allclose(yaw_pitch_roll(HEADING, PITCH, ROLL).as_matrix(), scipy, atol=1e-14)


@pytest.mark.parametrize(
    ("roll", "pitch", "heading", "forward", "right", "down"),
    [
        (0, 0, 90, "east", "south", "down"),  # turned to the right
        (0, 90, 0, "up", "east", "north"),  # nose up
        (90, 0, 0, "north", "down", "west"),  # right wing down
        (90, 0, 90, "east", "down", "north"),
    ],
)
def test_quarter_turns_put_the_axes_where_they_belong(roll, pitch, heading, forward, right, down):
    towards = {"north": [1, 0, 0], "east": [0, 1, 0], "down": [0, 0, 1]}
    towards |= {"south": [-1, 0, 0], "west": [0, -1, 0], "up": [0, 0, -1]}
    wanted = np.transpose([towards[forward], towards[right], towards[down]])
    np.testing.assert_allclose(rot_nb(roll, pitch, heading), wanted, atol=1e-15)


def test_angles_come_back():
    roll, pitch, heading = angles_deg(rot_nb(ROLL, PITCH, HEADING))
    np.testing.assert_allclose(roll, ROLL, atol=1e-9)
    np.testing.assert_allclose(pitch, PITCH, atol=1e-9)
    np.testing.assert_allclose(heading, HEADING, atol=1e-9)


@pytest.mark.parametrize("pitch", [-90.0, 90.0])
def test_on_end_the_angles_still_describe_the_same_attitude(pitch):
    matrix = rot_nb(30.0, pitch, 100.0)
    np.testing.assert_allclose(rot_nb(*angles_deg(matrix)), matrix, atol=1e-9)
    assert angles_deg(matrix)[0] == 0.0


def test_down_is_what_the_body_sees_of_down_at_any_heading():
    seen = rot_nb(ROLL, PITCH, HEADING)[:, 2]
    np.testing.assert_allclose(down_b(ROLL, PITCH), seen, atol=1e-15)


def test_numbers_and_arrays_mix():
    assert rot_nb(0.0, PITCH, 10.0).shape == (500, 3, 3)
    assert down_b(0.0, PITCH).shape == (500, 3)
    assert len(yaw_pitch_roll(10.0, PITCH, 0.0)) == 500
