"""The one equation and its residuals: closed forms, invariances, Jacobians, noise's own effect."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from agonic.maths.equation import affine
from agonic.simulation import random_calibration

SEEDS = st.integers(0, 2**32 - 1)
FIELD = 50_000.0
SIZES = np.array([10.0] * 3 + [1e-5] * 9)  # steps of the differences: nT, then matrix elements


def scene(seed: int, n: int = 20, off: float = 3000.0):
    """Readings `off` nT off a random ellipsoid, its bias and its (not symmetric) matrix."""
    rng = np.random.default_rng(seed)
    truth = random_calibration(rng, soft_iron=0.3, cross=0.15)
    matrix = Rotation.random(random_state=seed).as_matrix() @ truth.matrix
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    raw = FIELD * directions @ np.linalg.inv(matrix).T + truth.bias
    return raw + off * rng.normal(size=(n, 3)), np.array(truth.bias), matrix


def test_correct_is_the_equation_row_by_row_and_over_leading_axes() -> None:
    raw, bias, matrix = scene(0)
    expected = np.array([matrix @ (row - bias) for row in raw])
    assert np.allclose(affine.correct(raw, bias, matrix), expected, rtol=1e-14)
    assert np.allclose(affine.correct(raw.reshape(4, 5, 3), bias, matrix).reshape(-1, 3), expected)


def test_each_model_frees_what_its_name_says() -> None:
    def matrix(model: str, gauge: str, *params: float) -> np.ndarray:
        basis = affine.model_basis(model, gauge)
        return affine.split(basis @ np.concatenate([np.zeros(3), params]))[1]

    assert np.array_equal(matrix("sphere", "symmetric", 2.0), 2 * np.eye(3))
    assert np.array_equal(matrix("diagonal", "symmetric", 2, 3, 4), np.diag([2.0, 3, 4]))
    full = [[1, 4, 5], [4, 2, 6], [5, 6, 3]]
    assert np.array_equal(matrix("full", "symmetric", 1, 2, 3, 4, 5, 6), full)
    assert np.array_equal(matrix("full", "triangular", 1, 2, 3, 4, 5, 6), np.triu(full))


def test_split_undoes_join() -> None:
    _, bias, matrix = scene(1)
    again = affine.split(affine.join(bias, matrix))
    assert np.array_equal(again[0], bias)
    assert np.array_equal(again[1], matrix)


def test_residual_on_a_sphere_is_the_distance_from_it() -> None:
    bias, gain = np.array([3.0, -1.0, 2.0]), 2.0
    raw = bias + np.array([[7.0, 0, 0], [0, 0, -3.0]])
    residual, jacobian = affine.magnitude_residual(raw, bias, gain * np.eye(3), 10.0)
    assert residual == pytest.approx([2.0, -2.0])  # radius 10/2
    assert jacobian[:, :3] == pytest.approx(np.array([[-1.0, 0, 0], [0, 0, 1.0]]))


@given(SEEDS)
def test_residual_near_an_ellipsoid_is_the_distance_from_it(seed: int) -> None:
    on_it, bias, matrix = scene(seed, off=0.0)
    residual, jacobian = affine.magnitude_residual(on_it, bias, matrix, FIELD)
    normals = -jacobian[:, :3]
    assert np.abs(residual).max() < 1e-8
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(on_it)))
    away = affine.magnitude_residual(on_it + 10.0 * normals, bias, matrix, FIELD)[0]
    assert away == pytest.approx(np.full(len(on_it), 10.0), rel=1e-3)


@settings(max_examples=30)
@given(SEEDS, st.sampled_from([1.0, 1000.0, 8000.0]))
def test_jacobian_of_the_residual(derivative, seed: int, off: float) -> None:
    raw, bias, matrix = scene(seed, off=off)
    magnitude = FIELD * np.linspace(0.8, 1.2, len(raw))

    def residual(local: np.ndarray) -> np.ndarray:
        return affine.magnitude_residual(raw, *affine.split(local), magnitude)[0]

    jacobian = affine.magnitude_residual(raw, bias, matrix, magnitude)[1]
    expected = derivative(residual, affine.join(bias, matrix), SIZES)
    assert np.abs((jacobian - expected) * SIZES).max() < 1e-3  # nT, of some 1000


@given(SEEDS)
def test_turned_and_stretched_axes_give_the_same_residuals(seed: int) -> None:
    raw, bias, matrix = scene(seed)
    residual = affine.magnitude_residual(raw, bias, matrix, FIELD)[0]
    turn = Rotation.random(random_state=seed ^ 1).as_matrix()
    turned = affine.magnitude_residual(raw @ turn.T, turn @ bias, matrix @ turn.T, FIELD)[0]
    counts = affine.magnitude_residual(0.1 * raw, 0.1 * bias, 10 * matrix, FIELD)[0]
    gauge = affine.magnitude_residual(raw, bias, turn @ matrix, FIELD)[0]
    for other in (turned, 10 * counts, gauge):
        assert other == pytest.approx(residual, abs=1e-6)


def test_noise_sd_takes_the_noise_out_of_the_gradient() -> None:
    """E[J r] = 0 with `noise_sd`; without it, it is many standard errors off (on a cap)."""
    rng = np.random.default_rng(3)
    _, bias, matrix = scene(4)
    directions = rng.normal(size=(150_000, 3))
    directions[:, 2] = np.abs(directions[:, 2]) + 1.0
    directions *= FIELD / np.linalg.norm(directions, axis=1, keepdims=True)
    raw = directions @ np.linalg.inv(matrix).T + bias + 1500.0 * rng.normal(size=(150_000, 3))

    def gradient_in_standard_errors(noise_sd: float) -> np.ndarray:
        residual, jacobian = affine.magnitude_residual(raw, bias, matrix, FIELD, noise_sd)
        pulls = jacobian * residual[:, None]
        return pulls.mean(axis=0) / (pulls.std(axis=0) / np.sqrt(len(raw)))

    assert np.abs(gradient_in_standard_errors(1500.0)).max() < 4
    assert np.abs(gradient_in_standard_errors(0.0)).max() > 8


def test_covariates_spread_each_parameter_over_the_basis(derivative) -> None:
    raw, bias, matrix = scene(5)
    warmth = np.linspace(-1, 1, len(raw))
    covariates = np.stack([np.ones(len(raw)), warmth, warmth**2], axis=1)
    coefficients = np.zeros((12, 3))
    coefficients[:, 0] = affine.join(bias, matrix)

    def residual(flat: np.ndarray) -> np.ndarray:
        local = covariates @ flat.reshape(12, 3).T
        rows = zip(raw, *affine.split(local), strict=True)
        return np.array([affine.magnitude_residual(r[None], b, w, FIELD)[0][0] for r, b, w in rows])

    local_jacobian = affine.magnitude_residual(raw, bias, matrix, FIELD)[1]
    sizes = np.repeat(SIZES, 3)
    expected = derivative(residual, coefficients.ravel(), sizes)
    jacobian = affine.expand_covariates(local_jacobian, covariates)
    assert np.abs((jacobian - expected) * sizes).max() < 1e-4


def test_jacobian_of_the_corrected_field(derivative) -> None:
    raw, bias, matrix = scene(6)
    expected = derivative(
        lambda local: affine.correct(raw, *affine.split(local)), affine.join(bias, matrix), SIZES
    )
    jacobian = affine.correction_jacobian(raw, bias, matrix)
    assert np.abs((jacobian - expected) * SIZES).max() < 1e-5


def attitudes(seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Down, and a horizontal direction, both unit vectors (n, 3)."""
    turns = Rotation.random(n, random_state=seed).as_matrix()
    return turns[:, 2], turns[:, 1]


