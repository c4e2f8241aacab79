"""Readings of a size that no sensor gives."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Mask
from agonic.health.finding import Finding, figure
from agonic.maths.one_pass import median
from agonic.samples import Samples

GROSS = 10_000
"""Times the size of most readings: beyond every range that a sensor has."""
DOUBTFUL = 0.01
"""Of the readings: a logger that damages more asks for a look."""


def find_gross_readings(samples: Samples) -> tuple[Mask, Finding] | None:
    """The rows (n,) so much larger than most that beside them all others look like one reading, and
    what is said of them; None where there are none.

    >>> field = np.array([[5e4, 0, 0], [0, 4e4, 0], [0, 1e12, 0]])
    >>> rows, finding = find_gross_readings(Samples(field=field))
    >>> rows.tolist(), finding.severity
    ([False, False, True], 'check')
    """
    size = np.maximum.reduce([np.abs(axis) for axis in samples.field.T])
    most = median(size) if len(size) else 0.0
    gross = np.asarray(size > GROSS * most)
    if not most or not gross.any():
        return None
    share = float(gross.mean())
    doubtful = share > DOUBTFUL
    return gross, Finding(
        "outliers",
        "check" if doubtful else "note",
        f"{int(gross.sum())} readings ({figure(100 * share)} %) are over {GROSS} times as large as "
        "most, which no sensor gives, and were left out",
        "look at the logger and at what reads it" if doubtful else "",
    )
