"""Which sensors of a dataset need their rows: where these would change what the moments say."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from agonic.arrays import Array, Mask
from agonic.ellipsoid.many_sensors import Fits
from agonic.health import FEWEST
from agonic.health.mounting import VERTICAL_DOUBTFUL
from agonic.health.scale import GAIN
from agonic.logs.large.grouped_moments import Grouped
from agonic.logs.large.grouped_residuals import GroupedResiduals
from agonic.maths.equation.priors import soft_iron_pull

HEADING_SD_DEG = 0.5
"""Beyond, two halves of a log may disagree by the 2° that a check allows."""
NOISE = 0.02
"""Of the field: beyond, the weights of adjusted and of likely fits differ, and checks may fail."""
PRIOR_SD = 0.1
"""The prior on soft iron of `fit_ellipsoid`."""
PULL = 0.2
"""Standard errors by which that prior may move a result."""
KURTOSIS = 5.0
"""Of residuals; 3 for Gaussian noise, whose 200 readings exceed 5 once in two thousand times."""
CHANGED = 18.0
"""Of Σ |Σ r û|²/(n σ²) over eight blocks; 8 or less for white noise of one field."""
AT_ENDS = 0.02
"""Share of readings at an end of an axis's range."""
LEFT_OUT = 0.01
VERTICAL = 0.6 * VERTICAL_DOUBTFUL


def find_doubts(
    fits: Fits, grouped: Grouped, residuals: GroupedResiduals, *, unit: str
) -> Mapping[str, Mask]:
    """The sensors (n,) to be fitted to their rows, by the reason.

    Parameters: what the moments gave, the sums they were, the residuals of those fits, and the
    unit of the readings.
    """
    count = grouped.count
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = residuals.sd
        gain = np.trace(fits.matrix, axis1=1, axis2=2) / 3
        limit = np.sqrt(2 * np.log(2 * np.maximum(count, 1))) + 1
        return {
            "no fit": ~fits.fitted,
            "few readings": count < 2 * FEWEST,
            "rows left out": grouped.left_out > LEFT_OUT * (count + grouped.left_out),
            "scale": (unit == "nT") & ~((gain > GAIN[0]) & (gain < GAIN[1])),
            "coverage": ~(fits.heading_sd_deg < HEADING_SD_DEG),
            "noise": ~(relative < NOISE),
            "prior": ~(_compute_pull(fits) < PULL),
            "outliers": (residuals.largest.max(axis=1) > limit * relative)
            | (residuals.fourths.sum(axis=1) > KURTOSIS * count * relative**4),
            "changed": ~(_compute_changes(residuals) < CHANGED),
            "clipping": grouped.at_ends > np.maximum(12, AT_ENDS * count),
            "axes": residuals.vertical > VERTICAL,
        }


def _compute_changes(residuals: GroupedResiduals) -> Array:
    """How much more than noise the blocks of each sensor pull its bias, (n,).

    In a block of white residuals E|Σ r û|² = n σ²; a bias that differs there adds to it, and so
    does noise that lasts.
    """
    expected = np.maximum(residuals.count, 1) * residuals.sd[:, None] ** 2
    return np.asarray(((residuals.pull**2).sum(axis=2) / expected).sum(axis=1))


def _compute_pull(fits: Fits) -> Array:
    """By how many standard errors the prior on soft iron would move each result, (n,)."""
    fitted = fits.fitted
    pull = np.full(len(fits), np.nan)
    pull[fitted] = soft_iron_pull(fits.matrix[fitted], fits.covariance[fitted], PRIOR_SD)
    return pull
