"""Where the heading of a log is known, and how well: rows and weights of the azimuth."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.samples import Samples

WORST_DEG = 20.0
"""A heading that is known no better tells nothing of a calibration."""
OTHER_DEG = 1.0
"""What else errs in the azimuth of a row, about: tilt, time, noise of the magnetometer."""
ENOUGH = 0.5


def find_known(samples: Samples) -> Mask:
    """The rows (n,) whose heading is known; all where nothing is said of it.

    >>> find_known(Samples(field=np.ones((2, 3)), heading_sd_deg=[2.0, 180.0])).tolist()
    [True, False]
    """
    if samples.heading_sd_deg is None:
        return np.ones(len(samples), dtype=bool)
    return np.asarray(samples.heading_sd_deg <= WORST_DEG)


def is_known(samples: Samples) -> bool:
    """Whether the heading is there, is not the magnetometer's own, and is known in most rows."""
    there = samples.heading_deg is not None and not samples.heading_estimated
    return there and float(find_known(samples).mean()) >= ENOUGH


def weigh_rows(samples: Samples) -> Array | None:
    """The weight (n,) of each row's azimuth beside a usual one; `None` where all count alike."""
    if samples.heading_sd_deg is None:
        return None
    total = np.hypot(samples.heading_sd_deg, OTHER_DEG)
    usual = float(np.median(total[find_known(samples)])) if find_known(samples).any() else 1.0
    return np.asarray(usual / total)
