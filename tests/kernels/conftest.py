"""What the tests of the mathematics share."""

from collections.abc import Callable

import numpy as np
import pytest

Derivative = Callable[..., np.ndarray]


@pytest.fixture(scope="session")
def derivative() -> Derivative:
    """The derivative of a function of a vector by central differences, last axis the vector's."""

    def differences(function: Callable, at: np.ndarray, steps: np.ndarray | float) -> np.ndarray:
        at = np.asarray(at, dtype=float)
        sizes = np.broadcast_to(steps, at.shape)
        columns = [
            (function(at + size * axis) - function(at - size * axis)) / (2 * size)
            for size, axis in zip(sizes, np.eye(len(at)), strict=True)
        ]
        return np.stack(columns, axis=-1)

    return differences
