"""`Affine`: what it corrects, what it says of the sensor, and its uncertainty by Monte Carlo."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import agonic as ag
from agonic.calibration.affine import PARAMETERS
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.simulation import random_calibration

SEEDS = st.integers(0, 2**32 - 1)


def sensor(
    scale: tuple[float, float, float] = (1, 1, 1),
    off_square_deg: tuple[float, float, float] = (0,) * 3,
) -> ag.Affine:
    """The calibration of a sensor whose axes have these sensitivities and these angles between.

    x is kept, y leans towards x by the first angle, z towards x and y by the others.
    """
    xy, xz, yz = np.sin(np.radians(off_square_deg))
    y = np.array([xy, np.sqrt(1 - xy**2), 0.0])
    z_y = (yz - xz * xy) / y[1]
    z = np.array([xz, z_y, np.sqrt(1 - xz**2 - z_y**2)])
    axes = np.array([[1.0, 0, 0], y, z])
    return ag.Affine(bias=[0, 0, 0], matrix=np.linalg.inv(np.diag(scale) @ axes))


@given(SEEDS)
def test_multiplied_out_is_the_same_correction(seed: int) -> None:
    rng = np.random.default_rng(seed)
    affine, raw = random_calibration(rng), 50_000 * rng.normal(size=(10, 3))
    mr, mr0 = affine.multiplied_out
    assert raw @ mr.T + mr0 == pytest.approx(affine.correct(raw), abs=1e-6)


def test_correct_takes_one_reading_and_stacks_of_them() -> None:
    affine = random_calibration(np.random.default_rng(0))
    raw = np.arange(24.0).reshape(2, 4, 3)
    assert affine.correct(raw)[1, 2] == pytest.approx(affine.correct(raw[1, 2]))
    assert affine.correct([1, 2, 3]) == pytest.approx(affine.correct(np.array([1.0, 2, 3])))


def test_scale_factors_and_angles_are_those_the_sensor_was_made_with() -> None:
    affine = sensor((0.9, 1.1, 1.3), (2.0, -3.0, 1.5))
    assert affine.scale_factors == pytest.approx([0.9, 1.1, 1.3])
    assert affine.nonorthogonality_deg == pytest.approx([2.0, -3.0, 1.5])
    square = sensor((0.9, 1.1, 1.3))
    assert square.nonorthogonality_deg == pytest.approx(np.zeros(3), abs=1e-12)


def test_uncertainty_is_that_of_many_calibrations() -> None:
    rng = np.random.default_rng(1)
    shape = rng.normal(size=(9, 9)) * np.array([60.0] * 3 + [1e-3] * 6)[:, None]
    truth = random_calibration(rng)
    affine = ag.Affine(bias=truth.bias, matrix=truth.matrix, covariance=shape @ shape.T)
    raw = 50_000 * rng.normal(size=(4, 3))
    fields = []
    for error in rng.multivariate_normal(np.zeros(9), affine.covariance, 20_000):
        xx, yy, zz, xy, xz, yz = pack_symmetric(affine.matrix) + error[3:]
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        fields.append((raw - affine.bias - error[:3]) @ matrix.T)
    found = np.array([np.cov(np.array(fields)[:, k].T) for k in range(4)])
    claimed = affine.uncertainty(raw)
    assert found == pytest.approx(claimed, rel=0.05, abs=0.03 * claimed.max())


def test_sd_goes_with_the_names_of_the_parameters() -> None:
    affine = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3), covariance=np.diag(np.arange(9.0) ** 2))
    assert dict(zip(PARAMETERS, affine.sd, strict=True))["matrix_xy"] == 6.0


def test_without_a_covariance_nothing_is_claimed() -> None:
    affine = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3))
    assert affine.sd is None
    with pytest.raises(ag.AgonicError, match="no covariance"):
        affine.uncertainty([[1.0, 2.0, 3.0]])


def test_equation_says_what_goes_in() -> None:
    affine = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3), unit_in="raw")
    assert affine.equation == "field [nT] = matrix @ (raw [counts] - bias)"
