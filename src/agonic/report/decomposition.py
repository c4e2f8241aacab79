"""Scale factors and angles between the axes of a calibration, as lines of text."""

from __future__ import annotations

from collections.abc import Sequence

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.decomposition import decompose
from agonic.report.digits import NO_BREAK, with_sd

PAIRS = ("xy", "xz", "yz")


def describe_decomposition(calibration: Affine) -> dict[str, str]:
    """The sensitivity of each axis and how far the axes are from square, with standard errors.

    >>> from numpy import diag, eye
    >>> found = describe_decomposition(
    ...     Affine(bias=[0, 0, 0], matrix=diag([2.0, 1.0, 1.0]), covariance=1e-6 * eye(9))
    ... )
    >>> found["Scale"].replace("\u00a0", " ")
    'x 0.50000 ± 0.00025   y 1.0000 ± 0.0010   z 1.0000 ± 0.0010'
    """
    found = decompose(calibration)
    return {
        "Scale": _join("xyz", found.scale_factors, found.scale_factors_sd),
        "Angles": _join(PAIRS, found.nonorthogonality_deg, found.nonorthogonality_sd_deg) + "°",
    }


def _join(names: Sequence[str], values: Array, sds: Array) -> str:
    parts = (
        f"{name} {with_sd(float(v), float(sd))}"
        for name, v, sd in zip(names, values, sds, strict=True)
    )
    return "   ".join(part.replace(" ", NO_BREAK) for part in parts)
