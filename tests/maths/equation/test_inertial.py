"""Dip and azimuth beside an inertial unit: the Jacobians, and what elimination leaves."""

import numpy as np
import pytest

from agonic.maths.equation.affine import join, split
from agonic.maths.equation.inertial import (
    Relative,
    Shared,
    relative_azimuth_residual,
    shared_dip_residual,
)

N, Q = 4000, 5
LEVEL = (np.array([0.5]), np.array([np.sqrt(0.75)]))


@pytest.fixture(scope="module")
def posed():
    """Readings of a field that stands still in each of four stretches, tilted by some degrees."""
    rng = np.random.default_rng(0)
    down = 0.2 * rng.standard_normal((N, 3)) + [0, 0, 1]
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    ahead = np.cross(down, rng.standard_normal((N, 3)))
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    stretch = np.repeat(np.arange(4), N // 4)
    by = 0.01 * rng.standard_normal((N, 3, Q))
    by -= down[:, :, None] * np.einsum("nb,nbq->nq", down, by)[:, None]
    azimuth_by, dip_by = 0.05 * rng.standard_normal((N, Q)), 0.01 * rng.standard_normal(Q)
    shared = Shared(by, azimuth_by, dip_by, np.zeros(Q))
    turned = np.array([0.3, 1.0, 2.0, -1.0])[stretch][:, None]
    level = np.cos(turned) * ahead + np.sin(turned) * np.cross(down, ahead)
    field = LEVEL[0] * level + LEVEL[1] * down
    matrix, bias = np.eye(3) + 0.05 * rng.standard_normal((3, 3)), 0.3 * rng.standard_normal(3)
    raw = field @ np.linalg.inv(matrix).T + bias + 0.01 * rng.standard_normal((N, 3))
    params = np.concatenate([join(bias, matrix), 0.01 * rng.standard_normal(Q)])
    return raw, down, Relative(ahead, stretch), shared, params


def differentiate(function, params: np.ndarray) -> np.ndarray:
    step = 1e-6 * np.eye(len(params))
    return np.stack([(function(params + h) - function(params - h)) / 2e-6 for h in step], axis=1)


def test_jacobian_of_the_dip(posed) -> None:
    raw, down, _, shared, params = posed

    def residual(x):
        return shared_dip_residual(raw, *split(x[:12]), down, LEVEL, shared, x[12:])

    jacobian, numeric = residual(params)[1], differentiate(lambda x: residual(x)[0], params)
    np.testing.assert_allclose(jacobian[:, :12], numeric[:, :12], atol=1e-8)
    # what shared errors do to the denominator is left out: the residual, 1 %, of it
    np.testing.assert_allclose(jacobian[:, 12:], numeric[:, 12:], atol=5e-4)


def test_gradient_of_the_azimuth_whose_zero_is_free_in_every_stretch(posed) -> None:
    raw, down, relative, shared, params = posed

    def residual(x):
        return relative_azimuth_residual(raw, *split(x[:12]), down, relative, shared, x[12:])

    r, jacobian = residual(params)
    numeric = differentiate(lambda x: residual(x)[0], params)
    # robust weights move a little with the parameters, which Kaufman's Jacobian leaves out
    np.testing.assert_allclose(jacobian, numeric, atol=0.03)
    np.testing.assert_allclose(r @ jacobian, r @ numeric, atol=0.02 * np.abs(r).sum())
    assert abs(r.mean()) < 1e-3


def test_turning_a_stretch_changes_nothing(posed) -> None:
    raw, down, relative, shared, params = posed
    angle = np.array([0.0, 2.0, -1.0, 3.0])[relative.stretch][:, None]
    ahead = np.cos(angle) * relative.ahead + np.sin(angle) * np.cross(down, relative.ahead)
    bias, matrix = split(params[:12])
    one, other = (
        relative_azimuth_residual(raw, bias, matrix, down, some, shared, params[12:])[0]
        for some in (relative, relative._replace(ahead=ahead))
    )
    np.testing.assert_allclose(one, other, atol=1e-6)
