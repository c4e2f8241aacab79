"""Scales, models and gauges: derivatives by differences, tests of models by their distribution."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from agonic.maths.equation import gauge
from agonic.maths.equation.symmetric import pack_symmetric

W = np.array([[1.1, 0.05, -0.1], [0.05, 0.9, 0.08], [-0.1, 0.08, 1.0]])
STEPS = 1e-6


def symmetric(flat: np.ndarray) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = flat
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def random_covariance(seed: int = 0) -> np.ndarray:
    shape = np.random.default_rng(seed).normal(size=(9, 9)) * 1e-3
    return shape @ shape.T


def carried(function, derivative, covariance: np.ndarray) -> np.ndarray:
    """The covariance (9, 9) that a map of the six matrix elements makes of one, by differences."""
    change = np.eye(9)
    change[3:, 3:] = derivative(function, pack_symmetric(W), STEPS)
    return change @ covariance @ change.T


def test_entries_are_listed_diagonal_first() -> None:
    assert np.array_equal(symmetric(pack_symmetric(W)), W)


def test_models_spread_to_nine_parameters() -> None:
    sphere = gauge.expand_model_covariance("sphere", np.diag([1.0, 4, 9, 16]))
    assert np.array_equal(np.diag(sphere), [1, 4, 9, 16, 16, 16, 0, 0, 0])
    assert sphere[3, 4] == 16  # one gain moves all three
    diagonal = gauge.expand_model_covariance("diagonal", np.diag([1.0, 4, 9, 16, 25, 36]))
    assert np.array_equal(diagonal, np.diag([1.0, 4, 9, 16, 25, 36, 0, 0, 0]))
    full = random_covariance()
    assert gauge.expand_model_covariance("full", full) is full


def test_scaled_changes_the_units() -> None:
    found = gauge.scale_covariance(np.eye(9), 3.0, 0.5)
    assert np.diag(found) == pytest.approx([9.0] * 3 + [0.25] * 6)


def test_mean_gain_one(derivative) -> None:
    covariance = random_covariance(1)
    matrix, spread, gain = gauge.normalise_mean_gain(2 * W, covariance)
    assert gain == pytest.approx(2.0)
    assert np.trace(matrix) == pytest.approx(3.0)
    change = np.eye(9)
    change[3:, 3:] = derivative(lambda flat: flat / flat[:3].mean(), pack_symmetric(2 * W), STEPS)
    assert spread == pytest.approx(change @ covariance @ change.T, rel=1e-6, abs=1e-14)


def test_mean_gain_one_leaves_a_sphere_no_error_of_gain() -> None:
    covariance = gauge.expand_model_covariance("sphere", np.diag([1.0, 1, 1, 1e-4]))
    matrix, spread, _ = gauge.normalise_mean_gain(1.7 * np.eye(3), covariance)
    assert matrix == pytest.approx(np.eye(3))
    assert not spread[3:, 3:].any()


def test_triangular_gauge_only_turns_the_field(derivative) -> None:
    covariance = random_covariance(2)
    upper, spread = gauge.make_triangular(W, covariance)
    assert not np.tril(upper, -1).any()
    assert (np.diag(upper) > 0).all()
    turn = upper @ np.linalg.inv(W)
    assert turn @ turn.T == pytest.approx(np.eye(3))
    assert np.linalg.det(turn) == pytest.approx(1.0)

    def by_qr(flat: np.ndarray) -> np.ndarray:
        r = np.linalg.qr(symmetric(flat))[1]
        return pack_symmetric(r * np.sign(np.diag(r))[:, None])

    assert spread == pytest.approx(carried(by_qr, derivative, covariance), rel=1e-4, abs=1e-13)


@pytest.mark.parametrize(("smaller", "freedom"), [("sphere", 5), ("diagonal", 3)])
def test_tests_reject_a_true_model_as_often_as_they_say(smaller: str, freedom: int) -> None:
    covariance = random_covariance(3)
    rng = np.random.default_rng(4)
    truth = np.eye(3) if smaller == "sphere" else np.diag([0.9, 1.0, 1.1])
    chances, statistics = [], []
    for error in rng.multivariate_normal(np.zeros(9), covariance, 1000):
        tests = gauge.compare_soft_iron_models(truth + symmetric(error[3:]), covariance)
        found = {name: (statistic, p) for name, _, statistic, p in tests}
        statistics.append(found[smaller][0])
        chances.append(found[smaller][1])
    assert np.mean(statistics) == pytest.approx(freedom, rel=0.1)
    assert kstest(chances, "uniform").pvalue > 1e-3


def test_tests_see_what_is_there() -> None:
    covariance = np.eye(9) * 1e-6
    (_, _, _, sphere), (_, _, _, diagonal) = gauge.compare_soft_iron_models(
        np.diag([1, 1, 1.02]), covariance
    )
    assert sphere < 1e-6
    assert diagonal == pytest.approx(1.0)
    turned = Rotation.from_euler("x", 45, degrees=True).as_matrix()
    cross = turned @ np.diag([1, 1, 1.02]) @ turned.T
    assert gauge.compare_soft_iron_models(cross, covariance)[1][3] < 1e-6
