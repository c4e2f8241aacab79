"""The estimators that are compared: ours, the textbooks', and what installs by pip.

Each takes readings (n, 3), the magnitude of the field and the noise, all in nT, and gives bias and
matrix. Peers are imported where they are used; `ImportError` means not installed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

import agonic as ag
from agonic.ellipsoid.solve import Method
from benchmarks import textbook

Array = NDArray[np.float64]
Estimator = Callable[[Array, float, float], tuple[Array, Array]]

GAUSS = 1e5  # nT


def _agonic(method: Method, raw: Array, magnitude: float, noise: float) -> tuple[Array, Array]:
    """Ours, without the prior, so that nothing but the readings decides."""
    fit = ag.fit_ellipsoid(
        ag.Samples(field=raw),
        ag.Reference.constant(magnitude),
        model="full",
        method=method,
        soft_iron_sd=None,
    )
    return fit.calibration.bias, fit.calibration.matrix


def _diagonal(raw: Array, magnitude: float, noise: float) -> tuple[Array, Array]:
    return textbook.diagonal(raw, magnitude)


def _magnitude(raw: Array, magnitude: float, noise: float) -> tuple[Array, Array]:
    return textbook.magnitude_residual(raw, magnitude)


def _magyc_two_step(raw: Array, magnitude: float, noise: float) -> tuple[Array, Array]:
    """TWOSTEP (Alonso & Shuster 2002), told the true noise; in gauss, as its defaults are."""
    from magyc import twostep_hsi

    field = np.array([magnitude, 0.0, 0.0]) / GAUSS
    bias, soft_iron, _ = twostep_hsi(raw / GAUSS, field, 100, noise / GAUSS)
    return bias * GAUSS, np.linalg.inv(soft_iron)


def _magyc(name: str, raw: Array, magnitude: float, noise: float) -> tuple[Array, Array]:
    """An algebraic fit of magyc, soft iron used as the package does; scale and sign are open."""
    import magyc

    bias, soft_iron, _ = getattr(magyc, name)(raw / GAUSS)
    return bias * GAUSS, _scaled(raw, bias * GAUSS, np.linalg.inv(soft_iron), magnitude)


def _magcal(raw: Array, magnitude: float, noise: float) -> tuple[Array, Array]:
    """The ellipsoid about the mean of the readings, to unit radius."""
    from magcal import MagnetometerCalibrator

    found = MagnetometerCalibrator().ellipsoid_fit(raw / GAUSS)
    return found["center"] * GAUSS, found["transform_matrix"] * (magnitude / GAUSS)


def _scaled(raw: Array, bias: Array, matrix: Array, magnitude: float) -> Array:
    """The positive matrix that makes the mean magnitude what it should be."""
    mean = np.linalg.norm((raw - bias) @ matrix.T, axis=1).mean()
    return np.asarray(matrix * (np.sign(np.trace(matrix)) * magnitude / mean))


ESTIMATORS: dict[str, Estimator] = {
    "agonic likelihood": partial(_agonic, "likelihood"),
    "agonic adjusted": partial(_agonic, "adjusted"),
    "Li & Griffiths": partial(_agonic, "li-griffiths"),
    "linear": partial(_agonic, "linear"),
    "magnitude residual": _magnitude,
    "diagonal": _diagonal,
    "magyc two-step": _magyc_two_step,
    "magyc ellipsoid": partial(_magyc, "ellipsoid_fit"),
    "magyc Fang": partial(_magyc, "ellipsoid_fit_fang"),
    "magcal": _magcal,
}
