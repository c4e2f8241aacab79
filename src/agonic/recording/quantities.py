"""The numbers of a calibration beside those that the log held before, and what is left after it: in
each reading, and in each of the 80 directions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.decomposition import decompose
from agonic.calibration.interference import Interference, signals
from agonic.maths.equation.affine import magnitude_residual, model_basis, split
from agonic.maths.equation.coverage import find_cells, icosphere
from agonic.recording.calibrated import Calibrated
from agonic.report.digits import group_digits, quantity, show_sign
from agonic.report.figure import robust_limit
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
        return [
            _group(result, "Constant", out, _AXES, lambda c: -c.matrix @ c.bias),
            _group(result, "Weights of this sensor", gain, _ENTRIES, lambda c: _pick(c.matrix)),
            _group(result, "Weights of the second sensor", gain, _ENTRIES, _weights_of_second),
            *_list_sources(result),
        ]
    names, into = list(_ENTRIES)[: 9 if new.gauge == "free" else 6], unit_label(new.unit_in)
    sd = result.fit.sd
    by_entry = sd[3 : 3 + len(names)]
    return [
        _group(result, "Bias", into, _AXES, lambda c: c.bias, sd[:3]),
        _group(result, "Matrix", gain, names, lambda c: _pick(c.matrix)[: len(names)], by_entry),
        *_list_sources(result),
    ]


def list_views(result: Calibrated) -> list[Group]:
    """What the numbers of one calibration come to: scale factors, angles between the axes, and,
    where the attitude told it, the turn of the sensor."""
    new = result.fit.calibration
    if mixes_sensors(new):
        return []
    sensitivity, (_, size_sd, _, angle_sd) = _ratio(new.unit_in, new.unit_out), decompose(new)
    groups = [
        _group(result, "Scale factor", sensitivity, _AXES, lambda c: c.scale_factors, size_sd),
        _group(
            result, "Non-orthogonality", "°", _PAIRS, lambda c: c.nonorthogonality_deg, angle_sd
        ),
    ]
    if new.gauge == "free":
        groups.append(_group(result, "Turn about", "°", _AXES, turn_deg))
    return groups


def turn_deg(calibration: Affine) -> Array:
    """The parts (3,) of the turn from the sensor's axes to those of the field, about x, y and z. Of
    matrix = R S with S symmetric the rotation vector of R (polar decomposition)."""
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
    slopes, names = new.coefficients, signals(new.sources)
    sds = result.fit.sd[-slopes.size :].reshape(slopes.shape)
    groups = [
        _list_rows(f"{ADDED}{name}", f"{unit_label(new.unit_in)} {per_label(name)}", _AXES, *pair)
        for name, *pair in zip(names, slopes.T, sds.T, strict=True)
    ]
    return [one for name, one in zip(names, groups, strict=True) if not name.startswith("second")]


def _group(
    result: Calibrated,
    name: str,
    unit: str,
    labels: Iterable[str],
    view: Callable[[Affine], Array],
    sd: Array | None = None,
) -> Group:
    """The numbers that `view` takes out of the new calibration and of the logged one."""
    new, logged = result.fit.calibration, result.samples.logged
    before = None
    if logged is not None and not mixes_sensors(new):
        put = replace(new, bias=logged.bias, matrix=logged.matrix)
        before = view(put)
    return _list_rows(
        name, unit, labels, view(new), propagate_sd(new, view) if sd is None else sd, before
    )


def _list_rows(
    name: str,
    unit: str,
    labels: Iterable[str],
    value: Array,
    sd: Array,
    before: Array | None = None,
) -> Group:
    logged = [None] * len(value) if before is None else before.tolist()
    rows = zip(labels, value.tolist(), sd.tolist(), logged, strict=True)
    quantities = (Quantity(name=n, value=v, sd=s, logged=b) for n, v, s, b in rows)
    return Group(name=name, unit=unit, rows=tuple(quantities))


def propagate_sd(calibration: Affine, view: Callable[[Affine], Array]) -> Array:
    """Standard errors of numbers that follow from a calibration: sd² = diag(J C Jᵀ), J by moving
    each parameter by a millionth of its kind."""
    covariance, basis = calibration.covariance, model_basis("full", calibration.gauge)
    assert covariance is not None, "a fit always carries a covariance"
    m, slopes = basis.shape[1], getattr(calibration, "coefficients", np.zeros((3, 0)))
    steps = np.full(len(covariance), 1e-6 * float(np.linalg.norm(calibration.matrix)))
    steps[:3] = 1e-6 * max(float(np.linalg.norm(calibration.bias)), 1.0)
    steps[m:] = 1e-6 * max(float(np.linalg.norm(slopes)), 1e-6)

    def look(by: Array) -> Array:
        bias, matrix = split(basis @ by[:m])
        numbers: dict[str, Any] = {"bias": calibration.bias + bias, "covariance": None}
        numbers["matrix"] = calibration.matrix + matrix
        if slopes.size:
            numbers["coefficients"] = slopes + by[m:].reshape(3, -1)
        return view(replace(calibration, **numbers))

    jacobian = np.array([look(by) - look(-by) for by in np.diag(steps)]).T / (2 * steps)
    spread = jacobian @ covariance @ jacobian.T
    return np.asarray(np.sqrt(np.maximum(np.diag(spread), 0.0)))


MIN_IN_CELL = 10
"""Readings in a cell below which their mean says nothing."""

_LEAST = 1e-9  # of a range, so that readings without any spread can be drawn


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Distances from the model and weights, (n,) each; means over the cells (80,), NaN where few.
    All in `unit`, that of the readings; `noise` is what the fit states."""

    values: Array
    weights: Array
    means: Array
    noise: float
    unit: str

    @property
    def limit(self) -> float:
        """Half the height of a strip: what counted in the fit, at least five times the noise."""
        return robust_limit(self.values, max(5.0 * self.noise, _LEAST), self.weights)

    @property
    def mean_limit(self) -> float:
        """The mean at which colour is full: the largest, but never less than the noise."""
        return max(self.noise, float(np.nanmax(np.abs(self.means), initial=0.0)), _LEAST)

    @property
    def worst(self) -> str:
        """The cell with the largest mean, in words."""
        if np.isnan(self.means).all():
            return f"No direction holds {MIN_IN_CELL} readings."
        cell = int(np.nanargmax(np.abs(self.means)))
        x, y, z = (show_sign(group_digits(float(v), 2)) for v in icosphere()[0][cell])
        value = show_sign(quantity(float(self.means[cell]), self.unit, 2))
        return f"The largest is {value}, towards ({x}, {y}, {z})."


