"""The names of arrays in all signatures; a row is a sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers; the shape stands in the docstring."""

Mask = NDArray[np.bool_]
"""True for the rows that are meant."""

Index = NDArray[np.intp]
"""Numbers of rows, from zero."""
