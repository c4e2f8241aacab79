"""The noise of a force, also of stretches far shorter than what the low-pass lets through."""

from __future__ import annotations

import numpy as np
import pytest

from agonic.maths.rotations.low_pass import measure_force_variance


def force_variance(n: int, seed: int) -> float:
    force = np.random.default_rng(seed).normal(size=(n, 3))
    return measure_force_variance(force, np.ones((n, 3, 1)), 0.01, 3.0)


def test_white_noise_has_the_variance_of_its_rows() -> None:
    found = [force_variance(6000, seed) for seed in range(8)]
    assert np.mean(found) == pytest.approx(1.0, abs=0.2)


def test_a_stretch_of_a_few_rows_says_little_and_never_fails() -> None:
    for n in (8, 13, 16, 20, 31):
        assert 0.0 <= force_variance(n, 0) < 1.0
