"""Rotation and symmetric part of a matrix, and their covariances, against finite differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.maths.equation import gauge as gauges
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.rotations.polar import split_rotation

SYMMETRIC = np.array([[1.1, 0.02, -0.03], [0.02, 0.95, 0.01], [-0.03, 0.01, 1.02]])
TURN = Rotation.from_rotvec([0.2, -0.1, 0.3])


def spread(seed: int, m: int) -> np.ndarray:
    root = np.random.default_rng(seed).standard_normal((m, m)) * ([10.0] * 3 + [1e-4] * (m - 3))
    return root.T @ root


def test_the_parts_give_the_matrix() -> None:
    six, rest = split_rotation(TURN.as_matrix() @ SYMMETRIC, None, "free")
    assert unpack_symmetric(six) == pytest.approx(SYMMETRIC, abs=1e-12)
    assert rest.rotation == pytest.approx(TURN.as_matrix(), abs=1e-12)


def test_a_symmetric_matrix_is_taken_as_it_is() -> None:
    covariance = spread(0, 9)
    _, rest = split_rotation(SYMMETRIC, covariance, "symmetric")
    assert rest.covariance[:9, :9] == pytest.approx(covariance, rel=1e-9, abs=1e-15)
    assert rest.covariance[9:, 9:] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize("gauge", ["triangular", "free"])
def test_the_covariance_is_that_of_many_draws(gauge: str) -> None:
    m = 12 if gauge == "free" else 9
    covariance = spread(1, m)
    matrix = TURN.as_matrix() @ SYMMETRIC
    if gauge == "triangular":
        matrix, _ = gauges.make_triangular(SYMMETRIC, np.eye(9))
    six, rest = split_rotation(matrix, covariance, gauge)
    rows, columns = [0, 1, 2, 0, 0, 1, 1, 2, 2], [0, 1, 2, 1, 2, 2, 0, 0, 1]
    drawn = np.random.default_rng(2).multivariate_normal(np.zeros(m), covariance, 4000)
    found = []
    for change in drawn:
        moved = matrix.copy()
        moved[rows[: m - 3], columns[: m - 3]] += change[3:]
        found.append(split_rotation(moved, None, gauge)[0] - six)
    assert np.cov(np.array(found).T) == pytest.approx(
        rest.covariance[3:9, 3:9], abs=0.08 * rest.covariance[3:9, 3:9].max()
    )


def test_free_goes_back() -> None:
    covariance = spread(3, 12)
    matrix = TURN.as_matrix() @ SYMMETRIC
    six, rest = split_rotation(matrix, covariance, "free")
    back, again = rest.free(unpack_symmetric(six), rest.covariance[:9, :9])
    assert back == pytest.approx(matrix)
    # only the correlation of the rotation with the rest is given up
    kept = rest.covariance.copy()
    kept[:9, 9:] = kept[9:, :9] = 0.0
    _, same = split_rotation(back, again, "free")
    assert same.covariance == pytest.approx(kept, rel=1e-6, abs=1e-9 * kept.max())
