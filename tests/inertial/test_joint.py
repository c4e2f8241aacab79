"""The joint estimate: gradients are those of the cost, and block-tridiagonal systems whole."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.inertial import solve
from agonic.inertial.maths.factors import sum_force, sum_rate, sum_readings, take_out
from agonic.maths.estimation.filters import block_tridiagonal
from agonic.maths.rotations.track import find_attitudes
from tests.inertial.drives import drive


def test_blocks_of_the_inverse_are_those_of_the_whole() -> None:
    rng = np.random.default_rng(0)
    below = rng.normal(size=(5, 3, 3))
    matrix = block_tridiagonal.Tridiagonal(np.tile(9 * np.eye(3), (6, 1, 1)), below)
    whole = np.kron(np.eye(6), 9 * np.eye(3))
    for k, block in enumerate(below):
        rows, columns = slice(3 * k + 3, 3 * k + 6), slice(3 * k, 3 * k + 3)
        whole[rows, columns], whole[columns, rows] = block, block.T
    inverse, found = np.linalg.inv(whole), block_tridiagonal.invert(matrix)
    for k in range(6):
        np.testing.assert_allclose(found.diagonal[k], inverse[3 * k :, 3 * k :][:3, :3])
    np.testing.assert_allclose(found.below[2], inverse[9:12, 6:9])
    right = rng.normal(size=(6, 3, 2))
    solved = np.linalg.solve(whole, right.reshape(18, 2)).reshape(6, 3, 2)
    found_right, log_determinant = block_tridiagonal.solve(matrix, right)
    np.testing.assert_allclose(found_right, solved)
    assert log_determinant == pytest.approx(np.linalg.slogdet(whole)[1])


@pytest.fixture
def asked(monkeypatch):
    """Fits a log, and returns what that asks of the joint estimate."""
    given = []

    def spy(*arguments):
        given.append(arguments)
        return estimate(*arguments)

    estimate = solve.estimate_jointly
    monkeypatch.setattr(solve, "estimate_jointly", spy)

    def ask(logged, place, **settings):
        ag.fit_inertial(logged, place, **settings)
        return given[0]

    return ask


@pytest.mark.slow
def test_gradients_are_those_of_the_cost(asked) -> None:
    _, logged, place = drive("boat", 1, n=600, rate_Hz=10.0)
    gap = (logged.time > 20.0) & (logged.time < 25.0)
    given = asked(logged.select(~gap), place, accelerometer_scale_sd=0.05)
    problem, log, params, start, usable, *_ = given
    log = log._replace(settling_s=0.0)  # smoothed, neither states nor speed act at once
    rng = np.random.default_rng(0)
    params = np.concatenate([params, np.zeros(len(log.gains))])
    params = params + 0.01 * rng.standard_normal(len(params))
    felt = take_out(log, params)
    assert not felt.track.joined.all()  # over the gap
    states = start[felt.track.nodes]

    def sums(params, move):
        felt = take_out(log, params)
        there = Rotation.from_rotvec(move).as_matrix() @ states
        attitudes = find_attitudes(felt.track, there)
        readings, *_ = sum_readings(problem, felt, attitudes, params, usable)
        rates, _ = sum_rate(log, felt, there, attitudes, np.linspace(0.5, 1.0, len(there) - 1))
        return readings, sum_force(log, felt, attitudes), rates

    still, step = np.zeros((len(states), 3)), 1e-5
    of_gyro = range(felt.unit + 3, felt.unit + 9)
    for kind, group in enumerate(sums(params, still)):
        own = group.own.sum(axis=0)
        for k in range(len(params)):
            # left to the rates, for the others see the states; a scale stretches the rate of these
            if k in (of_gyro if kind < 2 else of_gyro[3:]):
                continue
            move = step * np.eye(len(params))[k]
            costs = [sums(params + side * move, still)[kind].cost for side in (1, -1)]
            slope = (costs[0] - costs[1]) / (4 * step)
            assert own[k] == pytest.approx(slope, rel=0.1, abs=2e-3 * np.abs(own).max()), (kind, k)
        for k in (0, 7, len(states) - 1):
            move = still.copy()
            move[k] = step * rng.standard_normal(3)
            costs = [sums(params, side * move)[kind].cost for side in (1, -1)]
            slope = (costs[0] - costs[1]) / 4
            wanted = float(group.gradient[k] @ move[k])
            assert wanted == pytest.approx(slope, rel=0.1, abs=1e-4 * step * group.size)


@pytest.mark.slow
def test_an_accelerometer_that_stretches_is_found_on_request() -> None:
    made, logged, place = drive("tumble", n=3000)
    gain = np.eye(3) + np.array([[0.03, 0.01, 0.0], [0.0, -0.02, 0.0], [-0.01, 0.0, 0.01]])
    bent = logged.with_columns(acceleration=logged.acceleration @ gain.T)
    fit = ag.fit_inertial(bent, place, accelerometer_scale_sd=0.05)
    assert fit.accelerometer_gain is not None
    np.testing.assert_allclose(fit.accelerometer_gain, gain, atol=0.004)
    assert (np.abs(fit.calibration.bias - made.truth.bias) < 4 * fit.sd[:3]).all()


@pytest.mark.slow
def test_the_noise_of_gyro_and_accelerometer_is_what_they_have(asked) -> None:
    _, logged, place = drive("tumble", 2, n=5000, rate_Hz=25.0)
    problem, log, *rest = asked(logged, place)
    found = solve.estimate_jointly(problem, log, *rest)
    jittered = log._replace(rate_sd=6 * log.rate_sd)  # as differences see a motion that jitters
    again = solve.estimate_jointly(problem, jittered, *rest)
    stated = np.array([0.02, 8.7e-4]) * np.sqrt(25.0)
    np.testing.assert_allclose(found.sds[1:3] / stated, 1.0, atol=0.35)
    np.testing.assert_allclose(again.sds[2] / found.sds[2], 1.0, atol=0.05)
