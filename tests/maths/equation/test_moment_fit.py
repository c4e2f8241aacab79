"""The ellipsoid of summed-up readings: derivatives, agreement with the fit to rows, honesty."""

import numpy as np
import pytest

from agonic import Reference, Samples, fit_ellipsoid
from agonic.live.maths import voxels
from agonic.maths.equation import moment_fit, moments

MATRIX = np.eye(3) + np.array([[0.05, 0.02, -0.01], [0.02, -0.03, 0.015], [-0.01, 0.015, 0.01]])
BIAS = np.array([20_000.0, -5000.0, 8000.0])
FIELD = 50_000.0
ROWS, COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])


def readings(rng, n, noise=200.0, highest=1.0):
    u = rng.normal(size=(8 * n, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    u = u[np.abs(u[:, 2]) < highest][:n]
    return FIELD * u @ np.linalg.inv(MATRIX).T + BIAS + noise * rng.normal(size=u.shape)


def fitted(rows, most=voxels.MAX_BOXES):
    """Bias and matrix (9,) in nT and per nT, their standard errors, and the noise."""
    boxes, _ = voxels.add_readings(voxels.begin(rows[0], 16.0), rows, most)
    centre = rows.mean(axis=0)
    sums = moments.rebase(boxes.sums.T, boxes.centre, boxes.scale, centre, FIELD).T
    found = moment_fit.estimate(sums)
    size = np.array([FIELD] * 3 + [1.0] * 6)
    params = np.concatenate([centre + FIELD * found.bias, found.matrix[ROWS, COLUMNS]])
    return params, np.sqrt(np.diag(found.covariance)) * size, found.noise * FIELD


TRUTH = np.concatenate([BIAS, MATRIX[ROWS, COLUMNS]])


def test_the_derivative_of_the_polynomial():
    rng = np.random.default_rng(0)
    params = np.concatenate([rng.normal(size=3), MATRIX[ROWS, COLUMNS]])
    _, slope = moment_fit.polynomial(params)
    for k, step in enumerate(1e-6 * np.eye(9)):
        difference = (
            moment_fit.polynomial(params + step)[0] - moment_fit.polynomial(params - step)[0]
        )
        np.testing.assert_allclose(slope[:, k], difference / 2e-6, atol=1e-8)


def test_the_polynomial_is_the_residual():
    y = np.array([0.3, -0.8, 0.5])
    q, _ = moment_fit.polynomial(np.r_[0.1, 0.2, -0.1, TRUTH[3:]])
    size = np.linalg.norm(MATRIX @ (y - [0.1, 0.2, -0.1]))
    placed = moments.powers(y[None], np.zeros(3), 1.0)[0][moments.GRAM_INDEX[9]]
    assert q @ placed == pytest.approx((size**2 - 1) / 2, abs=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(("n", "highest"), [(60, 1.0), (300, 1.0), (3000, 1.0), (3000, 0.3)])
def test_honest_standard_errors(n, highest):
    z = []
    for seed in range(80):
        params, sd, _ = fitted(readings(np.random.default_rng(seed), n, highest=highest))
        z.append((params - TRUTH) / sd)
    assert np.abs(np.mean(z, axis=0)).max() < 3.5 / np.sqrt(80)
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.15


def test_it_agrees_with_the_fit_to_rows():
    rows = readings(np.random.default_rng(1), 2000)
    params, sd, noise = fitted(rows)
    fit = fit_ellipsoid(Samples(field=rows), Reference.constant(FIELD), model="full")
    other = np.concatenate([fit.calibration.bias, fit.calibration.matrix[ROWS, COLUMNS]])
    assert np.abs((params - other) / fit.sd[:9]).max() < 0.7
    more = fit.sd[:9] / sd  # rows tell in addition what terms may hide
    assert 0.9 < more.min() <= more.max() < 1.8
    assert noise == pytest.approx(fit.noise, rel=0.05)


def test_a_sensor_at_rest_does_not_drown_the_rest():
    rng = np.random.default_rng(2)
    rows = readings(rng, 1500)
    rest = rows[0] + [1500.0, 0.0, 0.0] + 200 * rng.normal(size=(100_000, 3))  # beside a phone
    params, sd, _ = fitted(np.concatenate([rows, rest]))
    assert np.abs(params[:3] - BIAS).max() < 60
    assert np.abs((params - TRUTH) / sd).max() < 5


def test_boxes_filled_near_metal_are_left_out():
    rng = np.random.default_rng(3)
    rows = readings(rng, 3000)
    near = BIAS + 1.3 * (readings(rng, 200)[:150] - BIAS)
    params, sd, _ = fitted(np.concatenate([rows, near]))
    assert np.abs(params[:3] - BIAS).max() < 60
    assert np.abs((params - TRUTH) / sd).max() < 5
