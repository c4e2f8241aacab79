"""The numbers of a calibration and the standard errors of what follows from them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.recording.quantities import list_quantities, list_views, propagate_sd, turn_deg
from tests.recording.handmade import BIAS, MATRIX


@pytest.mark.parametrize(
    "view", [lambda c: c.scale_factors, lambda c: c.nonorthogonality_deg], ids=["scale", "angle"]
)
def test_propagated_standard_errors_are_the_scatter_of_many_draws(good, view):
    fit = good.fit
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(9), fit.covariance, 4000)
    values = []
    for xx, yy, zz, xy, xz, yz in draws[:, 3:]:
        error = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        values.append(view(Affine(bias=BIAS, matrix=MATRIX + error)))
    scatter = np.std(values, axis=0)
    np.testing.assert_allclose(propagate_sd(fit.calibration, view), scatter, rtol=0.06)


@pytest.mark.slow
def test_the_turn_of_a_sensor_has_the_scatter_of_many_draws(good):
    turn = Rotation.from_rotvec([0.03, -0.05, 0.2]).as_matrix()
    rng = np.random.default_rng(1)
    spread = np.diag([100.0] * 3 + list(rng.uniform(1e-3, 4e-3, 9) ** 2))
    calibration = Affine(bias=BIAS, matrix=turn @ MATRIX, covariance=spread, gauge="free")
    order = ([0, 1, 2, 0, 0, 1, 1, 2, 2], [0, 1, 2, 1, 2, 2, 0, 0, 1])
    drawn = []
    for by in rng.multivariate_normal(np.zeros(9), spread[3:, 3:], 3000):
        matrix = calibration.matrix.copy()
        matrix[order] += by
        drawn.append(turn_deg(replace(calibration, matrix=matrix)))
    assert np.mean(drawn, axis=0) == pytest.approx(np.degrees([0.03, -0.05, 0.2]), abs=0.02)
    np.testing.assert_allclose(
        propagate_sd(calibration, turn_deg), np.std(drawn, axis=0), rtol=0.06
    )
    freed = replace(good, fit=replace(good.fit, calibration=calibration))
    assert [q.name for q in list_views(freed)[-1].rows] == ["x", "y", "z"]


def test_numbers_stand_beside_those_of_the_log(logged):
    groups = {group.name: group for group in [*list_quantities(logged), *list_views(logged)]}
    assert [q.value - q.logged for q in groups["Bias"].rows] == pytest.approx([-250, 90, -40])
    assert [q.logged for q in groups["Scale factor"].rows] == pytest.approx([1, 1, 1])
    assert [q.logged for q in groups["Non-orthogonality"].rows] == pytest.approx([0, 0, 0])


def test_readings_without_a_unit_say_so(good):
    calibration = replace(good.fit.calibration, unit_in="raw")
    result = replace(good, fit=replace(good.fit, calibration=calibration))
    assert [group.unit for group in [*list_quantities(result), *list_views(result)]] == [
        "raw units",
        "nT per raw unit",
        "raw units per nT",
        "°",
    ]
