"""What goes with a current or an angle, by linear least squares over stretches of readings.

Of every stretch the mean is one observation on each axis,

    y_j = Σ_c a_c x_c(j) + Σ_r d_r φ_r(t_j) + M b_j + e_j,

x columns of what was set, φ a slow drift (Legendre polynomials of time), b a reference's field
with M what it adds in the magnetometer's axes. Columns that cancel over the stretches, as equal
and opposite currents do, are free of everything else.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander

from agonic.alignment.maths.stretches import Stretches
from agonic.arrays import Array


class Fitted(NamedTuple):
    """Coefficients (c, 3) of the columns, their spread (c, c) for a variance of 1 of a mean of the
    usual count, that variance (3,) by the residuals, and the residuals (k, 3) of weighted means."""

    coefficients: Array
    spread: Array
    variance: Array
    residuals: Array
    freedom: int


def fit_columns(seen: Stretches, columns: Array, drift: int) -> Fitted:
    """Coefficients of columns (k, c) beside a drift of some degree and the reference, if any.

    >>> from agonic.alignment.maths.stretches import average_stretches
    >>> current = np.tile([1.0, -1.0], 6)
    >>> field = np.outer(current, [3.0, 0.0, 4.0]) + [50.0, 0.0, 20.0]
    >>> seen = average_stretches([np.array([k]) for k in range(12)], np.arange(12.0), field)
    >>> (fit_columns(seen, current[:, None], 1).coefficients.round(9) + 0.0).tolist()
    [[3.0, 0.0, 4.0]]
    """
    along = 2 * (seen.time - seen.time[0]) / max(float(seen.time[-1] - seen.time[0]), 1e-9) - 1
    parts = [columns, legvander(along, drift)]
    if seen.beside is not None:
        b = seen.beside.field - seen.beside.field.mean(axis=0)
        parts.append(b / max(float(np.abs(b).max()), 1e-9))
    design, wanted = np.hstack(parts) * seen.weight, seen.field * seen.weight
    # exact copies of a column, as of a reference that never changes, share what they explain
    inverse = np.linalg.pinv(design, rcond=1e-10)
    solution = inverse @ wanted
    left = wanted - design @ solution
    freedom = len(left) - int(np.linalg.matrix_rank(design, tol=1e-8))
    c = columns.shape[1]
    return Fitted(
        solution[:c],
        (inverse @ inverse.T)[:c, :c],
        (left**2).sum(axis=0) / max(freedom, 1),
        left,
        freedom,
    )
