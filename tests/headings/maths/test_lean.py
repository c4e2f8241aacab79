"""A lean of the tilt's sensor that the dip shows is counted, and never less than was known."""

import numpy as np

from agonic.headings.maths.lean import find_lean_covariance

TIME = np.arange(0.0, 200.0, 0.1)
TRUE = np.radians([1.5, -2.5, 0.0])
SD = np.radians(0.5)


def look(true: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    heading = TIME / 10.0
    north = np.stack([np.cos(heading), -np.sin(heading), 0 * heading], axis=1)
    residual = north @ true + np.radians(0.5) * rng.standard_normal(len(heading))
    every = np.ones(len(TIME), bool)
    return find_lean_covariance(TIME, residual, north, every, SD, np.radians(0.2))


def test_a_lean_that_turns_show_is_counted_and_what_hides_is_as_large() -> None:
    for seed in range(3):
        found = look(TRUE, seed)
        assert TRUE @ np.linalg.solve(found, TRUE) < 3.0
        assert np.linalg.eigvalsh(found)[0] >= 0.99 * SD**2
        assert found[2, 2] > np.radians(1.0) ** 2


def test_what_is_no_larger_than_known_beforehand_is_left_as_it_is() -> None:
    assert np.allclose(look(0.0 * TRUE, 0), SD**2 * np.eye(3))
