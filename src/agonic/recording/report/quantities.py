"""The numbers of a calibration beside those that the log held before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference, signals
from agonic.maths.equation.affine import model_basis, split
from agonic.recording.calibrated import Calibrated
from agonic.report.digits import degrees, grouped, quantity
from agonic.report.labels import PER, unit_label

_AXES = ("x", "y", "z")
ADDED = "Added by "
_PAIRS = ("xy", "xz", "yz")
_ENTRIES = {
    "xx": (0, 0),
    "yy": (1, 1),
    "zz": (2, 2),
    "xy": (0, 1),
    "xz": (0, 2),
    "yz": (1, 2),
    "yx": (1, 0),
    "zx": (2, 0),
    "zy": (2, 1),
}


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


def _ratio(above: str, below: str) -> str:
    return "" if above == below else f"{unit_label(above)} per {unit_label(below).rstrip('s')}"


def quantities(result: Calibrated) -> list[Group]:
    """The numbers of one calibration in the order they are shown; the bias comes first, or, of a
    mix of two sensors, which has none, its constant."""
    new, sd = result.fit.calibration, result.fit.sd
    if mixes(new):
        return _of_mix(result)
    gain = _ratio(new.unit_out, new.unit_in)
    names = tuple(_ENTRIES) if new.gauge == "free" else tuple(_ENTRIES)[:6]
    size = 3 + len(names)

    def entries(calibration: Affine) -> Array:
        return np.array([calibration.matrix[_ENTRIES[name]] for name in names])

    return [
        _group(result, "Bias", unit_label(new.unit_in), _AXES, lambda c: c.bias, sd[:3]),
        _group(result, "Matrix", gain, names, entries, sd[3:size]),
        *_of_sources(new, sd[size:]),
    ]


def views(result: Calibrated) -> list[Group]:
    """What the numbers of one calibration come to: scale factors, angles between the axes, and,
    where the attitude told it, the turn of the sensor."""
    new = result.fit.calibration
    if mixes(new):
        return []
    sensitivity = _ratio(new.unit_in, new.unit_out)
    groups = [
        _group(result, "Scale factor", sensitivity, _AXES, lambda c: c.scale_factors),
        _group(result, "Non-orthogonality", "°", _PAIRS, lambda c: c.nonorthogonality_deg),
    ]
    if new.gauge == "free":
        groups.append(_group(result, "Turn about", "°", _AXES, turn_deg))
    return groups


def turn_deg(calibration: Affine) -> Array:
    """The parts (3,) of the turn from the sensor's axes to those of the field, about x, y and z.

    Of matrix = R S with S symmetric the rotation vector of R (polar decomposition).

    >>> quarter = Affine(bias=[0, 0, 0], matrix=[[0, -2, 0], [2, 0, 0], [0, 0, 2]])
    >>> turn_deg(quarter).round(6).tolist()
    [0.0, 0.0, 90.0]
    """
    return np.asarray(np.degrees(Rotation.from_matrix(polar(calibration.matrix)[0]).as_rotvec()))


def mixes(calibration: Affine) -> bool:
    """Whether it mixes the readings of two sensors, so that neither has a bias of its own."""
    return isinstance(calibration, Interference) and "second" in calibration.sources


def _of_mix(result: Calibrated) -> list[Group]:
    """field = weights @ raw + weights of the second @ second + constant, and other sources."""
    new = result.fit.calibration
    assert isinstance(new, Interference)
    names = signals(new.sources)
    second = [k for k, name in enumerate(names) if name.startswith("second")]
    others = [k for k in range(len(names)) if k not in second]
    gain = _ratio(new.unit_out, new.unit_in)

    def own(c: Affine) -> Array:
        return np.array([c.matrix[at] for at in _ENTRIES.values()])

    def of_second(c: Affine) -> Array:
        weights = -c.matrix @ _coefficients(c)[:, second]
        return np.array([weights[at] for at in _ENTRIES.values()])

    groups = [
        _alone(new, "Constant", unit_label(new.unit_out), _AXES, lambda c: -c.matrix @ c.bias),
        _alone(new, "Weights of this sensor", gain, tuple(_ENTRIES), own),
        _alone(new, "Weights of the second sensor", gain, tuple(_ENTRIES), of_second),
    ]
    return groups + [
        _alone(
            new,
            f"Added by {names[k]}",
            f"{unit_label(new.unit_in)} {PER[names[k].split('_')[0]]}",
            _AXES,
            partial(_signal, k),
        )
        for k in others
    ]


def _signal(k: int, calibration: Affine) -> Array:
    """What a unit of the k-th signal adds to the readings, (3,)."""
    return np.asarray(_coefficients(calibration)[:, k])


def _coefficients(calibration: Affine) -> Array:
    assert isinstance(calibration, Interference)
    return calibration.coefficients


def _alone(
    new: Affine, name: str, unit: str, labels: Sequence[str], view: Callable[[Affine], Array]
) -> Group:
    """Numbers that no earlier correction has."""
    values = zip(labels, view(new).tolist(), propagated_sd(new, view).tolist(), strict=True)
    rows = tuple(Quantity(name=n, value=v, sd=s, logged=None) for n, v, s in values)
    return Group(name=name, unit=unit, rows=rows)


def quality(result: Calibrated) -> dict[str, str]:
    """How good the calibration is: numbers in words with their units."""
    fit, coverage = result.fit, result.fit.coverage
    into, out = (unit_label(u) for u in (fit.calibration.unit_in, fit.calibration.unit_out))
    dip = f"{grouped(coverage.inclination_deg)}°"
    return {
        "Noise of one reading on one axis": quantity(fit.noise, into),
        f"Heading standard error, level, at {dip} inclination": degrees(coverage.heading_sd_deg),
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
    """Standard errors of numbers that follow from a calibration: sd² = diag(J C Jᵀ)."""
    assert calibration.covariance is not None, "a fit always carries a covariance"
    steps = np.eye(len(calibration.covariance)) * _steps(calibration)
    there = [view(_moved(calibration, step)) - view(_moved(calibration, -step)) for step in steps]
    jacobian = np.array(there).T / (2 * np.diag(steps))
    spread = jacobian @ calibration.covariance @ jacobian.T
    return np.asarray(np.sqrt(np.maximum(np.diag(spread), 0.0)))


def _steps(calibration: Affine) -> Array:
    """How far to move each parameter: a millionth of its kind."""
    size = 12 if calibration.gauge == "free" else 9
    assert calibration.covariance is not None
    steps = np.full(len(calibration.covariance), 1e-6 * float(np.linalg.norm(calibration.matrix)))
    steps[:3] = 1e-6 * max(float(np.linalg.norm(calibration.bias)), 1.0)
    if isinstance(calibration, Interference):
        steps[size:] = 1e-6 * max(float(np.linalg.norm(calibration.coefficients)), 1e-6)
    return steps


def _moved(calibration: Affine, by: Array) -> Affine:
    """The calibration with its parameters moved."""
    basis = model_basis("full", calibration.gauge)
    size = basis.shape[1]
    bias, matrix = split(basis @ by[:size])
    changed: dict[str, Any] = {
        "bias": calibration.bias + bias,
        "matrix": calibration.matrix + matrix,
        "covariance": None,
    }
    if isinstance(calibration, Interference):
        changed["coefficients"] = calibration.coefficients + by[size:].reshape(3, -1)
    return replace(calibration, **changed)


def _of_sources(calibration: Affine, sd: Array) -> list[Group]:
    """What sources on board add to the readings, a group for each of their signals."""
    if not isinstance(calibration, Interference):
        return []
    names = signals(calibration.sources)
    errors = sd.reshape(3, -1).T
    return [
        Group(
            name=f"{ADDED}{name}",
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
