"""The numbers of a calibration beside those that the log held before."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference, signals
from agonic.maths.equation.affine import model_basis, split
from agonic.recording.calibrated import Calibrated
from agonic.report.labels import per_label, unit_label

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


_MOVED: WeakKeyDictionary[Affine, list[tuple[Affine, Affine]]] = WeakKeyDictionary()


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


def list_quantities(result: Calibrated) -> list[Group]:
    """The numbers of one calibration in the order they are shown; the bias comes first, or, of a
    mix of two sensors, which has none, its constant."""
    new = result.fit.calibration
    gain, out = _ratio(new.unit_out, new.unit_in), unit_label(new.unit_out)
    if mixes_sensors(new):
        groups = [
            _group(result, "Constant", out, _AXES, lambda c: -c.matrix @ c.bias),
            _group(result, "Weights of this sensor", gain, _ENTRIES, lambda c: _pick(c.matrix)),
            _group(result, "Weights of the second sensor", gain, _ENTRIES, _weights_of_second),
        ]
    else:
        names = list(_ENTRIES)[: 9 if new.gauge == "free" else 6]
        groups = [
            _group(result, "Bias", unit_label(new.unit_in), _AXES, lambda c: c.bias),
            _group(result, "Matrix", gain, names, lambda c: _pick(c.matrix)[: len(names)]),
        ]
    return groups + _list_sources(result)


def list_views(result: Calibrated) -> list[Group]:
    """What the numbers of one calibration come to: scale factors, angles between the axes, and,
    where the attitude told it, the turn of the sensor."""
    new = result.fit.calibration
    if mixes_sensors(new):
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
    from scipy.spatial.transform import Rotation  # slow to load

    turn = polar(calibration.matrix)[0]
    if np.linalg.det(turn) < 0:  # it mirrors: no turn, as a matrix of a refused fit may
        return np.full(3, np.nan)
    return np.asarray(np.degrees(Rotation.from_matrix(turn).as_rotvec()))


def mixes_sensors(calibration: Affine) -> bool:
    """Whether it mixes the readings of two sensors, so that neither has a bias of its own."""
    return isinstance(calibration, Interference) and "second" in calibration.sources


def _pick(matrix: Array) -> Array:
    """The entries (9,) of a matrix in the order they are shown."""
    return np.array([matrix[at] for at in _ENTRIES.values()])


def _weights_of_second(calibration: Affine) -> Array:
    """The second summand of field = weights @ raw + weights of the second @ second + constant."""
    assert isinstance(calibration, Interference)
    second = [name.startswith("second") for name in signals(calibration.sources)]
    return _pick(-calibration.matrix @ calibration.coefficients[:, second])


def _list_sources(result: Calibrated) -> list[Group]:
    """What sources on board add to the readings, a group for each of their signals."""
    new = result.fit.calibration
    if not isinstance(new, Interference):
        return []
    return [
        _group(
            result,
            f"{ADDED}{name}",
            f"{unit_label(new.unit_in)} {per_label(name)}",
            _AXES,
            partial(_signal, k),
            compared=False,
        )
        for k, name in enumerate(signals(new.sources))
        if not name.startswith("second")
    ]


def _signal(k: int, calibration: Affine) -> Array:
    """What a unit of the k-th signal adds to the readings, (3,)."""
    assert isinstance(calibration, Interference)
    return np.asarray(calibration.coefficients[:, k])


def _group(
    result: Calibrated,
    name: str,
    unit: str,
    labels: Iterable[str],
    view: Callable[[Affine], Array],
    *,
    compared: bool = True,
) -> Group:
    """The numbers that `view` takes out of the new calibration and, compared, of the logged one."""
    new, logged = result.fit.calibration, _find_logged(result) if compared else None
    value, errors = view(new).tolist(), propagate_sd(new, view).tolist()
    before = [None] * len(value) if logged is None else view(logged).tolist()
    rows = zip(labels, value, errors, before, strict=True)
    return Group(
        name=name,
        unit=unit,
        rows=tuple(Quantity(name=n, value=v, sd=s, logged=b) for n, v, s, b in rows),
    )


def propagate_sd(calibration: Affine, view: Callable[[Affine], Array]) -> Array:
    """Standard errors of numbers that follow from a calibration: sd² = diag(J C Jᵀ)."""
    assert calibration.covariance is not None, "a fit always carries a covariance"
    there = [view(ahead) - view(behind) for ahead, behind in _move_each(calibration)]
    jacobian = np.array(there).T / (2 * _steps(calibration))
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


def _move_each(calibration: Affine) -> list[tuple[Affine, Affine]]:
    """The calibration with each parameter moved to and fro; made once for all that is shown."""
    pairs = _MOVED.get(calibration)  # asked once: its key is all that it holds
    if pairs is None:
        steps = np.diag(_steps(calibration))
        pairs = [(_move(calibration, by), _move(calibration, -by)) for by in steps]
        _MOVED[calibration] = pairs
    return pairs


def _move(calibration: Affine, by: Array) -> Affine:
    """The calibration with its parameters moved."""
    basis = model_basis("full", calibration.gauge)
    size = basis.shape[1]
    bias, matrix = split(basis @ by[:size])
    more: dict[str, Array] = {}
    if isinstance(calibration, Interference):
        more["coefficients"] = calibration.coefficients + by[size:].reshape(3, -1)
    return _put(calibration, calibration.bias + bias, calibration.matrix + matrix, **more)


def _put(calibration: Affine, bias: Array, matrix: Array, **more: Array) -> Affine:
    """The calibration with other numbers, whose errors are not known."""
    numbers: dict[str, Any] = {"bias": bias, "matrix": matrix, "covariance": None, **more}
    return replace(calibration, **numbers)


def _find_logged(result: Calibrated) -> Affine | None:
    """The earlier correction as a calibration, so that its numbers are made the same way."""
    logged = result.samples.logged
    if logged is None or mixes_sensors(result.fit.calibration):
        return None
    return _put(result.fit.calibration, logged.bias, logged.matrix)
