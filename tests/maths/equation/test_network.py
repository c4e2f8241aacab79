"""Networks and their training: Jacobians, closed forms, and SciPy's own Levenberg–Marquardt."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from agonic.maths.equation import network
from agonic.maths.equation.network import Shape
from agonic.maths.estimation import domain
from agonic.network.maths import levenberg_marquardt


def drawn(seed: int, shape: Shape, n: int = 9):
    """Weights, inputs, targets and weights of rows."""
    rng = np.random.default_rng(seed)
    return (
        rng.normal(size=shape.size),
        rng.normal(size=(n, shape.inputs)),
        rng.normal(size=(n, shape.outputs)),
        rng.uniform(size=n),
    )


nodes = st.integers(1, 6)
shapes = st.builds(
    Shape, st.integers(1, 5), st.one_of(nodes, st.tuples(nodes, nodes)), st.integers(1, 4)
)


@given(shapes, st.integers(0, 2**16))
def test_the_jacobian_is_that_of_finite_differences(shape, seed):
    weights, x, _, _ = drawn(seed, shape)
    step = 1e-6
    columns = [
        (
            network.forward(network.split(weights + step * way, shape), x)
            - network.forward(network.split(weights - step * way, shape), x)
        )
        / (2 * step)
        for way in np.eye(shape.size)
    ]
    jacobian = network.jacobian(network.split(weights, shape), x)
    np.testing.assert_allclose(jacobian, np.stack(columns, axis=-1), atol=1e-7)


@given(shapes, st.integers(0, 2**16), st.booleans())
def test_the_sums_are_those_of_the_rows_of_the_jacobian(shape, seed, weighted):
    weights, x, target, row_weight = drawn(seed, shape)
    layers = network.split(weights, shape)
    rows = network.jacobian(layers, x).reshape(-1, shape.size)
    error = (network.forward(layers, x) - target).ravel()
    w = np.repeat(row_weight, shape.outputs) if weighted else np.ones(len(error))
    sums = network.sum_normal_equations(layers, x, target, row_weight if weighted else None)
    assert sums.weight == pytest.approx(row_weight.sum() if weighted else len(x))
    square = network.square_error(layers, x, target, row_weight if weighted else None)
    assert square == pytest.approx(sums.square)
    if not weighted:
        square, gradient = network.sum_gradient(layers, x, target)
        assert square == pytest.approx(sums.square)
        np.testing.assert_allclose(gradient, sums.gradient, atol=1e-10)
    np.testing.assert_allclose(sums.square, error @ (w * error), rtol=1e-12)
    np.testing.assert_allclose(sums.gradient, rows.T @ (w * error), atol=1e-10)
    np.testing.assert_allclose(sums.information, rows.T @ (rows * w[:, None]), atol=1e-10)


@pytest.mark.parametrize("hidden", [4, (3, 2)])
def test_the_sums_of_many_blocks_are_those_of_one(hidden):
    shape = Shape(3, hidden, 3)
    weights, x, target, row_weight = drawn(1, shape, 10_000)
    layers = network.split(weights, shape)
    whole = network.sum_normal_equations(layers, x, target, row_weight)
    halves = [
        network.sum_normal_equations(layers, x[s], target[s], row_weight[s])
        for s in (slice(0, 5000), slice(5000, None))
    ]
    np.testing.assert_allclose(
        whole.information, halves[0].information + halves[1].information, rtol=1e-10, atol=1e-8
    )
    np.testing.assert_allclose(whole.gradient, halves[0].gradient + halves[1].gradient, atol=1e-8)


def test_one_node_is_the_closed_form():
    hidden, output = np.array([[2.0, -1.0]]), np.array([[3.0, 0.5]])
    x = np.linspace(-1, 1, 11)[:, None]
    np.testing.assert_allclose(
        network.forward((hidden, output), x), 3.0 * np.tanh(2.0 * x - 1.0) + 0.5, rtol=1e-15
    )


def test_a_node_turned_about_gives_the_same_outputs():
    """tanh is odd, so a node and what follows it may change their sign together."""
    shape = Shape(3, 4, 2)
    weights, x, _, _ = drawn(3, shape)
    u, v = (a.copy() for a in network.split(weights, shape))
    before = network.forward((u, v), x)
    u[2], v[:, 2] = -u[2], -v[:, 2]
    np.testing.assert_allclose(network.forward((u, v), x), before, atol=1e-12)


def test_two_layers_are_the_closed_form():
    layers = (np.array([[2.0, -1.0]]), np.array([[0.5, 0.2], [-1.0, 0.0]]), np.array([[3, 1, 0.5]]))
    x = np.linspace(-1, 1, 11)[:, None]
    first = np.tanh(2.0 * x - 1.0)
    wanted = 3.0 * np.tanh(0.5 * first + 0.2) + np.tanh(-first) + 0.5
    np.testing.assert_allclose(network.forward(layers, x), wanted, rtol=1e-15)
    assert network.shape_of(layers) == Shape(1, (1, 2), 1)


def made(seed=0, *, n=400, noise=0.02, hidden=3):
    """A problem whose truth is a network of so many nodes."""
    rng = np.random.default_rng(seed)
    shape = Shape(3, hidden, 3)
    truth = network.draw_weights(rng, shape)
    x = rng.uniform(-1, 1, (n, 3))
    target = network.forward(network.split(truth, shape), x)
    return levenberg_marquardt.Problem(
        x, target + noise * rng.normal(size=target.shape), hidden
    ), target


def test_a_step_is_that_of_the_paper():
    """Δω = −(JᵀJ + μI)⁻¹Jᵀe, Eq. 14 of Wang et al. (2020); μ falls tenfold after it helped."""
    problem, _ = made()
    drawn = network.draw_weights(np.random.default_rng(9), problem.shape)
    start = levenberg_marquardt.train(problem, drawn, stopping="plain", most_epochs=6).weights
    rows = network.jacobian(network.split(start, problem.shape), problem.x)
    rows = rows.reshape(-1, len(start))
    error = network.forward(network.split(start, problem.shape), problem.x) - problem.target
    once = levenberg_marquardt.train(problem, start, stopping="plain", most_epochs=1)
    mu = 10 * once.epochs[0].mu
    wanted = -np.linalg.solve(rows.T @ rows + mu * np.eye(len(start)), rows.T @ error.ravel())
    np.testing.assert_allclose(once.weights - start, wanted, rtol=1e-6, atol=1e-9)
    assert np.log10(mu) == pytest.approx(round(np.log10(mu)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "hidden", "room"),
    [(0, 3, 1.01), (1, 3, 1.01), (2, 3, 1.01), (3, 3, 1.01), (1, (3, 3), 1.03)],
)
def test_the_minimum_is_no_worse_than_that_of_scipy(seed, hidden, room):
    """Two layers have flat valleys, in which training ends a little earlier."""
    problem, _ = made(seed, noise=0.05, hidden=hidden)
    start = network.draw_weights(np.random.default_rng(seed + 10), problem.shape)

    def error(weights):
        layers = network.split(weights, problem.shape)
        return (network.forward(layers, problem.x) - problem.target).ravel()

    def jacobian(weights):
        rows = network.jacobian(network.split(weights, problem.shape), problem.x)
        return rows.reshape(-1, len(weights))

    theirs = least_squares(error, start, jac=jacobian, method="lm", xtol=1e-10, ftol=1e-10)
    ours = levenberg_marquardt.train(problem, start, stopping="plain", most_epochs=2000)
    assert (error(ours.weights) ** 2).sum() < room * (error(theirs.x) ** 2).sum()


def test_without_noise_the_truth_is_found():
    problem, target = made(2, noise=0.0)
    start = levenberg_marquardt.choose_start(problem, seed=0, restarts=8).weights
    found = levenberg_marquardt.train(problem, start, stopping="plain", most_epochs=500)
    outputs = network.forward(network.split(found.weights, problem.shape), problem.x)
    assert np.abs(outputs - target).max() < 1e-4


def test_a_row_of_weight_zero_is_as_if_it_were_not_there():
    problem, _ = made()
    keep = np.arange(400) % 3 > 0
    start = network.draw_weights(np.random.default_rng(9), problem.shape)
    few = levenberg_marquardt.train(problem.subset(keep), start, stopping="plain", most_epochs=20)
    weighted = levenberg_marquardt.train(
        problem._replace(weight=keep.astype(float)), start, stopping="plain", most_epochs=20
    )
    np.testing.assert_allclose(weighted.weights, few.weights, rtol=1e-6, atol=1e-8)


def wave(seed: int, n: int = 80, noise: float = 0.3):
    """Few noisy readings of a wave, and the truth on a grid: easy to overfit with 12 nodes."""
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(-1, 1, n))[:, None]
    grid = np.linspace(-0.95, 0.95, 200)[:, None]
    noisy = np.sin(3 * x) + noise * rng.normal(size=x.shape)
    return levenberg_marquardt.Problem(x, noisy, 12), grid, np.sin(3 * grid)


@pytest.mark.parametrize("stopping", ["bayesian", "early"])
def test_overfitting_is_met(stopping):
    """Over ten draws the error to the truth is well below that of training without restraint."""
    ratios = []
    for seed in range(10):
        problem, grid, truth = wave(seed)
        held = np.arange(80) % 4 == 1
        start = network.draw_weights(np.random.default_rng(seed), problem.shape)
        errors = {}
        for name in ("plain", stopping):
            found = levenberg_marquardt.train(
                problem.subset(~held), start, stopping=name, held_out=problem.subset(held)
            )
            outputs = network.forward(network.split(found.weights, problem.shape), grid)
            errors[name] = np.sqrt(np.mean((outputs - truth) ** 2))
        ratios.append(errors[stopping] / errors["plain"])
    assert np.median(ratios) < 0.8, ratios


def test_early_stopping_returns_the_weights_of_the_least_error_held_out():
    problem, _, _ = wave(1)
    held = np.arange(80) % 4 == 1
    unseen = problem.subset(held)
    start = network.draw_weights(np.random.default_rng(1), problem.shape)
    found = levenberg_marquardt.train(
        problem.subset(~held), start, stopping="early", held_out=unseen
    )
    assert found.converged
    outputs = network.forward(network.split(found.weights, problem.shape), unseen.x)
    least = min(epoch.held_out for epoch in found.epochs)
    assert np.mean((outputs - unseen.target) ** 2) <= least * (1 + 1e-9)


def test_the_evidence_finds_the_noise_and_leaves_no_weight_to_noise_alone():
    problem, _ = made(5, n=2000, noise=0.05)
    found = levenberg_marquardt.train(
        problem, levenberg_marquardt.choose_start(problem, seed=5, restarts=4).weights
    )
    assert 1 / np.sqrt(found.precision) == pytest.approx(0.05, rel=0.05)
    nothing = problem._replace(target=np.random.default_rng(1).normal(size=(2000, 3)))
    idle = levenberg_marquardt.train(
        nothing, levenberg_marquardt.choose_start(nothing, seed=5, restarts=4).weights
    )
    outputs = network.forward(network.split(idle.weights, problem.shape), problem.x)
    assert np.sqrt(np.mean(outputs**2)) < 0.1
    assert idle.effective < 15


def test_correlated_rows_make_weights_less_sure():
    problem, _ = made(6, n=1000)
    start = levenberg_marquardt.choose_start(problem, seed=6, restarts=2).weights
    alone = levenberg_marquardt.train(problem, start)
    alike = levenberg_marquardt.train(problem._replace(correlation=4.0), start)
    ratio = np.median(np.sqrt(np.diag(alike.covariance) / np.diag(alone.covariance)))
    assert ratio == pytest.approx(2.0, rel=0.2)


def test_a_warm_start_needs_few_epochs():
    problem, _ = made(7)
    first = levenberg_marquardt.train(
        problem, levenberg_marquardt.choose_start(problem, seed=7, restarts=4).weights
    )
    again = levenberg_marquardt.train(problem, first.weights, ridge=first.ridge)
    assert len(again.epochs) <= len(first.epochs)
    assert len(again.epochs) <= 2 * levenberg_marquardt.PATIENCE
    assert again.mean_square == pytest.approx(first.mean_square, rel=1e-2)


@given(st.integers(0, 2**16), st.integers(1, 4), st.integers(2, 20))
def test_every_point_is_within_reach_of_a_centre(seed, dimensions, most):
    points = np.random.default_rng(seed).normal(size=(60, dimensions))
    centres, reach = domain.cover(points, most)
    assert len(centres) <= most
    distance = np.linalg.norm(points[:, None] - centres, axis=2).min(axis=1)
    np.testing.assert_allclose(domain.compute_distances(points, centres), distance, atol=1e-6)
    assert distance.max() == pytest.approx(reach)


def test_the_cover_is_no_more_than_twice_the_best():
    """Gonzalez (1985). On a grid of 8 points two centres reach 1.5 at best, between points 2."""
    points = np.arange(8.0)[:, None]
    _, reach = domain.cover(points, 2)
    assert reach <= 2 * 1.5


def test_inside_falls_smoothly_from_one_to_zero():
    distance = np.linspace(0, 3, 3001)
    share = domain.taper(distance, 1.0)
    slope = np.diff(share) / np.diff(distance)
    assert (share[distance <= 1] == 1).all()
    assert (share[distance >= 2] == 0).all()
    assert (slope <= 0).all()
    assert np.abs(np.diff(slope)).max() < 0.01  # no corner


def test_what_a_model_missed_is_told_from_noise():
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (2000, 2))
    missed = 0.5 * np.sin(3 * x[:, :1])
    found, error = domain.estimate_neighbour_covariance(missed + rng.normal(size=missed.shape), x)
    assert found == pytest.approx(float(np.mean(missed**2)), abs=4 * error)
    nothing, error = domain.estimate_neighbour_covariance(rng.normal(size=missed.shape), x)
    assert abs(nothing) < 4 * error
