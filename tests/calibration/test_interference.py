"""`Interference`: the equation with sources, its uncertainty, and what it is with them held."""

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference, mean_of, signals
from agonic.errors import AgonicError, LogError

W = np.array([[1.1, 0.05, -0.1], [0.02, 0.9, 0.08], [-0.1, 0.03, 1.0]])
K = np.array([[10.0, 0.1, 0.2, 0.0], [-5.0, 0.0, -0.3, 0.1], [7.0, 0.2, 0.0, 0.4]])


def mixed(**more) -> Interference:
    return Interference(
        bias=[100.0, -200.0, 50.0],
        matrix=W,
        gauge="free",
        sources=("current_A", "second"),
        coefficients=K,
        **more,
    )


def test_the_correction_is_the_equation() -> None:
    raw, second = np.array([1000.0, 2000.0, 3000.0]), np.array([900.0, 2100.0, 2800.0])
    x = np.concatenate([[4.0], second])
    expected = W @ (raw - [100.0, -200.0, 50.0] - K @ x)
    found = mixed().correct([raw], current_A=[4.0], second=[second])
    assert found == pytest.approx(expected[None])
    assert mixed().at(x).correct([raw]) == pytest.approx(expected[None])


def test_uncertainty_is_that_of_many_draws() -> None:
    rng = np.random.default_rng(0)
    root = (
        rng.normal(size=(24, 24))
        * np.concatenate([[3.0] * 3, [1e-3] * 9, [0.5, 1e-3, 1e-3, 1e-3] * 3])[:, None]
    )
    covariance = root @ root.T / 24
    base = mixed(covariance=covariance)
    raw, columns = (
        np.array([[20_000.0, 3000.0, -4000.0]]),
        {
            "current_A": np.array([6.0]),
            "second": np.array([[19_000.0, 3500.0, -4500.0]]),
        },
    )
    order = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)]
    fields = []
    for step in rng.multivariate_normal(np.zeros(24), covariance, 4000):
        matrix = W.copy()
        for k, at in enumerate(order):
            matrix[at] += step[3 + k]
        fields.append(
            Interference(
                bias=base.bias + step[:3],
                matrix=matrix,
                gauge="free",
                sources=base.sources,
                coefficients=K + step[12:].reshape(3, 4),
            ).correct(raw, **columns)[0]
        )
    assert base.uncertainty(raw, **columns)[0] == pytest.approx(
        np.cov(np.array(fields).T), abs=40.0
    )
    held = base.at(np.array([6.0, 19_000.0, 3500.0, -4500.0]))
    assert held.uncertainty(raw) == pytest.approx(base.uncertainty(raw, **columns), rel=1e-9)


def test_a_missing_source_is_named() -> None:
    samples = ag.Samples(field=[[1.0, 2.0, 3.0]], current_A=[1.0])
    with pytest.raises(LogError, match="second"):
        ag.apply(mixed(), samples)
    with pytest.raises(AgonicError, match="volts a"):
        Interference(bias=np.zeros(3), matrix=W, sources=("volts a",), coefficients=K)
    with pytest.raises(AgonicError, match="coefficients"):
        Interference(bias=np.zeros(3), matrix=W, sources=("throttle",), coefficients=K)


def test_the_mean_of_two_opposite_sensors_forgets_the_current() -> None:
    """The seed's compensation: the disturbance is equal and opposite at the two sensors."""
    rng = np.random.default_rng(1)
    first = Affine(bias=[300.0, -100.0, 50.0], matrix=np.eye(3) * 1.1)
    second = Affine(bias=[-900.0, 400.0, 10.0], matrix=np.diag([0.9, 1.0, 1.2]), sensor="mag2")
    field = rng.normal(size=(50, 3)) * 30_000
    stray = np.outer(rng.uniform(0, 30, 50), [60.0, -35.0, 90.0])
    raw = np.linalg.solve(first.matrix, (field + stray).T).T + first.bias
    other = np.linalg.solve(second.matrix, (field - stray).T).T + second.bias
    both = mean_of(first, second)
    assert both.correct(raw, second=other) == pytest.approx(field, abs=1e-6)
    assert np.abs(first.correct(raw) - field).max() > 1000.0


def test_signals_name_every_number() -> None:
    assert signals(("throttle", "second")) == ("throttle", "second_x", "second_y", "second_z")
    assert len(mixed().parameters) == 24
