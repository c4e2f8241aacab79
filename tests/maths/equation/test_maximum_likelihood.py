"""Maximum likelihood on points of about one: pieces, prior, noise, outliers, and the estimate."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from agonic.maths.equation import maximum_likelihood, starting_values
from agonic.maths.equation.affine import model_basis, split
from agonic.maths.equation.channels import Problem, compute_distances, pieces
from agonic.maths.equation.maximum_likelihood import estimate, find_corroborated
from agonic.maths.equation.priors import make_prior, soft_iron_pull
from agonic.maths.equation.starting_values import nearest_parameters
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import estimate_noise, is_like_gaussian
from agonic.simulation.draws import draw_directions

W = np.array([[1.1, 0.05, -0.1], [0.05, 0.9, 0.08], [-0.1, 0.08, 1.0]])
BIAS = np.array([0.3, -0.2, 0.1])
FULL = nearest_parameters(BIAS, W, model_basis("full"))


def problem(n: int, *, noise: float = 0.01, seed: int = 0, model: str = "full", prior=None):
    """Points of an ellipsoid seen from all directions, of constant magnitude one."""
    rng = np.random.default_rng(seed)
    points = draw_directions(rng, n) @ np.linalg.inv(W).T + BIAS + noise * rng.normal(size=(n, 3))
    return Problem(points, np.ones(1), model, prior)


def calibration(params: np.ndarray, model: str = "full") -> tuple[np.ndarray, np.ndarray]:
    return split(model_basis(model) @ params)


def test_parameters_are_those_of_the_nearest_matrix_of_the_model() -> None:
    bias, matrix = calibration(FULL)
    assert bias == pytest.approx(BIAS)
    assert matrix == pytest.approx(W)
    assert nearest_parameters(BIAS, W, model_basis("sphere"))[3:] == pytest.approx(
        [np.trace(W) / 3]
    )
    assert nearest_parameters(BIAS, W, model_basis("diagonal"))[3:] == pytest.approx(np.diag(W))


@pytest.mark.slow
@given(st.lists(st.integers(0, 9999), min_size=20, max_size=200))
def test_blocks_add_up_to_one_piece(rows: list[int]) -> None:
    whole = problem(10_000)  # more than two blocks
    residuals, jacobians = zip(*pieces(whole, "magnitude")(FULL), strict=True)
    part = whole.subset(np.array(rows))
    residual, jacobian = next(iter(pieces(part, "magnitude")(FULL)))
    assert np.concatenate(residuals)[rows] == pytest.approx(residual)
    assert np.concatenate(jacobians)[rows] == pytest.approx(jacobian)


def test_a_magnitude_per_sample_goes_with_its_rows() -> None:
    magnitude = np.linspace(0.9, 1.1, 9000)
    whole = problem(9000)._replace(magnitude=magnitude)
    residuals = np.concatenate([r for r, _ in pieces(whole, "magnitude")(FULL)])
    flipped = whole.subset(np.arange(9000)[::-1])
    assert np.concatenate([r for r, _ in pieces(flipped, "magnitude")(FULL)]) == pytest.approx(
        residuals[::-1]
    )


@pytest.mark.parametrize("model", ["diagonal", "full"])
def test_prior_on_soft_iron(derivative, model: str) -> None:
    prior = make_prior(model, 0.1)
    assert prior is not None
    params = nearest_parameters(BIAS, W, model_basis(model))
    residual, jacobian = prior(params)
    assert jacobian == pytest.approx(derivative(lambda p: prior(p)[0], params, 1e-6), abs=1e-6)
    assert residual[0] == pytest.approx((1.1 - 1.0) / 0.1)
    assert prior(2 * params)[0] == pytest.approx(residual)  # gain is free
    at_rest = nearest_parameters(BIAS, 3 * np.eye(3), model_basis(model))
    assert prior(at_rest)[0] == pytest.approx(np.zeros(len(residual)))


def test_no_prior_where_there_is_nothing_to_hold() -> None:
    assert make_prior("sphere", 0.1) is None
    assert make_prior("full", None) is None


def test_distances_are_those_to_the_ellipsoid_along_its_normals() -> None:
    points = problem(9000, noise=0.0).points
    _, normals = compute_distances(points, BIAS, W, np.ones(1))
    moved, again = compute_distances(points + 1e-4 * normals, BIAS, W, np.ones(1))
    assert np.linalg.norm(again, axis=1) == pytest.approx(np.ones(9000), abs=1e-4)
    assert moved == pytest.approx(np.full(9000, 1e-4), rel=1e-3)


def test_noise_brings_in_tukey_only_where_a_reading_stands_out() -> None:
    residuals = 0.01 * np.random.default_rng(1).normal(size=2000)
    quiet = estimate_noise(residuals, robust=True, parameters=9)
    assert quiet.sd == pytest.approx(0.01, rel=0.05)
    assert quiet.loss.weight(np.array([100.0])) == 1.0
    residuals[7] = 1.0
    alarmed = estimate_noise(residuals, robust=True, parameters=9)
    assert alarmed.sd == pytest.approx(0.01, rel=0.05)
    assert alarmed.loss.weight(np.array([100.0])) == 0.0
    assert estimate_noise(residuals, robust=False, parameters=9).sd > 0.02


def test_gaussian_noise_is_told_from_what_hides_a_second_surface() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(400, 300))
    shapes = {
        "noise": noise,
        "two populations": np.where(rng.uniform(size=noise.shape) < 0.4, 4.0, 0.0) + noise,
        "a bias that moved": 5 * rng.uniform(-1, 1, noise.shape) + noise,
        "outliers": noise * np.where(rng.uniform(size=noise.shape) < 0.1, 10.0, 1.0),
    }
    passed = {}
    for name, rows in shapes.items():
        rows -= rows.mean(axis=1, keepdims=True)
        passed[name] = np.mean([is_like_gaussian(r, float(r.std()), 1) for r in rows])
    assert passed["noise"] > 0.97
    assert max(passed[name] for name in shapes if name != "noise") < 0.02


@pytest.mark.parametrize("model", ["sphere", "full"])
@pytest.mark.parametrize("robust", [True, False])
def test_where_all_readings_agree_a_search_finds_nothing_else(monkeypatch, model, robust) -> None:
    searches, search = [], starting_values._relax
    for seed in range(6):
        made = problem(250, seed=seed, noise=0.005, prior=0.1)
        if model == "sphere":
            made = made._replace(points=(made.points - BIAS) @ W.T + BIAS, model=model)
        with monkeypatch.context() as watched:
            watched.setattr(
                starting_values, "_relax", lambda *of, s=seed: searches.append(s) or search(*of)
            )
            agreed = estimate(made, robust=robust)
        with monkeypatch.context() as distrusted:
            distrusted.setattr(maximum_likelihood, "_agrees", lambda *_: False)
            searched = estimate(made, robust=robust)
        moved = agreed.solution.params - searched.solution.params
        sd = np.sqrt(np.diag(searched.solution.covariance))
        assert np.abs(moved / sd).max() < 0.01  # the tolerance of the solver
        assert agreed.noise["magnitude"].sd == pytest.approx(
            searched.noise["magnitude"].sd, rel=1e-4
        )
    assert len(set(searches)) < 2  # one in seventy is taken for something else than noise by chance


def test_an_outlier_that_nothing_contradicts_does_not_count() -> None:
    """A cap of readings, and one far reading that happens to lie on the ellipsoid."""
    cap = problem(4000)
    field = (cap.points - BIAS) @ W.T
    points = cap.points[field[:, 2] > 0.3]
    outlier = np.array([[0.0, 0.0, -1.0]]) @ np.linalg.inv(W).T + BIAS
    gross = points[:5] + 2.0
    with_outliers = cap._replace(points=np.vstack([points, outlier, gross]))
    n = len(points)
    solution = leastsq.solve(
        pieces(with_outliers.subset(np.arange(n)), "magnitude"), FULL, scale=0.01
    )
    weights = np.ones(n + 6)
    weights[n + 1 :] = 0.0
    believed = find_corroborated(with_outliers, solution, weights, 0.01)
    assert not believed[n]
    assert believed[:n].mean() > 0.99
    assert find_corroborated(with_outliers, solution, np.ones(n + 6), 0.01).all()
    assert find_corroborated(with_outliers, solution, np.zeros(n + 6), 0.01).all()


@pytest.mark.parametrize("model", ["sphere", "diagonal", "full"])
@pytest.mark.parametrize("robust", [True, False])
def test_estimate_finds_the_truth(model: str, robust: bool) -> None:
    made = problem(5000, model=model)
    truth = nearest_parameters(BIAS, W, model_basis(model))
    if model != "full":
        matrix = calibration(truth, model)[1]
        points = (made.points - BIAS) @ W.T @ np.linalg.inv(matrix).T + BIAS
        made = made._replace(points=points)
    found = estimate(made, robust=robust)
    error = (found.solution.params - truth) / np.sqrt(np.diag(found.solution.covariance))
    assert np.abs(error).max() < 4
    assert found.noise["magnitude"].sd == pytest.approx(0.01, rel=0.1)
    assert found.noise["magnitude"].correlation == 1.0
    assert len(found.residuals["magnitude"]) == len(found.weights) == 5000


def test_outliers_hardly_move_the_estimate() -> None:
    made = problem(3000)
    clean = estimate(made).solution
    rng = np.random.default_rng(2)
    outliers = rng.choice(3000, 300, replace=False)
    points = made.points.copy()
    points[outliers] += 0.8 * draw_directions(rng, 300)
    found = estimate(made._replace(points=points))
    error = (found.solution.params - clean.params) / np.sqrt(np.diag(clean.covariance))
    assert np.abs(error).max() < 1.5
    assert (found.weights[outliers] == 0).mean() > 0.8
    assert (np.delete(found.weights, outliers) > 0).all()


def test_pull_of_the_prior_is_its_gradient_in_standard_errors() -> None:
    """For matrices one by one, as the prior's own residuals give it, and for all at once."""
    rng = np.random.default_rng(6)
    root = rng.normal(size=(5, 9, 9)) * 0.02
    covariance = root @ np.swapaxes(root, -1, -2)
    skew = rng.normal(0, 0.08, (5, 3, 3))
    matrix = 1.2 * np.eye(3) + skew + np.swapaxes(skew, -1, -2)
    pull = soft_iron_pull(matrix, covariance, 0.1)
    prior = make_prior("full", 0.1)
    assert prior is not None
    for k in range(5):
        residuals, jacobian = prior(nearest_parameters(np.zeros(3), matrix[k], model_basis("full")))
        gradient = residuals @ jacobian
        assert pull[k] == pytest.approx(np.sqrt(gradient @ covariance[k] @ gradient), rel=1e-9)


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_turned_points_give_the_turned_estimate(seed: int) -> None:
    turn = Rotation.random(random_state=seed).as_matrix()
    made = problem(400, seed=seed)
    bias, matrix = calibration(estimate(made, robust=False).solution.params)
    turned = estimate(made._replace(points=made.points @ turn.T), robust=False).solution
    turned_bias, turned_matrix = calibration(turned.params)
    assert turned_bias == pytest.approx(turn @ bias, abs=1e-4)  # stops at 1 % of its sd, 6e-4
    assert turned_matrix == pytest.approx(turn @ matrix @ turn.T, abs=1e-4)


def test_a_start_without_numbers_is_given_up() -> None:
    given = problem(1600, noise=0.006)
    found = estimate(given)
    lost = np.full(len(found.solution.params), 1e200)
    with np.errstate(all="ignore"):
        again = estimate(given, start=lost)
    np.testing.assert_allclose(again.solution.params, found.solution.params, rtol=1e-6)
