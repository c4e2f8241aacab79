"""The turn to make next: what it is worth, which way it goes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.live.maths import next_turn
from agonic.maths.equation.affine import correction_jacobian, model_basis
from agonic.maths.equation.coverage import heading_sd_deg

BIAS, MATRIX = np.array([0.2, -0.1, 0.05]), np.diag([1.02, 0.97, 1.01])
RNG = np.random.default_rng(4)
ROOT = RNG.normal(size=(9, 9)) * 0.01
COVARIANCE = ROOT @ ROOT.T


def test_the_gradient_gives_the_heading_s_standard_error():
    g = next_turn.compute_heading_gradient(65.0, BIAS, MATRIX)
    sd = np.degrees(np.sqrt(np.trace(COVARIANCE @ g)))
    assert sd == pytest.approx(heading_sd_deg(65.0, 1.0, MATRIX, COVARIANCE, "symmetric"), rel=1e-9)


def test_gains_are_those_of_a_new_inversion():
    present, *targets = RNG.normal(size=(21, 3))
    targets = np.array(targets) / np.linalg.norm(targets, axis=1, keepdims=True)
    along, lengths = next_turn.draw_great_circles(present / np.linalg.norm(present), targets, 5)
    np.testing.assert_allclose(along[:, -1], targets, atol=1e-12)
    readings = 3 * lengths
    promised = next_turn.compute_gains(along, BIAS, MATRIX, COVARIANCE, 0.004, 65.0, readings)
    g = next_turn.compute_heading_gradient(65.0, BIAS, MATRIX)
    sd = 0.004 * np.trace(MATRIX) / 3
    for way, k, gain in zip(along, readings, promised, strict=True):
        jacobian = correction_jacobian(way @ np.linalg.inv(MATRIX).T + BIAS, BIAS, MATRIX)
        j = np.einsum("ni,nij->nj", way, jacobian @ model_basis("full"))
        after = np.linalg.inv(np.linalg.inv(COVARIANCE) + k * j.T @ j / sd**2)
        assert gain == pytest.approx(np.trace((COVARIANCE - after) @ g), rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_the_turn_brings_the_field_there(seed):
    present, wanted = np.random.default_rng(seed).normal(size=(2, 3))
    turn = next_turn.find_turn(present, wanted)
    # a body turned by R sees a fixed field turned by the inverse of R
    seen = Rotation.from_rotvec(turn).inv().apply(present / np.linalg.norm(present))
    np.testing.assert_allclose(seen, wanted / np.linalg.norm(wanted), atol=1e-12)


def test_the_opposite_direction_is_half_a_turn_away():
    turn = next_turn.find_turn(np.array([0, 0, 1.0]), np.array([0, 0, -1.0]))
    assert np.linalg.norm(turn) == pytest.approx(np.pi)
    assert not next_turn.find_turn(np.array([0, 0, 2.0]), np.array([0, 0, 1.0])).any()


@pytest.mark.parametrize(
    ("present", "wanted", "said"),
    [
        ([1, 0, 0], [0, 0, 1], "nose up 90°"),  # what lay ahead is now below
        ([0, 1, 0], [0, 0, 1], "roll left 90°"),  # what lay to the right is now below: left up
        ([1, 0, 0], [0, -1, 0], "turn right 90°"),  # what lay ahead is now to the left
        ([1, 0, 0], [1, 0.1, 0], "hold still"),
    ],
)
def test_words(present, wanted, said):
    turn = next_turn.find_turn(np.array(present, float), np.array(wanted, float))
    assert next_turn.describe_turn(turn) == said
