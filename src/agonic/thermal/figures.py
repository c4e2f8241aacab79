"""Figures of a calibration over temperature: coefficients, spread of the stations, the chamber."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import FREE_PARAMETERS, PARAMETERS
from agonic.calibration.decomposition import decompose_at
from agonic.calibration.thermal import Thermal
from agonic.report import strips
from agonic.report.axes import Axis, along_time, down, fit_axis, right
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element
from agonic.report.strips import area, caption, level, path, plot, points
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.checks.boards import Course
from agonic.thermal.common_mode import ChamberField
from agonic.thermal.fit.result import Bins, Spread, ThermalFit
from agonic.thermal.result import HeldOut

LEVELS = 61
"""Temperatures at which a curve is drawn."""
_ENTRIES = {"x": 0, "y": 1, "z": 2}


class Curve(NamedTuple):
    """One coefficient over temperature: its `name` and unit, values and standard errors (t,)."""

    name: str
    unit: str
    temperature: Array
    value: Array
    sd: Array | None

    @property
    def label(self) -> str:
        """Name and unit as they stand at an axis."""
        return f"{self.name}, {self.unit}" if self.unit else self.name


def evaluate_coefficients(calibration: Thermal, temperature: Array | None = None) -> list[Curve]:
    """Every coefficient over the range that was seen, bias first."""
    at = np.linspace(*calibration.range_C, LEVELS) if temperature is None else temperature
    names = FREE_PARAMETERS if calibration.gauge == "free" else PARAMETERS
    bias, matrix = calibration.bias_at(at), calibration.matrix_at(at)
    sd = None if calibration.covariance is None else calibration.sd_at(at)
    unit_in, unit_out = unit_label(calibration.unit_in), unit_label(calibration.unit_out)
    ratio = "" if unit_in == unit_out else f"{unit_out} per {unit_in.rstrip('s')}"
    made = []
    for k, name in enumerate(names):
        what, _, axes = name.partition("_")
        value = bias[:, k] if what == "bias" else matrix[:, _ENTRIES[axes[0]], _ENTRIES[axes[1]]]
        unit = unit_in if what == "bias" else ratio
        made.append(Curve(f"{what} {axes}", unit, at, value, None if sd is None else sd[:, k]))
    return made


def evaluate_decomposition(calibration: Thermal, temperature: Array | None = None) -> list[Curve]:
    """Scale factors and angles between the axes over the range that was seen; none where the
    matrix has no inverse.
    """
    at = np.linspace(*calibration.range_C, LEVELS) if temperature is None else temperature
    found = decompose_at(calibration, at)
    if not np.isfinite(found.scale_factors).all():
        return []
    unit_in, unit_out = unit_label(calibration.unit_in), unit_label(calibration.unit_out)
    ratio = "" if unit_in == unit_out else f"{unit_in} per {unit_out.rstrip('s')}"
    known = calibration.covariance is not None
    groups = (
        ("scale factor", "xyz", ratio, found.scale_factors, found.scale_factors_sd),
        (
            "non-orthogonality",
            ("xy", "xz", "yz"),
            "°",
            found.nonorthogonality_deg,
            found.nonorthogonality_sd_deg,
        ),
    )
    return [
        Curve(f"{what} {axes}", unit, at, values[:, k], sd[:, k] if known else None)
        for what, names, unit, values, sd in groups
        for k, axes in enumerate(names)
    ]


COMPONENTS = ("x", "y", "z", "|B|")
MOST_DOTS = 240
_LEAST_VARIANCE = 1e-3
_OUTLIER = 8.0  # median distances from the curve


class Dots(NamedTuple):
    """Values of a coefficient at each temperature by itself, of one class of the style sheet."""

    temperature: Array
    values: Array
    kind: str


def draw_decomposition(calibration: Thermal) -> Markup:
    """Scale factors and angles against temperature, as Nikolaev et al. (2023) show them."""
    drawn = [draw_coefficient(curve, ()) for curve in evaluate_decomposition(calibration)]
    keys = {"curve": "polynomial"}
    if calibration.covariance is not None:
        keys["band"] = "± 2 standard errors"
    return caption("Scale factors and non-orthogonality over temperature", _arrange(drawn), keys)


def select_dots(bins: Bins | None, k: int, less: Curve | None = None) -> tuple[Dots, ...]:
    """The values of each bin while cooling and heating; `less` the curve where one is given."""
    if bins is None or k >= bins.cooling.shape[1]:
        return ()
    made = []
    for kind, values in (("cooling", bins.cooling[:, k]), ("heating", bins.heating[:, k])):
        there = np.isfinite(values)
        if less is not None:
            there &= (bins.temperature >= less.temperature[0]) & (
                bins.temperature <= less.temperature[-1]
            )
        at, shown = bins.temperature[there], values[there]
        if less is not None:
            shown = shown - np.interp(at, less.temperature, less.value)
        step = max(1, -(-len(at) // MOST_DOTS))
        made.append(Dots(at[::step], shown[::step], kind))
    return tuple(made)


def draw_coefficient(curve: Curve, dots: Sequence[Dots]) -> Markup:
    """One coefficient over temperature: dots of the bins, the polynomial and its band."""
    cold, warm = float(curve.temperature[0]), float(curve.temperature[-1])
    margin = 0.03 * max(warm - cold, 1e-9)
    x = Axis("°C", cold - margin, warm + margin)
    reach = np.zeros(len(curve.value)) if curve.sd is None else 2 * curve.sd
    low, high = curve.value - reach, curve.value + reach
    shown = [_leave_out_outliers(curve, d) for d in dots if len(d.values)]
    y = fit_axis(curve.label, np.concatenate([low, high, *shown]))
    layers = []
    if curve.sd is not None:
        layers.append(area(x, y, curve.temperature, low, high, "band"))
    layers += [strips.dots(x, y, d.temperature, d.values, f"dots {d.kind}") for d in dots]
    layers.append(strips.curve(x, y, curve.temperature, curve.value, "curve"))
    words = f"{curve.name} from {cold:.0f} to {warm:.0f} °C"
    return plot(x, y, layers, words, kind="small")


def draw_remainder(curve: Curve, bins: Bins | None, k: int) -> Markup:
    """What the polynomial leaves of each bin, with its band about zero."""
    level_ = np.zeros_like(curve.value)
    return draw_coefficient(curve._replace(value=level_), select_dots(bins, k, less=curve))


def _leave_out_outliers(curve: Curve, dots: Dots) -> Array:
    """The dots that are no outliers: those are drawn at the edge."""
    away = np.abs(dots.values - np.interp(dots.temperature, curve.temperature, curve.value))
    return dots.values[away <= _OUTLIER * float(np.median(away)) + 1e-300]


def _draw_station_bars(found: Spread, held_out: HeldOut | None, column: int, label: str) -> Markup:
    """The standard deviation of the readings at every station, before and after, as bars."""
    kinds = [("before", found.stations, found.before), ("after", found.stations, found.after)]
    if held_out is not None:
        kinds.append(("unseen", held_out.spread.stations, held_out.spread.after))
    numbers = np.array(found.stations, dtype=np.float64)
    x = Axis("station", float(numbers.min()) - 0.6, float(numbers.max()) + 0.6)
    highest = max(float(values[:, column].max(initial=0.0)) for _, _, values in kinds)
    y = Axis(label, 0.0, 1.05 * max(highest, 1e-9))
    width = 0.8 / len(kinds)
    layers = [
        _draw_bars(
            x, y, np.array(at, dtype=np.float64) - 0.4 + k * width, width, values[:, column], name
        )
        for k, (name, at, values) in enumerate(kinds)
    ]
    return plot(x, y, layers, f"{label} at every station, before and after", kind="small")


def _draw_bars(x: Axis, y: Axis, at: Array, width: float, values: Array, name: str) -> Markup:
    left, end, top = right(x, at), right(x, at + 0.92 * width), down(y, values)
    drawn = (f"M{a:.1f} 1000V{t:.1f}H{b:.1f}V1000Z" for a, b, t in zip(left, end, top, strict=True))
    return path("".join(drawn), f"bar {name}")


def _draw_variances(variances: Array, chosen: int) -> Markup:
    """The variance of the scaled residuals of each coefficient against the order."""
    shown = np.log10(np.maximum(variances, _LEAST_VARIANCE))
    known = np.isfinite(shown)
    order = np.arange(variances.shape[1], dtype=np.float64)
    x = Axis("order of the polynomial", -0.3, float(order[-1]) + 0.3)
    top = float(shown[known].max())
    y = Axis(
        "variance of the scaled residuals, power of ten",
        min(-0.2, float(shown[known].min())),
        max(1.0, 1.05 * top),
    )
    layers = [path(f"M{float(right(x, np.array(float(chosen)))):.1f} 0V1000", "chosen")]
    for k, row in enumerate(shown):
        there = np.isfinite(row)
        name = "of-bias" if k < 3 else "of-matrix"
        layers.append(strips.curve(x, y, order[there], row[there], name))
    return plot(x, y, layers, f"Variance of the residuals against the order; {chosen} is used")


def _draw_chamber_axis(found: ChamberField, axis: int) -> Markup:
    """The field of the chamber along an axis over time, and what each sensor saw."""
    x, along = along_time(found.time, 0.0, float(found.time.max()), since="the campaign began")
    x = replace(x, high=1.01 * x.high)
    common = found.change[:, axis]
    each = [common + share.own[:, axis] for share in found.shares]
    reach = float(np.percentile(np.abs(np.concatenate([common, *each])), 99.0))
    limit = 1.1 * max(reach, float(np.abs(common).max()), 1e-9)
    y = Axis(f"{found.axes[axis]}, nT", -limit, limit)
    layers = [level(y, 0.0, "zero")]
    layers += [strips.dots(x, y, along, values, "dots each") for values in each]
    parts = []
    for number in np.unique(found.station):
        rows = found.station == number
        parts.append(f"M{points(right(x, along[rows]), down(y, common[rows]))}")
    layers.append(path("".join(parts), "common"))
    return plot(x, y, layers, f"The chamber’s field {found.axes[axis]} over time", kind="short")


def draw_coefficients(calibration: Thermal, bins: Bins | None = None) -> list[Markup]:
    """Every coefficient against temperature, and what the polynomials leave of the bins."""
    shown = evaluate_coefficients(calibration)
    drawn = [draw_coefficient(curve, select_dots(bins, k)) for k, curve in enumerate(shown)]
    dots = {"cooling": "one bin, cooling", "heating": "one bin, heating"}
    keys = {} if bins is None else dots
    keys = {**keys, "curve": "polynomial"}
    if calibration.covariance is not None:
        keys["band"] = "± 2 standard errors"
    parts = [caption("Bias and matrix over temperature", _arrange(drawn), keys)]
    if bins is not None:
        left = [draw_remainder(curve, bins, k) for k, curve in enumerate(shown)]
        parts.append(
            element(
                "details",
                element("summary", "The same less the polynomial"),
                caption("What the polynomials leave of the bins", _arrange(left), keys),
            )
        )
    return parts


def _arrange(drawn: Sequence[Markup], kind: str = "") -> Markup:
    return element("div", *drawn, class_=f"multiples {kind}".strip())


def draw_stations(before_and_after: Spread, held_out: HeldOut | None, unit: str) -> Markup:
    """Bars for x, y, z and |B| at every station."""
    drawn = [
        _draw_station_bars(before_and_after, held_out, k, f"{name}, {unit}")
        for k, name in enumerate(COMPONENTS)
    ]
    keys = {"before": "before", "after": "after"}
    note = ""
    if held_out is not None:
        keys["unseen"] = "after, by a fit that has not seen the station"
        note = f"{held_out.folds} fits, each without some of the stations, were tried on those."
    name = "Standard deviation of the readings over temperature"
    return caption(name, _arrange(drawn, "two"), keys, note)


def draw_courses(courses: Mapping[int, Course], profile: Profile | None) -> Markup:
    """The temperature at every station over time, a value a minute, and the programme behind it."""
    longest = max(len(course.level_C) for course in courses.values()) / 60
    levels = np.concatenate([course.level_C for course in courses.values()])
    x = Axis("hours", 0.0, longest)
    planned: tuple[Array, Array] | None = None
    if profile is not None:
        planned = profile.corners[0] / 3600, profile.corners[1]
        levels = np.append(levels, [profile.lowest_C, profile.highest_C])
    y = fit_axis("°C", levels)
    drawn = [_draw_course(x, y, number, course, planned) for number, course in courses.items()]
    keys = {"common": "median of the thermometers"}
    if planned is not None:
        keys["chosen"] = "programme"
    return caption("Temperature at each station", _arrange(drawn, "courses"), keys)


def _draw_course(
    x: Axis, y: Axis, number: int, course: Course, planned: tuple[Array, Array] | None
) -> Markup:
    """The temperature of one station, broken where nothing was recorded."""
    step = max(1, -(-len(course.level_C) // MOST_DOTS))
    level_ = course.level_C[::step]
    across = right(x, (np.arange(len(level_)) * step + 0.5) / 60)
    layers = []
    if planned is not None:
        there = planned[0] <= x.high
        layers.append(strips.curve(x, y, planned[0][there], planned[1][there], "chosen"))
    known = np.isfinite(level_)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], known.astype(int), [0]])))
    runs = zip(edges[::2], edges[1::2], strict=True)
    drawn = "".join(f"M{points(across[a:b], down(y, level_[a:b]))}" for a, b in runs)
    layers.append(path(drawn, "common"))
    shown = replace(y, label=f"station {number}, °C")
    return plot(x, shown, layers, f"Temperature at station {number} over time", kind="small")


def draw_orders(fit: ThermalFit) -> Markup:
    """The curve of residual variance over the order, and who chose the order."""
    order = fit.calibration.degree
    auto = fit.calibration.provenance.settings.get("degree") == "auto"
    said = (
        f"Order {order}: the smallest after which no variance falls markedly."
        if auto
        else f"Order {order}, as asked for."
    )
    if fit.variances is None:
        return element("p", said)
    keys = {"of-bias": "bias", "of-matrix": "matrix", "chosen": "used"}
    name = "Variance of what the polynomials leave of the bins, over that of their noise"
    return caption(name, _draw_variances(fit.variances, order), keys, said)


def draw_chamber(found: ChamberField) -> Markup:
    """The chamber's field along each axis over time."""
    drawn = Markup("".join(_draw_chamber_axis(found, axis) for axis in range(len(found.axes))))
    keys = {"common": "common to all sensors", "each": "each sensor, mean of a window"}
    return caption("Changes of the field at each station, less their mean", drawn, keys)