def compute_residuals(result: Calibrated) -> Residuals:
    """The residuals of the fit, worked out again where it kept none (a fit from moments)."""
    fit, calibration, values = result.fit, result.fit.calibration, result.fit.residuals
    if values is None:
        here = (calibration.bias, calibration.matrix, find_level(result))
        values = magnitude_residual(result.cleaned, *here, differentiate=False)[0]
    weights = np.ones(len(values)) if fit.weights is None else fit.weights
    return Residuals(
        values=values,
        weights=weights,
        means=_cell_means(result, values, weights),
        noise=fit.noise,
        unit=unit_label(calibration.unit_in),
    )


def find_held_out(result: Calibrated) -> Mask | None:
    """The rows held out of the fit (n,) where they are a part of it; `None` where every reading
    was judged in its turn, by a fit to others, and where the readings are others altogether."""
    held_out, weights = result.verification.held_out, result.fit.weights
    if held_out is None:
        return None
    counted = np.ones(len(held_out), dtype=bool) if weights is None else weights > 0
    return None if held_out[counted].all() else held_out


def find_level(result: Calibrated) -> float:
    """The magnitude that the calibrated readings lie around, in the unit of the field."""
    return result.fit.calibration.magnitude or float(np.mean(result.verification.magnitude_after))


def _cell_means(result: Calibrated, values: Array, weights: Array) -> Array:
    corrected = result.corrected
    if len(corrected) != len(values):  # a refused fit takes readings beyond what is a field
        return np.full(80, np.nan)
    cells = find_cells(corrected)
    total = np.bincount(cells, weights, minlength=80)
    sums = np.bincount(cells, weights * values, minlength=80)
    means = np.full(80, np.nan)
    np.divide(sums, total, out=means, where=total >= MIN_IN_CELL)
    return means
