"""The weighted median of many values, of which only those near the middle are sorted."""

import numpy as np
import pytest

from agonic.maths.estimation.robust.robust_spread import weighted_median


@pytest.mark.parametrize("far", [1.0, 1e30, np.inf])
def test_it_is_that_of_all_in_order(far):
    """Also where one value lies far away from all others, so that these share a bin."""
    rng = np.random.default_rng(0)
    values, weights = np.r_[rng.normal(size=20_000), far], rng.random(20_001)
    order = np.argsort(values)
    running = np.cumsum(weights[order])
    expected = values[order[np.searchsorted(running, running[-1] / 2)]]
    assert weighted_median(values, weights) == expected
