"""The first-order recursion that Gauss–Markov noise, lags and averages that fade have in common."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array


def autoregress(values: Array, kept: float) -> Array:
    """y_i = x_i + kept · y_{i−1} along the rows of values (n, …), from y_{−1} = 0.

    A triangular solve does it: SciPy's filters would be half a second of loading to every command.
    """
    from scipy.linalg.lapack import dtbtrs  # here, so that what only reads a log loads no SciPy

    band = np.empty((2, len(values)), order="F")
    band[0], band[1] = 1.0, -kept
    return np.asarray(dtbtrs(band, values, uplo="L", diag="U")[0])
