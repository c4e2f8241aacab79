"""Quadric fits: exact data, the published equations, long ellipsoids, and noise taken out."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from agonic.maths.equation import moments, quadric
from agonic.maths.equation.affine import model_basis
from agonic.maths.equation.symmetric import pack_symmetric

SEEDS = st.integers(0, 2**32 - 1)
MODELS = {
    "sphere": np.diag([1.1, 1.1, 1.1]),
    "diagonal": np.diag([0.9, 1.0, 1.2]),
    "full": np.array([[1.1, 0.05, -0.1], [0.05, 0.9, 0.08], [-0.1, 0.08, 1.0]]),
}
BIAS = np.array([0.3, -0.2, 0.1])


def points(
    matrix: np.ndarray, n: int = 300, *, noise: float = 0.0, height: float = 1.0, seed: int = 0
) -> np.ndarray:
    """Points of |W (p − b)| = 1 up to a height (1: all round) above its middle, with noise."""
    rng = np.random.default_rng(seed)
    z, longitude = rng.uniform(-height, height, n), rng.uniform(0, 2 * np.pi, n)
    level = np.sqrt(1 - z**2)
    units = np.stack([level * np.cos(longitude), level * np.sin(longitude), z], axis=1)
    return units @ np.linalg.inv(matrix).T + BIAS + noise * rng.normal(size=(n, 3))


def psi(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return moments.compute_denoised_gram(moments.accumulate(readings, np.zeros(3), 1.0))


def turned(*gains: float) -> np.ndarray:
    """A matrix of these gains along three random axes; semi-axes are their inverses."""
    axes = Rotation.random(random_state=0).as_matrix()
    return axes @ np.diag(gains) @ axes.T


@pytest.mark.parametrize("model", MODELS)
def test_all_methods_find_an_exact_ellipsoid(model: str) -> None:
    sums = psi(points(MODELS[model]))
    adjusted, variance = quadric.fit_adjusted(sums, model)
    assert variance < 1e-12
    found = [adjusted, quadric.fit_algebraic(sums[0], model)]
    found += [quadric.fit_li_griffiths(sums[0])] if model == "full" else []
    for v in found:
        bias, matrix = quadric.to_affine(v)
        assert bias == pytest.approx(BIAS, abs=1e-6)
        assert matrix == pytest.approx(MODELS[model], abs=1e-6)


@pytest.mark.parametrize("model", MODELS)
def test_quadric_vanishes_on_its_ellipsoid(model: str) -> None:
    readings = points(MODELS[model])
    m, n, d = quadric.split_quadric(quadric.fit_algebraic(psi(readings)[0], model))
    values = np.einsum("ni,ij,nj->n", readings, m, readings) + 2 * readings @ n + d
    assert np.abs(values).max() < 1e-9


def test_li_griffiths_solves_the_published_equations() -> None:
    """S v = λ C v with vᵀCv = kJ − I², by the whole 10 × 10 problem instead of the reduced one."""
    readings = points(MODELS["full"], noise=0.05)
    times = quadric.MULTIPLICITY
    scatter = psi(readings)[0] * np.outer(times, times)
    k, constraint = 4.0, np.zeros((10, 10))
    constraint[:3, :3] = np.full((3, 3), k / 2 - 1)
    constraint[:3, :3] -= k / 2 * np.eye(3)
    constraint[3:6, 3:6] = -k * np.eye(3)
    # C v = μ S v: the one positive μ belongs to the ellipsoid of least |Dᵀv|²
    values, vectors = eigh(constraint, scatter)
    assert (values > 1e-12).sum() == 1
    whole = vectors[:, -1]
    a, b, c, f, g, h = whole[:6]
    i, j = a + b + c, a * b + b * c + a * c - f**2 - g**2 - h**2
    assert whole @ constraint @ whole == pytest.approx(k * j - i**2)
    reduced = quadric._fit_constrained(psi(readings)[0], k)
    assert reduced is not None
    for published, ours in zip(quadric.to_affine(whole), quadric.to_affine(reduced), strict=True):
        assert ours == pytest.approx(published, abs=1e-9)


@pytest.mark.parametrize(
    "gains",
    [(0.25, 1, 1), (0.25, 0.25, 1), (0.25, 0.5, 1), (0.125, 0.125, 1), (0.125, 1, 1)],
    ids=["cigar 4:1", "disc 4:1", "three axes 4:2:1", "disc 8:1", "cigar 8:1"],
)
def test_li_griffiths_fits_long_ellipsoids(gains: tuple[float, float, float]) -> None:
    matrix = turned(*gains)
    bias, found = quadric.to_affine(quadric.fit_li_griffiths(psi(points(matrix, noise=1e-3))[0]))
    assert bias == pytest.approx(BIAS, abs=0.02)
    assert found == pytest.approx(matrix, abs=0.01)


def test_the_search_over_k_is_needed_for_a_flat_disc() -> None:
    """For semi-axes 4 : 4 : 1, 4J − I² < 0: with k = 4 the true ellipsoid is shut out."""
    scatter = psi(points(turned(0.25, 0.25, 1), noise=1e-3))[0]
    at_four = quadric._fit_constrained(scatter, 4.0)
    assert at_four is not None
    gains = np.linalg.eigvalsh(quadric.to_affine(at_four)[1])
    assert gains[-1] / gains[0] < 3.0


@pytest.mark.slow
@given(SEEDS, st.sampled_from(["adjusted", "li-griffiths", "smallest"]))
def test_turned_points_give_the_turned_ellipsoid(seed: int, method: str) -> None:
    turn = Rotation.random(random_state=seed).as_matrix()
    readings = points(MODELS["full"], noise=0.03, seed=seed)

    def fit(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sums = psi(rows)
        if method == "adjusted":
            return quadric.to_affine(quadric.fit_adjusted(sums)[0])
        v = (
            quadric.fit_li_griffiths(sums[0])
            if method == "li-griffiths"
            else quadric.fit_algebraic(sums[0])
        )
        return quadric.to_affine(v)

    (bias, matrix), (turned_bias, turned_matrix) = fit(readings), fit(readings @ turn.T)
    exact = 1e-6 if method != "smallest" else 0.05  # |v| = 1 is not the same in turned axes
    assert turned_bias == pytest.approx(turn @ bias, abs=exact)
    assert turned_matrix == pytest.approx(turn @ matrix @ turn.T, abs=exact)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("sd", [0.001, 0.01, 0.05])
def test_adjusted_finds_the_noise(model: str, sd: float) -> None:
    variance = quadric.fit_adjusted(psi(points(MODELS[model], 20_000, noise=sd)), model)[1]
    assert np.sqrt(variance) == pytest.approx(sd, rel=0.03)


def test_adjusted_stays_right_where_li_griffiths_does_not() -> None:
    """A belt of ±20° with 2 % noise and very many readings: only the bias of the method is left."""
    readings = points(MODELS["full"], 400_000, noise=0.02, height=np.sin(np.radians(20)))
    sums = psi(readings)

    def error(v: np.ndarray) -> float:
        return float(np.abs(quadric.to_affine(v)[1] - MODELS["full"]).max())

    adjusted = quadric.fit_adjusted(sums)[0]
    known = quadric.fit_adjusted(sums, noise_variance=0.02**2)[0]
    assert error(adjusted) < 0.004
    assert error(known) < 0.004
    assert error(quadric.fit_li_griffiths(sums[0])) > 5 * error(adjusted)
    assert error(quadric.fit_algebraic(sums[0])) > 5 * error(adjusted)


@pytest.mark.parametrize("model", MODELS)
def test_algebraic_covariance_is_that_of_many_draws(model: str) -> None:
    basis, sd = model_basis(model), 0.01
    errors, claimed = [], []
    for seed in range(300):
        sums = psi(points(MODELS[model], 400, noise=sd, seed=seed))
        v, variance = quadric.fit_adjusted(sums, model)
        bias, matrix = quadric.to_affine(v)
        cleaned = sums[0] - variance * sums[1] + variance**2 * sums[2]
        covariance, condition = quadric.algebraic_covariance(cleaned, bias, matrix, basis, variance)
        assert 1 <= condition < 100
        free = {"sphere": [3], "diagonal": [3, 4, 5]}.get(model, range(3, 9))
        error = np.concatenate([bias - BIAS, pack_symmetric(matrix - MODELS[model])])
        errors.append(error[[0, 1, 2, *free]])
        claimed.append(np.sqrt(np.diag(covariance)))
    z = np.array(errors) / np.array(claimed)
    assert z.std(axis=0) == pytest.approx(np.ones(z.shape[1]), abs=0.16)  # 4 standard errors


@given(SEEDS)
def test_to_affine_puts_the_ellipsoid_at_the_magnitude(seed: int) -> None:
    rng = np.random.default_rng(seed)
    v = quadric.fit_algebraic(psi(points(MODELS["full"]))[0]) * rng.choice([-3.0, 0.1, 7.0])
    bias, matrix = quadric.to_affine(v, 50_000.0)
    calibrated = (points(MODELS["full"]) - bias) @ matrix.T
    assert np.linalg.norm(calibrated, axis=1) == pytest.approx(np.full(300, 50_000.0))
    assert matrix == pytest.approx(matrix.T)


@pytest.mark.parametrize(
    "v",
    [
        [1, 1, -1, 0, 0, 0, 0, 0, 0, -1.0],  # hyperboloid of one sheet
        [1, 1, 0, 0, 0, 0, 0, 0, 0, -1.0],  # cylinder
        [1, 1, 1, 0, 0, 0, 0, 0, 0, 1.0],  # no point at all
        [1, 1, 0, 0, 0, 0, 0, 0, 1, 0.0],  # paraboloid
    ],
)
def test_what_is_no_ellipsoid_is_told(v: list[float]) -> None:
    assert not quadric.is_ellipsoid(np.array(v, float))
    with pytest.raises(ValueError, match="not an ellipsoid"):
        quadric.to_affine(np.array(v, float))


@given(SEEDS)
def test_readings_on_a_plane_hold_no_ellipsoid_for_li_griffiths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    flat = rng.normal(size=(50, 3)) * [1.0, 1.0, 0.0]
    assume(np.ptp(flat[:, 0]) > 1)
    with pytest.raises((ValueError, np.linalg.LinAlgError)):
        quadric.fit_li_griffiths(psi(flat)[0])


def test_many_at_once_are_what_each_is_alone() -> None:
    sums = [psi(points(MODELS["full"] * gain, noise=sd)) for gain, sd in ((1, 0.0), (1.3, 0.02))]
    together = tuple(np.stack(part) for part in zip(*sums, strict=True))
    v, variance = quadric.fit_adjusted(together)
    bias, matrix = quadric.to_affine(v)
    cleaned = together[0] - variance[:, None, None] * together[1]
    covariance, condition = quadric.algebraic_covariance(
        cleaned, bias, matrix, model_basis("full"), variance
    )
    for k, alone in enumerate(sums):
        one, noise = quadric.fit_adjusted(alone)
        assert noise == pytest.approx(variance[k], rel=1e-9, abs=1e-15)
        for mine, theirs in zip(quadric.to_affine(one), (bias[k], matrix[k]), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-12)
        spread = quadric.algebraic_covariance(
            cleaned[k], bias[k], matrix[k], model_basis("full"), variance[k]
        )
        np.testing.assert_allclose(spread[0], covariance[k], rtol=1e-6, atol=1e-18)
        assert spread[1] == pytest.approx(condition[k])
