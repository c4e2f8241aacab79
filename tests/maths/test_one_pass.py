"""The median and lengths beside NumPy's own."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from agonic.maths.one_pass import find_length, median

NUMBERS = st.floats(-1e9, 1e9) | st.just(float("nan"))


@given(arrays(float, array_shapes(max_dims=2, max_side=9), elements=NUMBERS))
def test_median_is_that_of_numpy_to_the_last_bit(values: np.ndarray) -> None:
    assert np.array_equal(median(values), np.median(values), equal_nan=True)


def test_lengths_of_rows_and_of_one_vector() -> None:
    vectors = np.random.default_rng(0).normal(size=(5, 7, 3))
    np.testing.assert_allclose(find_length(vectors), np.linalg.norm(vectors, axis=-1), rtol=1e-15)
    assert find_length(vectors[0, 0]).shape == ()
