"""Gradient descent beside Levenberg–Marquardt, and the paper's simulation from end to end."""

import json

import numpy as np
import pytest

from agonic.cli import run
from agonic.maths.equation import network
from agonic.network.fit import compare_methods
from agonic.network.fit.methods import descend
from agonic.network.maths import levenberg_marquardt
from agonic.network.simulate import simulate_paper
from agonic.report.axes import Axis


def problem(hidden=3):
    """Few readings of a network's own outputs."""
    rng = np.random.default_rng(3)
    x = rng.uniform(-1, 1, (60, 3))
    made = levenberg_marquardt.Problem(x, rng.uniform(-1, 1, (60, 3)), hidden)
    return made, network.draw_weights(rng, made.shape)


@pytest.mark.parametrize("hidden", [3, (3, 2)])
def test_a_step_is_down_the_gradient(hidden):
    """Δω = −r ∇E, and then that momentum of it; E by differences, not by backpropagation."""
    made, start = problem(hidden)

    def error(weights):
        left = network.forward(network.split(weights, made.shape), made.x) - made.target
        return np.mean(left**2)

    def gradient(weights):
        step = 1e-5
        each = step * np.eye(len(weights))
        return np.array([error(weights + e) - error(weights - e) for e in each]) / (2 * step)

    once = descend(made, start, epochs=1, rate=0.05, momentum=0.5)
    first = -0.05 * gradient(start)
    np.testing.assert_allclose(once.weights - start, first, atol=1e-10)
    twice = descend(made, start, epochs=2, rate=0.05, momentum=0.5)
    second = 0.5 * first - 0.05 * gradient(once.weights)
    np.testing.assert_allclose(twice.weights - once.weights, second, atol=1e-10)
    np.testing.assert_allclose(twice.mean_square, [error(once.weights), error(twice.weights)])


def test_too_high_a_rate_ends_early_and_an_adaptive_one_recovers():
    made, start = problem()
    lost = descend(made, start, epochs=3000, rate=20.0)
    assert len(lost.mean_square) < 3000 or lost.mean_square[-1] > lost.mean_square[0]
    kept = descend(made, start, epochs=3000, rate=20.0, adaptive=True)
    assert kept.mean_square[-1] < 1.05 * descend(made, start, epochs=3000).mean_square[-1]


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [3, (3, 3)])
def test_levenberg_marquardt_needs_a_tenth_of_the_epochs(hidden):
    made = simulate_paper(15.0, seed=2)
    marquardt, descent, adaptive = compare_methods(
        made.samples, made.reference, base=None, hidden=hidden, epochs=1000
    )
    assert marquardt.epochs_to_goal <= 26
    assert descent.epochs_to_goal > 10 * marquardt.epochs_to_goal
    assert adaptive.epochs_to_goal > 5 * marquardt.epochs_to_goal
    assert marquardt.rms < min(descent.rms, adaptive.rms) < 4.0
    assert descent.epochs == len(descent.mean_square) == 1000


@pytest.mark.slow
def test_the_simulation_of_the_paper_is_one_command(tmp_path, capsys):
    assert run(["simulate", "network", "-o", str(tmp_path / "paper"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["epochs"] <= 26 < said["epochs_of_descent"]
    assert said["ground_max_nT"] < 10.0
    assert 28.0 < said["changed_max_nT"] < 36.0
    assert said["retrained_max_nT"] < 10.0
    assert said["regression_in_space"]["2"] == pytest.approx(0.8212, abs=0.01)
    page = (tmp_path / "paper" / "network.html").read_text()
    assert page.count("<figure") == 6
    assert sorted(file.name for file in (tmp_path / "paper").iterdir()) == [
        "flight.csv",
        "flight.reference.csv",
        "ground.json",
        "network.html",
        "retrained.json",
    ]


def test_a_logarithmic_axis_has_equal_ratios_equally_long():
    axis = Axis("nT", 1.0, 1000.0, logarithmic=True)
    np.testing.assert_allclose(
        axis.share(np.array([1.0, 10.0, 100.0, 1e6, 0.1])), [0, 1 / 3, 2 / 3, 1, 0]
    )
    assert axis.ticks().tolist() == [1.0, 10.0, 100.0, 1000.0]
