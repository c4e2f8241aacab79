"""The likeliest path through hidden states."""

import numpy as np
import pytest

from agonic.maths.estimation.changes.hidden_states import find_path


def test_a_path_is_the_cheapest_of_all() -> None:
    """Against every path through two states of eight rows."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        cost, price = rng.uniform(0, 2, (2, 8)), 0.7
        paths = (np.arange(256)[:, None] >> np.arange(8)) & 1
        sums = cost[paths, np.arange(8)].sum(axis=1) + price * np.abs(np.diff(paths)).sum(axis=1)
        found = find_path(cost, price)
        assert sums.min() == pytest.approx(sums[(paths == found).all(axis=1)][0])
