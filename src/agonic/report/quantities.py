"""The numbers of a calibration beside those that the log held before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agonic.calibrated import Calibrated
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference, signals
from agonic.kernels.affine import model_basis
from agonic.report.digits import degrees, quantity
from agonic.units import RAW

Array = NDArray[np.float64]

_AXES = ("x", "y", "z")
PER = {"current": "per A", "throttle": "at full throttle", "second": "per unit"}
"""What a source is counted in."""
_PAIRS = ("xy", "xz", "yz")
_ENTRIES = {
    "xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2),
    "yx": (1, 0), "zx": (2, 0), "zy": (2, 1),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """One number with its standard error, and the value that the log held before."""

    name: str
    value: float
    sd: float
    logged: float | None


@dataclass(frozen=True, kw_only=True)
class Group:
    """Numbers of one kind, which share a unit ("" for ratios)."""

    name: str
    unit: str
    rows: tuple[Quantity, ...]


def unit_label(unit: str) -> str:
    """A unit as it is shown.

    >>> unit_label("raw")
    'raw units'
    """
    return "raw units" if unit == RAW else unit


def _ratio(above: str, below: str) -> str:
    return "" if above == below else f"{unit_label(above)} per {unit_label(below).rstrip('s')}"


def quantities(result: Calibrated) -> list[Group]:
    """The numbers of one calibration in the order they are shown."""
    new, sd = result.fit.calibration, result.fit.sd
    gain, sensitivity = _ratio(new.unit_out, new.unit_in), _ratio(new.unit_in, new.unit_out)
    names = tuple(_ENTRIES) if new.gauge == "free" else tuple(_ENTRIES)[:6]
    size = 3 + len(names)

    def entries(calibration: Affine) -> Array:
        return np.array([calibration.matrix[_ENTRIES[name]] for name in names])

    return [
        _group(result, "Bias", unit_label(new.unit_in), _AXES, lambda c: c.bias, sd[:3]),
        _group(result, "Matrix", gain, names, entries, sd[3:size]),
        *_of_sources(new, sd[size:]),
        _group(result, "Scale factor", sensitivity, _AXES, lambda c: c.scale_factors),
        _group(result, "Non-orthogonality", "°", _PAIRS, lambda c: c.nonorthogonality_deg),
    ]


def quality(result: Calibrated) -> dict[str, str]:
    """How good the calibration is: numbers in words with their units."""
    fit, coverage = result.fit, result.fit.coverage
    into, out = (unit_label(u) for u in (fit.calibration.unit_in, fit.calibration.unit_out))
    return {
        "Noise of one reading on one axis": quantity(fit.noise, into),
        f"Heading standard error, level, at {coverage.inclination_deg:.0f}° inclination": degrees(
            coverage.heading_sd_deg
        ),
        "Field standard error, worst direction": quantity(coverage.field_sd_max, out),
        "Residual of held-out readings, rms": quantity(result.verification.residual_rms, out),
    }


def _group(
    result: Calibrated,
    name: str,
    unit: str,
    labels: Sequence[str],
    view: Callable[[Affine], Array],
    sd: Array | None = None,
) -> Group:
    """The numbers that `view` takes out of the new calibration and of the logged one."""
    new, logged = result.fit.calibration, _logged(result)
    errors = propagated_sd(new, view) if sd is None else sd
    before = [None] * len(labels) if logged is None else view(logged).tolist()
    rows = zip(labels, view(new).tolist(), errors.tolist(), before, strict=True)
    return Group(
        name=name,
        unit=unit,
        rows=tuple(Quantity(name=n, value=v, sd=s, logged=b) for n, v, s, b in rows),
    )


def propagated_sd(calibration: Affine, view: Callable[[Affine], Array]) -> Array:
    """Standard errors of numbers that follow from the matrix: sd² = diag(J C Jᵀ)."""
    assert calibration.covariance is not None, "a fit always carries a covariance"
    step = 1e-6 * float(np.linalg.norm(calibration.matrix))
    basis = model_basis("full", calibration.gauge)[3:, 3:].T.reshape(-1, 3, 3)
    size = 3 + len(basis)

    def moved(by: Array) -> Array:
        return view(replace(calibration, matrix=calibration.matrix + by))

    jacobian = np.array([moved(step * e) - moved(-step * e) for e in basis]).T / (2 * step)
    spread = jacobian @ calibration.covariance[3:size, 3:size] @ jacobian.T
    return np.asarray(np.sqrt(np.diag(spread)))


def _of_sources(calibration: Affine, sd: Array) -> list[Group]:
    """What sources on board add to the readings, a group for each of their signals."""
    if not isinstance(calibration, Interference):
        return []
    names = signals(calibration.sources)
    errors = sd.reshape(3, -1).T
    return [
        Group(
            name=f"Added by {name}",
            unit=f"{unit_label(calibration.unit_in)} {PER[name.split('_')[0]]}",
            rows=tuple(
                Quantity(name=axis, value=float(v), sd=float(s), logged=None)
                for axis, v, s in zip(_AXES, values, sds, strict=True)
            ),
        )
        for name, values, sds in zip(names, calibration.coefficients.T, errors, strict=True)
    ]


def _logged(result: Calibrated) -> Affine | None:
    """The earlier correction as a calibration, so that its numbers are made the same way."""
    logged = result.samples.logged
    if logged is None:
        return None
    return replace(result.fit.calibration, bias=logged.bias, matrix=logged.matrix, covariance=None)
