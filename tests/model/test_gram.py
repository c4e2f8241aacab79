"""Whitening by any number of lags is one convolution, and what it is for: sums of products."""

import numpy as np
import pytest

from agonic.model.gram import Blocks, whiten


@pytest.mark.parametrize("lags", [0, 1, 10, 11, 12])
def test_rows_are_filtered_by_any_number_of_lags(lags: int) -> None:
    rng = np.random.default_rng(lags)
    rows, by = rng.normal(size=(4, 200)), np.append(1.0, rng.normal(size=lags))
    whole = np.stack([np.convolve(row, by)[:200] for row in rows])
    assert whiten(rows, by) == pytest.approx(whole, abs=1e-12)


def test_sums_over_blocks_are_the_products_of_whitened_columns() -> None:
    rng = np.random.default_rng(0)
    rows, by = rng.normal(size=(5, 300)), np.append(1.0, rng.normal(size=12) / 10)
    white = np.stack([np.convolve(row, by)[:300] for row in rows])
    found = Blocks([whiten(rows, by)], np.linspace(0, rows.shape[1], 17).astype(int), 1.0).add()[0]
    plain = np.r_[:4, -1]
    assert found[np.ix_(plain, plain)] == pytest.approx(white @ white.T, rel=1e-10)
