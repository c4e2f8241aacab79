"""`inflight.maths.residuals`: Jacobians against differences, rows with their own matrix."""

import numpy as np
import pytest

from agonic.inflight.maths.residuals import (
    KINDS,
    Layout,
    Rows,
    correct,
    cut,
    residual_pieces,
)
from agonic.maths.equation.affine import azimuth_residual, magnitude_residual
from agonic.maths.rotations.vectors import find_best_rotation

N = 60


def compute_residuals(given, kind, params, layout, sd=0.0):
    """Residuals (n,) and their Jacobian (n, m) of rows that make one block."""
    ((r, few, onto),) = residual_pieces(lambda: cut(given, layout), kind, layout, sd)(params)
    return r, few @ onto


def rows(terms: int, matrix_terms: int) -> Rows:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(N, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    side = np.cross(points, rng.normal(size=(N, 3)))
    side /= np.linalg.norm(side, axis=1)[:, None]
    return Rows(
        points=points + 0.05 * rng.normal(size=(N, 3)),
        wanted=1 + 0.1 * rng.normal(size=N),
        aim=points,
        side=side,
        bias_terms=rng.normal(size=(N, terms)),
        matrix_terms=rng.normal(size=(N, matrix_terms)),
        time=np.arange(N, dtype=float),
        direction_e=None,
    )


def params_of(layout: Layout) -> np.ndarray:
    return layout.start + 0.03 * np.random.default_rng(1).normal(size=layout.parameters)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "layout",
    [
        Layout("symmetric", 0, 0),
        Layout("free", 2, 0),
        Layout("free", 2, 3),
    ],
    ids=str,
)
def test_jacobians_are_the_derivatives(kind: str, layout: Layout) -> None:
    given, params = rows(layout.bias_terms, layout.matrix_terms), params_of(layout)
    # the correction of the noise's own part is outside the Jacobian: it is of second order
    sd = 0.0 if kind == "magnitude" else 1.5
    _, jacobian = compute_residuals(given, kind, params, layout, sd)
    step = 1e-6
    for k in range(layout.parameters):
        ahead, behind = (
            compute_residuals(given, kind, params + s * np.eye(layout.parameters)[k], layout, sd)[0]
            for s in (step, -step)
        )
        np.testing.assert_allclose(jacobian[:, k], (ahead - behind) / (2 * step), atol=1e-8)


def test_a_matrix_for_each_row_is_the_constant_one_where_its_terms_are_zero() -> None:
    layout, wide = Layout("free", 1, 0), Layout("free", 1, 2)
    params = params_of(layout)
    more = np.concatenate([params, np.zeros(12)])
    given, other = rows(1, 0), rows(1, 2)
    for kind in KINDS:
        r, jacobian = compute_residuals(given, kind, params, layout, 0.02)
        each, by_each = compute_residuals(
            given._replace(matrix_terms=other.matrix_terms), kind, more, wide, 0.02
        )
        np.testing.assert_allclose(each, r, atol=1e-13)
        np.testing.assert_allclose(by_each[:, : layout.parameters], jacobian, atol=1e-13)


def test_the_three_kinds_are_the_error_of_the_field_where_the_matrix_is_one() -> None:
    given, layout = rows(0, 0), Layout("symmetric", 0, 0)
    params = layout.start + np.r_[0.001, -0.002, 0.0015, np.zeros(6)]
    error = correct(given, params, layout) - given.wanted[:, None] * given.aim
    third = np.cross(given.aim, given.side)
    for kind, along in (("azimuth", given.side), ("dip", third)):
        found, _ = compute_residuals(given, kind, params, layout)
        np.testing.assert_allclose(found, (error * along).sum(axis=1), atol=1e-12)
    u, eye = given.points, np.eye(3)
    size, _ = compute_residuals(given, "magnitude", layout.start, layout)
    np.testing.assert_allclose(size, magnitude_residual(u, np.zeros(3), eye, given.wanted)[0])
    side, _ = compute_residuals(given, "azimuth", layout.start, layout)
    np.testing.assert_allclose(side, azimuth_residual(u, np.zeros(3), eye, given.side)[0])


def test_the_turn_between_directions_is_found_without_a_reflection() -> None:
    rng = np.random.default_rng(0)
    seen = rng.normal(size=(200, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    noisy = seen @ turn.T + 1e-3 * rng.normal(size=seen.shape)
    found = find_best_rotation(seen, noisy, np.ones(200))
    assert np.linalg.det(found) == pytest.approx(1.0)
    assert np.abs(found - turn).max() < 5e-4
    flat = seen * [1, 1, 0]  # all in a plane: still a rotation
    assert np.linalg.det(find_best_rotation(flat, flat @ turn.T, np.ones(200))) > 0
