"""Scale factors, angles and powers of T: against finite differences, draws and evaluation."""

import numpy as np
import pytest

from agonic.calibration.affine import Affine
from agonic.calibration.decomposition import decompose, decompose_at, expand_in_temperature
from agonic.calibration.thermal import Thermal
from agonic.maths.equation.affine import model_basis, split


@pytest.mark.slow
@pytest.mark.parametrize("gauge", ["symmetric", "triangular", "free"])
def test_standard_errors_are_those_of_draws(gauge: str) -> None:
    rng, basis = np.random.default_rng(3), model_basis("full", gauge)
    k = basis.shape[1]
    spread = 1e-3 * rng.normal(size=(k, k))
    centre = np.linalg.pinv(basis) @ np.concatenate([np.zeros(3), (1.5 * np.eye(3)).ravel()])
    centre[3:] += 0.05 * rng.normal(size=k - 3)
    covariance = spread @ spread.T

    def made(params: np.ndarray) -> Affine:
        bias, matrix = split(basis @ params)
        return Affine(bias=bias, matrix=matrix, covariance=covariance, gauge=gauge)

    found = decompose(made(centre))
    drawn = [decompose(made(centre + spread @ rng.normal(size=k))) for _ in range(3000)]
    assert found.scale_factors == pytest.approx(made(centre).scale_factors)
    assert found.nonorthogonality_deg == pytest.approx(made(centre).nonorthogonality_deg)
    scatter = np.std([one.scale_factors for one in drawn], axis=0)
    assert found.scale_factors_sd == pytest.approx(scatter, rel=0.06)
    scatter = np.std([one.nonorthogonality_deg for one in drawn], axis=0)
    assert found.nonorthogonality_sd_deg == pytest.approx(scatter, rel=0.06, abs=1e-9)


def warm() -> Thermal:
    rng = np.random.default_rng(4)
    spread = 1e-3 * rng.normal(size=(36, 36))
    matrices = 0.01 * rng.normal(size=(4, 3, 3))
    matrices = matrices + np.swapaxes(matrices, 1, 2)
    matrices[0] += np.eye(3)
    return Thermal(
        bias=100.0 * rng.normal(size=(4, 3)),
        matrix=matrices,
        centre_C=20.0,
        half_range_C=30.0,
        covariance=spread @ spread.T,
    )


def test_over_temperature_it_is_that_of_each_temperature() -> None:
    calibration, levels = warm(), np.array([-10.0, 20.0, 45.0])
    found = decompose_at(calibration, levels)
    for row, level in enumerate(levels):
        for ours, single in zip(found, decompose(calibration.at(level)), strict=True):
            assert ours[row] == pytest.approx(single)


def test_powers_of_the_temperature_are_the_same_curve_with_the_same_band() -> None:
    calibration = warm()
    values, sd = expand_in_temperature(calibration)
    for level in (-10.0, 0.0, 37.0):
        now = calibration.at(level)
        curve = values @ level ** np.arange(4)
        assert curve[:3] == pytest.approx(now.bias)
        assert curve[3:] == pytest.approx(now.matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
    assert sd is not None
    assert sd[:, 0] == pytest.approx(calibration.sd_at(0.0))
