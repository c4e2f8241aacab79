"""Where the heading of a log is known, and how well: rows and weights of the azimuth."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.one_pass import median
from agonic.samples import Samples

OTHER_DEG = 1.0
"""What else errs in the azimuth of a row, about: tilt, time, noise of the magnetometer."""
ENOUGH = 0.5


def is_known(samples: Samples) -> bool:
    """Whether the heading is there, is not the magnetometer's own, and is known in most rows."""
    there = samples.heading_deg is not None and not samples.heading_estimated
    return there and float(samples.heading_known.mean()) >= ENOUGH


def weigh_rows(samples: Samples) -> Array | None:
    """The weight (n,) of each row's azimuth beside a usual one; `None` where all count alike."""
    if samples.heading_sd_deg is None:
        return None
    total = np.hypot(samples.heading_sd_deg, OTHER_DEG)
    usual = median(total[samples.heading_known]) if samples.heading_known.any() else 1.0
    return np.asarray(usual / total)
