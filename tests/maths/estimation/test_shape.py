"""A parameter of the shape of a term."""

import numpy as np

from agonic.maths.estimation.inference import find_move


def test_a_covariance_that_rounding_left_indefinite_gives_no_complex_error() -> None:
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    covariance = axes @ np.diag([1.0, 1.0, -1e-18]) @ axes.T
    moved, sd = find_move(axes[:, 2], np.ones(3), covariance)
    assert np.isfinite(moved)
    assert sd > 0.0


def test_terms_of_nothing_leave_everything_open() -> None:
    assert find_move(np.zeros(2), np.ones(2), np.eye(2)) == (0.0, float("inf"))
