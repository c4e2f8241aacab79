"""Sums of rows by group."""

from __future__ import annotations

import numpy as np
import pytest

from agonic.maths.estimation.inference.linearised import sums_by


@pytest.mark.parametrize("rows", [90, 60_000], ids=["one by one", "run by run"])
def test_sums_are_those_of_the_members(rows: int) -> None:
    group = np.tile(np.arange(rows // 3) * 7 // (rows // 3), 3)  # groups come back, as of channels
    values = np.random.default_rng(0).normal(size=(rows, 2))
    sums = sums_by(group, values, groups=9)
    wanted = [values[group == k].sum(axis=0) for k in range(9)]
    np.testing.assert_allclose(sums, wanted, atol=1e-9)
