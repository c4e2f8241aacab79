"""The field of a platform that is turned beneath a magnetometer: harmonics of the angle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from agonic.alignment.maths.stretches import Stretches, fit_columns
from agonic.arrays import Array


class Harmonics(NamedTuple):
    """What goes round with the platform, with covariances for each axis of the magnetometer.

    `once` and `twice` (2, 3): cosine and sine of the angle and of twice the angle (`None` where
    there are too few settings); `once_covariance`, `twice_covariance` (3, 2, 2), one an axis;
    `residuals` (k, 3), and the `noise` (k, 3) of the means.
    """

    once: Array
    once_covariance: Array
    twice: Array | None
    twice_covariance: Array | None
    residuals: Array
    noise: Array


def fit_harmonics(seen: Stretches, angle_rad: Array, drift: int, *, twice: bool) -> Harmonics:
    """field = c0 + c1 cos ψ + s1 sin ψ (+ c2 cos 2ψ + s2 sin 2ψ) + what changes beside it.

    A magnet on the platform goes round once in a turn, what the ambient field magnetizes in it
    twice. The ambient field follows a `drift` of some degree, or the reference. Covariances are
    widened where residuals are larger than the noise within the settings at angles (k,).

    Source: the magnet rotating on the axis of a turntable, by the expansion in angular harmonics.

    >>> from agonic.alignment.maths.stretches import average_stretches
    >>> angle = np.radians(np.arange(0.0, 360.0, 30.0))
    >>> field = 3.0 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    >>> seen = average_stretches([np.array([k]) for k in range(12)], np.arange(12.0), field)
    >>> found = fit_harmonics(seen, angle, 0, twice=False)
    >>> (found.once.round(6) + 0.0).tolist()
    [[3.0, 0.0, 0.0], [0.0, 3.0, 0.0]]
    """
    columns = [np.cos(angle_rad), np.sin(angle_rad)]
    if twice:
        columns += [np.cos(2 * angle_rad), np.sin(2 * angle_rad)]
    found = fit_columns(seen, np.stack(columns, axis=1), drift)
    # with no repeated readings the residuals alone tell
    sd = np.where(np.isfinite(seen.scatter), np.maximum(seen.scatter, 1e-6), 1.0)
    variance = sd**2 / seen.counts.mean()
    chi2 = float((found.residuals**2 / variance).sum())
    wide = max(chi2 / max(3 * found.freedom, 1), 1.0)
    spreads = (wide * variance)[:, None, None] * found.spread
    return Harmonics(
        once=found.coefficients[:2],
        once_covariance=spreads[:, :2, :2],
        twice=found.coefficients[2:4] if twice else None,
        twice_covariance=spreads[:, 2:4, 2:4] if twice else None,
        residuals=found.residuals / seen.weight,
        noise=sd / np.sqrt(seen.counts)[:, None],
    )


def widen(found: Harmonics, amplitude: Array) -> Harmonics:
    """With an ambient field that may go round by an amplitude (3,) on each axis, in covariances."""
    more = (np.asarray(amplitude) ** 2)[:, None, None] * np.eye(2)
    twice = found.twice_covariance
    return found._replace(
        once_covariance=found.once_covariance + more,
        twice_covariance=None if twice is None else twice + more / 4.0,
    )


def compute_size(parts: Array, covariance: Array) -> tuple[float, float, float]:
    """The size of a harmonic, its standard error, and how often chance makes one as large.

    A vector of length r that goes round makes |c|² + |s|² = 2 r²; what noise adds on average is
    taken off.
    """
    squares = float((parts**2).sum()) / 2
    spread = float(np.trace(covariance, axis1=1, axis2=2).sum()) / 2
    size = float(np.sqrt(max(squares - spread, 0.0)))
    along = sum(
        float(parts[:, axis] @ covariance[axis] @ parts[:, axis]) for axis in range(len(covariance))
    )
    sd = float(np.sqrt(along) / 2 / np.sqrt(squares)) if squares > 0 else 0.0
    chi2 = sum(
        float(parts[:, axis] @ np.linalg.solve(covariance[axis], parts[:, axis]))
        for axis in range(len(covariance))
    )
    return size, max(sd, float(np.sqrt(spread / 6))), float(chdtrc(6, chi2))
