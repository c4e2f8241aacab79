"""`Chain`: steps that meet, applied in order, and composed to one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.interference import Interference
from agonic.simulation import random_calibration

MOUNTING = ag.alignment.Alignment(rotation=Rotation.from_euler("ZYX", [90, 10, -170], degrees=True))
PLAIN = ag.Affine(bias=[1.0, 2, 3], matrix=np.eye(3), sensor="MAG2")


def test_steps_are_applied_in_order() -> None:
    raw = np.random.default_rng(0).normal(size=(10, 3))
    expected = MOUNTING.rotation.apply(raw - PLAIN.bias)
    assert ag.Chain(steps=(PLAIN, MOUNTING)).correct(raw) == pytest.approx(expected)


@given(st.integers(0, 2**32 - 1))
def test_one_step_says_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    later = replace(random_calibration(rng), frame_in="b", frame_out="b")
    chain = ag.Chain(steps=(random_calibration(rng), MOUNTING, later))
    raw = 50_000 * rng.normal(size=(10, 3))
    assert chain.composed.correct(raw) == pytest.approx(chain.correct(raw), abs=1e-4)  # nT
    mr, mr0 = chain.composed.multiplied_out
    assert raw @ mr.T + mr0 == pytest.approx(chain.correct(raw), abs=1e-4)
    assert (chain.composed.frame_in, chain.composed.frame_out) == ("m", "b")


def test_sources_of_several_steps_add() -> None:
    rng = np.random.default_rng(3)
    plain = random_calibration(rng)
    motors = Interference(
        bias=plain.bias,
        matrix=plain.matrix,
        sources=("current_A", "second"),
        coefficients=rng.normal(size=(3, 4)) * [100, 0.3, 0.3, 0.3],
    )
    later = Interference(
        bias=[5.0, 0, 0],
        matrix=np.eye(3) * 1.1,
        frame_in="b",
        frame_out="b",
        sources=("current_A",),
        coefficients=[[30.0], [0], [-20.0]],
    )
    chain = ag.Chain(steps=(motors, MOUNTING, later))
    raw, second = 50_000 * rng.normal(size=(2, 10, 3))
    columns = {"current_A": rng.uniform(0, 40, 10), "second": second}
    assert set(chain.composed.needs) == set(chain.needs) == set(columns)
    expected = chain.correct(raw, **columns)
    assert chain.composed.correct(raw, **columns) == pytest.approx(expected, abs=1e-4)


def test_nothing_is_carried_through_a_singular_step() -> None:
    flat = ag.Affine(bias=[0, 0, 0], matrix=np.diag([1.0, 1.0, 0.0]))
    with pytest.raises(ag.AgonicError, match="singular"):
        _ = ag.Chain(steps=(flat, PLAIN)).composed


def test_ends_of_the_chain_are_those_of_its_ends() -> None:
    counts = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3), unit_in="raw", sensor="MAG2")
    chain = ag.Chain(steps=(counts, MOUNTING))
    assert (chain.unit_in, chain.unit_out) == ("raw", "nT")
    assert (chain.frame_in, chain.frame_out) == ("m", "b")
    assert chain.sensor == "MAG2"
    assert chain.equation == f"{counts.equation}; then {MOUNTING.equation}"


def test_steps_must_meet() -> None:
    with pytest.raises(ag.AgonicError, match="at least one step"):
        ag.Chain(steps=())
    with pytest.raises(ag.FrameError, match="b does not meet m"):
        ag.Chain(steps=(MOUNTING, PLAIN))
    with pytest.raises(ag.UnitError, match="nT into raw"):
        ag.Chain(steps=(PLAIN, ag.alignment.Alignment(rotation=Rotation.identity(), unit_in="raw")))


def test_its_uncertainty_is_the_scatter_of_many_draws() -> None:
    """Of a bias and matrix, and of the mounting behind them."""
    rng = np.random.default_rng(3)
    own = ag.Affine(
        bias=[400.0, -300.0, 100.0],
        matrix=np.eye(3) + 0.05 * rng.standard_normal((3, 3)),
        covariance=np.diag([9.0, 16.0, 25.0, *([1e-8] * 9)]),
        gauge="free",
    )
    turn = ag.alignment.Alignment(
        rotation=Rotation.from_rotvec([0.3, -0.4, 1.1]),
        covariance=np.diag([1e-8, 4e-8, 9e-8]),
        frame_in="m",
    )
    raw = np.array([[20_000.0, -30_000.0, 25_000.0]])
    drawn = []
    for _ in range(4000):
        off = rng.standard_normal(12) * np.sqrt(np.diag(own.covariance))
        matrix = own.matrix + off[3:].reshape(3, 3)
        field = (raw - own.bias - off[:3]) @ matrix.T
        wobble = Rotation.from_rotvec(rng.standard_normal(3) * np.sqrt(np.diag(turn.covariance)))
        drawn.append((wobble * turn.rotation).apply(field)[0])
    expected = np.cov(np.array(drawn).T)
    found = ag.Chain(steps=(own, turn)).uncertainty(raw)[0]
    assert np.abs(found - expected).max() < 0.08 * np.abs(expected).max()
