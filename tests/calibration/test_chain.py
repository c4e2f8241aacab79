"""`Chain`: steps that meet, applied in order, and multiplied out to twelve numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.simulation import random_calibration

MOUNTING = ag.Alignment(rotation=Rotation.from_euler("ZYX", [90, 10, -170], degrees=True))
PLAIN = ag.Affine(bias=[1.0, 2, 3], matrix=np.eye(3), sensor="MAG2")


def test_steps_are_applied_in_order() -> None:
    raw = np.random.default_rng(0).normal(size=(10, 3))
    expected = MOUNTING.rotation.apply(raw - PLAIN.bias)
    assert ag.Chain(steps=(PLAIN, MOUNTING)).correct(raw) == pytest.approx(expected)


@given(st.integers(0, 2**32 - 1))
def test_twelve_numbers_say_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = ag.Chain(steps=(random_calibration(rng), MOUNTING))
    mr, mr0 = chain.multiplied_out
    raw = 50_000 * rng.normal(size=(10, 3))
    assert raw @ mr.T + mr0 == pytest.approx(chain.correct(raw), abs=1e-4)  # nT


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
        ag.Chain(steps=(PLAIN, ag.Alignment(rotation=Rotation.identity(), unit_in="raw")))
