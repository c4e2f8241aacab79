"""What the residuals of a flight go with, and what that points to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.inflight.report.flight import Flight
from agonic.maths.estimation.noise.residuals import robust_scale

NAMED = 0.1
"""Share of the variance from which a cause is named."""
_BINS = 12
_CLIP = 4.0  # standard deviations at which an outlier counts no more


@dataclass(frozen=True, kw_only=True)
class Share:
    """How much of the residuals' variance goes with something, 0…1, and what that points to."""

    what: str
    share: float
    cause: str

    @property
    def named(self) -> bool:
        """Whether it stands out."""
        return self.share >= NAMED


CAUSES = {
    "time": "a bias that drifts: allow it more knots, or a larger walk",
    "latitude": "what the field model leaves out (the auroral zones, the ring current), or gains "
    "and cross terms that are fixed: solve for more, or leave out high latitudes",
    "temperature": "a bias or gains that change with temperature: start from a calibration over "
    "temperature, or let the bias depend on it",
    "shadow": "currents that flow in sunlight only, as of solar panels, or the cold of the "
    "shadow: record the current as a column current_A",
}


def explain(flight: Flight) -> list[Share]:
    """The shares, largest first, each corrected for what chance alone would explain.

        1 − (1 − R²)(m − 1)/(m − k),   m = readings over those that count as one

    with R² from the means of k classes (adjusted R²: Theil, Economic Forecasts and Policy, 1961).
    """
    rows = flight.used
    values = flight.residuals[rows]
    if len(values) < 2 * _BINS:
        return []
    scale = _CLIP * max(robust_scale(values - np.median(values)), 1e-12)
    values = np.clip(values - np.median(values), -scale, scale)
    alone = max(len(values) / flight.correlation, 1.0)
    found = [
        Share(what=what, share=_share(values, of_class[rows], alone), cause=CAUSES[what])
        for what, of_class in _classes(flight)
    ]
    return sorted(found, key=lambda e: -e.share)


def _classes(flight: Flight) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """The class of every reading by each quantity that is known."""
    yield "time", _in_classes(flight.time)
    if flight.latitude_deg is not None:
        yield "latitude", _in_classes(flight.latitude_deg)
    if flight.temperature is not None and np.ptp(flight.temperature) > 0:
        yield "temperature", _in_classes(flight.temperature)
    if flight.eclipse is not None and 0 < flight.eclipse.mean() < 1:
        yield "shadow", flight.eclipse.astype(np.int64)


def _in_classes(values: Array) -> NDArray[np.int64]:
    """Twelve classes of equal width between the 0.1st and the 99.9th percentile."""
    low, high = np.percentile(values, (0.1, 99.9))
    share = (values - low) / max(high - low, np.finfo(float).tiny)
    return np.asarray(np.clip((share * _BINS).astype(np.int64), 0, _BINS - 1))


def _share(values: Array, of_class: NDArray[np.int64], alone: float) -> float:
    """Adjusted R² of the means of the classes; 0 where chance would do as well."""
    counts = np.bincount(of_class)
    sums = np.bincount(of_class, values)
    k = int(np.count_nonzero(counts))
    means = sums / np.maximum(counts, 1)
    total = float(((values - values.mean()) ** 2).sum())
    if total == 0.0 or alone <= k:
        return 0.0
    left = float(((values - means[of_class]) ** 2).sum()) / total
    return max(0.0, 1.0 - left * (alone - 1) / (alone - k))