@given(SEEDS)
@settings(max_examples=20)
@pytest.mark.parametrize("share", [affine.NO_SHARE, affine.AttitudeShare(0.6, 0.3, 1.1)])
@pytest.mark.parametrize("kind", ["dip", "azimuth"])
def test_jacobians_of_dip_and_azimuth_are_the_derivatives(
    kind: str, share: affine.AttitudeShare, seed: int
) -> None:
    raw, bias, matrix = scene(seed)
    down, across = attitudes(seed, len(raw))
    dip = down, 25_000.0, -43_000.0

    def compute(bias: np.ndarray, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if kind == "azimuth":
            return affine.azimuth_residual(raw, bias, matrix, across, dip, share)
        return affine.dip_residual(raw, bias, matrix, *dip, share=share)

    def residual(local: np.ndarray) -> np.ndarray:
        return compute(*affine.split(local))[0]

    local = affine.join(bias, matrix)
    numeric = np.stack(
        [(residual(local + step) - residual(local - step)) / 2 for step in np.diag(SIZES)], axis=1
    )
    jacobian = compute(bias, matrix)[1]
    # where the field happens to be vertical the dip has a kink
    assert np.median(np.abs(numeric - jacobian * SIZES), axis=0).max() < 1e-3 * SIZES[0]


def test_dip_is_the_angle_to_the_field_that_should_be_there() -> None:
    turned = np.radians(30.0)
    raw = 50.0 * np.array([[np.cos(turned), 0.0, np.sin(turned)]])
    residual, _ = affine.dip_residual(
        raw,
        np.zeros(3),
        np.eye(3),
        np.array([[0.0, 0.0, 1.0]]),
        50.0 * np.cos(np.radians(40.0)),
        50.0 * np.sin(np.radians(40.0)),
    )
    assert residual == pytest.approx([50.0 * np.sin(np.radians(-10.0))])


def test_an_error_of_roll_and_pitch_leaves_the_magnitude_alone() -> None:
    raw, bias, matrix = scene(3)
    down, _ = attitudes(3, len(raw))
    tilted, _ = attitudes(4, len(raw))
    there, _ = affine.dip_residual(raw, bias, matrix, down, 25_000.0, 43_000.0)
    wrong, _ = affine.dip_residual(raw, bias, matrix, tilted, 25_000.0, 43_000.0)
    assert np.abs(there - wrong).max() > 1000.0
    # the two residuals contain the same as z − Z and h − H
    u = (raw - bias) @ matrix.T
    z = np.sum(u * down, axis=1)
    h = np.linalg.norm(u - z[:, None] * down, axis=1)
    e = (25_000.0 * z - 43_000.0 * h) / np.hypot(25_000.0, 43_000.0)
    unit = (u - z[:, None] * down) / h[:, None]
    gradient = (25_000.0 * down - 43_000.0 * unit) / np.hypot(25_000.0, 43_000.0)
    assert there == pytest.approx(e / np.linalg.norm(gradient @ matrix, axis=1))


def test_noise_alone_does_not_lean_the_dip() -> None:
    """With the correction, the gradient of the cost has mean zero at the truth."""
    rng = np.random.default_rng(0)
    n, sd = 400_000, 0.05
    directions = np.array([0.4, 0.3, np.sqrt(0.75)])
    down = np.broadcast_to([0.0, 0.0, 1.0], (n, 3))
    raw = directions + sd * rng.normal(size=(n, 3))
    for corrected, biased in ((sd, False), (0.0, True)):
        r, jacobian = affine.dip_residual(
            raw, np.zeros(3), np.eye(3), down, 0.5, np.sqrt(0.75), corrected
        )
        product = r * (jacobian[:, 0] * 0.8 + jacobian[:, 1] * 0.6)
        error = product.mean() / (product.std() / np.sqrt(n))
        assert (abs(error) > 10) == biased


@pytest.mark.parametrize("kind", ["dip", "azimuth"])
def test_errors_of_the_attitude_do_not_lean_dip_and_azimuth(kind: str) -> None:
    """Tilt and heading with errors of their own: the gradient of the cost has mean zero."""
    rng = np.random.default_rng(0)
    n, tilt, heading = 400_000, 0.02, 0.05
    field = np.array([0.5, 0.0, np.sqrt(0.75)])
    # errors about north, east and down, of the attitude in which the field is where it should be
    about = rng.normal(size=(n, 3)) * [tilt, tilt, heading]
    down = np.array([0.0, 0.0, 1.0]) + np.cross(about, [0.0, 0.0, 1.0])
    across = np.array([0.0, 1.0, 0.0]) + np.cross(about, [0.0, 1.0, 0.0])
    down, across = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (down, across))
    raw, dip = np.broadcast_to(field, (n, 3)), (down, 0.5, np.sqrt(0.75))
    whole = tilt**2 / (0.75 * tilt**2 + 0.25 * heading**2)
    right = {
        "dip": affine.AttitudeShare(1.0, 0.0, 1.0),
        "azimuth": affine.AttitudeShare(whole, 1.0 - whole, 1.0),
    }[kind]
    pulls = []
    for share in (affine.NO_SHARE, right):
        if kind == "dip":
            r, jacobian = affine.dip_residual(raw, np.zeros(3), np.eye(3), *dip, share=share)
        else:
            r, jacobian = affine.azimuth_residual(raw, np.zeros(3), np.eye(3), across, dip, share)
        pulls.append(r * (jacobian[:, :3] @ field))
    chance = pulls[0].std() / np.sqrt(n)
    assert abs(pulls[0].mean()) > 100 * chance
    assert abs(pulls[1].mean()) < 4 * chance


@pytest.mark.parametrize("noise_sd", [0.0, 200.0])
def test_residuals_alone_are_those_beside_the_jacobian(noise_sd: float) -> None:
    raw, bias, matrix = scene(2)
    axes = Rotation.random(len(raw), random_state=0).as_matrix()
    share = affine.AttitudeShare(0.3, 0.2, 1.0)
    dip = (axes[:, 0], 20_000.0, 45_000.0)
    for residual, known in (
        (affine.magnitude_residual, (FIELD, noise_sd)),
        (affine.dip_residual, (*dip, noise_sd, share)),
        (affine.azimuth_residual, (axes[:, 1], dip, share)),
    ):
        beside, _ = residual(raw, bias, matrix, *known)
        alone, _ = residual(raw, bias, matrix, *known, differentiate=False)
        assert np.array_equal(alone, beside)
