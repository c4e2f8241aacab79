"""`round_as_logged`: numbers with the digits that loggers write, for tables that people look at."""

from __future__ import annotations

import numpy as np

from agonic.samples import Samples

DECIMALS = {
    "time": 6,
    "field": 3,
    "second": 3,
    "scalar": 3,
    "acceleration": 5,
    "rotation_rate": 6,
    "roll_deg": 4,
    "pitch_deg": 4,
    "heading_deg": 4,
    "temperature": 3,
    "latitude_deg": 7,
    "longitude_deg": 7,
    "altitude_m": 3,
}
"""Digits behind the point of a column; six elsewhere. All are far below what sensors resolve."""


def round_as_logged(samples: Samples) -> Samples:
    """The samples with each column to a thousandth of what its sensors resolve.

    >>> round_as_logged(Samples(field=[[1 / 3, 2 / 3, 1.0]])).field.tolist()
    [[0.333, 0.667, 1.0]]
    """
    return samples.with_columns(
        **{
            name: np.round(values, DECIMALS.get(name, 6))
            for name, values in samples.columns().items()
        }
    )
