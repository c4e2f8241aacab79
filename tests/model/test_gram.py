"""Whitening by any filter is one convolution, whatever the block."""

import numpy as np
import pytest

from agonic.model.gram import Stack, add_up, whiten


@pytest.mark.parametrize("lags", [0, 1, 10, 11, 12])
@pytest.mark.parametrize(("first", "last"), [(0, 40), (3, 50), (70, 200)])
def test_a_block_is_filtered_with_the_rows_before_it(lags: int, first: int, last: int) -> None:
    rng = np.random.default_rng(lags)
    rows, by = rng.normal(size=(4, 200)), np.append(1.0, rng.normal(size=lags))
    whole = np.stack([np.convolve(row, by)[:200] for row in rows])
    assert whiten(rows, by, first, last) == pytest.approx(whole[:, first:last], abs=1e-12)


def test_sums_of_blocks_are_the_products_of_whitened_columns() -> None:
    rng = np.random.default_rng(0)
    rows, by = rng.normal(size=(3, 300)), np.array([1.0, -0.7, 0.2])
    white = np.stack([np.convolve(row, by)[:300] for row in rows])
    found = add_up([Stack("magnitude", rows)], [by])
    assert found.sums.sum(axis=1)[0] == pytest.approx(white @ white.T, rel=1e-10)
