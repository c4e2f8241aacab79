"""Splines along tracks: how few places are evaluated, and that nothing else changes."""

from collections.abc import Callable

import numpy as np

from agonic.field.world_model import TOLERANCE_NT, evaluate_along_track

Rows = np.ndarray


def counted(vectors: np.ndarray) -> tuple[Callable[[Rows], np.ndarray], list[int]]:
    """A source of exact vectors that notes how many were asked for."""
    asked: list[int] = []

    def exact(rows: Rows) -> np.ndarray:
        asked.append(len(rows))
        return vectors[:, rows]

    return exact, asked


def smooth(time: np.ndarray, period: float) -> np.ndarray:
    return 5e4 * np.stack([np.sin(2 * np.pi * time / period + k) for k in range(3)])


def test_a_smooth_track_is_evaluated_at_few_rows() -> None:
    time = np.arange(0.0, 3600.0, 0.05)
    vectors = smooth(time, 20_000.0)
    exact, asked = counted(vectors)
    assert np.abs(evaluate_along_track(time, exact) - vectors).max() < TOLERANCE_NT
    assert sum(asked) < len(time) / 90


def test_a_livelier_track_gets_closer_nodes() -> None:
    time = np.arange(0.0, 600.0, 0.05)
    vectors = smooth(time, 2000.0)
    exact, asked = counted(vectors)
    assert np.abs(evaluate_along_track(time, exact) - vectors).max() < TOLERANCE_NT
    assert 3600 / 20 < sum(asked) < len(time) / 4


def test_a_rough_track_is_evaluated_everywhere() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 600.0, 0.05)
    vectors = smooth(time, 20_000.0) + rng.normal(0.0, 1.0, (3, len(time)))
    exact, _ = counted(vectors)
    assert np.array_equal(evaluate_along_track(time, exact), vectors)


def test_a_gap_and_a_jump_across_it_spoil_nothing() -> None:
    time = np.arange(0.0, 1200.0, 0.02)
    time[20_000:] += 5000.0
    vectors = smooth(time, 20_000.0)
    vectors[:, 20_000:] += 1e4
    exact, asked = counted(vectors)
    assert np.abs(evaluate_along_track(time, exact) - vectors).max() < TOLERANCE_NT
    assert sum(asked) < len(time) / 50


def test_sparse_rows_are_evaluated_at_once() -> None:
    rng = np.random.default_rng(4)
    for time in (np.arange(0.0, 86400.0, 60.0), np.arange(0.0, 1000.0, 1.0), np.zeros(1)):
        vectors = rng.normal(size=(3, len(time)))
        exact, asked = counted(vectors)
        assert np.array_equal(evaluate_along_track(time, exact), vectors)
        assert asked == [len(time)]
