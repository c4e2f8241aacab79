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
from agonic.report import marks
from agonic.report.axes import Axis, about_zero, along_time, fit_axis
from agonic.report.figure import Figure, Panel, figure
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element
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


def draw_decomposition(calibration: Thermal) -> Figure:
    """Scale factors and angles against temperature, as Nikolaev et al. (2023) show them."""
    return Figure(
        title="Scale factors and non-orthogonality over temperature",
        panels=[draw_coefficient(curve, ()) for curve in evaluate_decomposition(calibration)],
        style="multiples",
    )


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


def draw_coefficient(curve: Curve, dots: Sequence[Dots]) -> Panel:
    """One coefficient over temperature: dots of the bins, the polynomial and its band."""
    at, value = curve.temperature, curve.value
    cold, warm = float(at[0]), float(at[-1])
    margin = 0.03 * max(warm - cold, 1e-9)
    reach = np.zeros(len(value)) if curve.sd is None else 2 * curve.sd
    band = marks.area("band", at, value - reach, value + reach, words="± 2 standard errors")
    shown = [_leave_out_outliers(curve, d) for d in dots if len(d.values)]
    return Panel(
        x=Axis("°C", cold - margin, warm + margin),
        y=fit_axis(curve.label, np.concatenate([value - reach, value + reach, *shown])),
        marks=[
            *([] if curve.sd is None else [band]),
            *(
                marks.dots(f"dots {d.kind}", d.temperature, d.values, words=f"one bin, {d.kind}")
                for d in dots
            ),
            marks.curve("curve", at, value, words="polynomial"),
        ],
        kind="small",
    )


def draw_remainder(curve: Curve, bins: Bins | None, k: int) -> Panel:
    """What the polynomial leaves of each bin, with its band about zero."""
    zero = curve._replace(value=np.zeros_like(curve.value))
    return draw_coefficient(zero, select_dots(bins, k, less=curve))


def _leave_out_outliers(curve: Curve, dots: Dots) -> Array:
    """The dots that are no outliers: those are drawn at the edge."""
    away = np.abs(dots.values - np.interp(dots.temperature, curve.temperature, curve.value))
    return dots.values[away <= _OUTLIER * float(np.median(away)) + 1e-300]


def draw_coefficients(calibration: Thermal, bins: Bins | None = None) -> list[Figure | Markup]:
    """Every coefficient against temperature, and what the polynomials leave of the bins."""
    shown = evaluate_coefficients(calibration)
    drawn = [draw_coefficient(curve, select_dots(bins, k)) for k, curve in enumerate(shown)]
    whole = Figure(title="Bias and matrix over temperature", panels=drawn, style="multiples")
    if bins is None:
        return [whole]
    left = Figure(
        title="What the polynomials leave of the bins",
        panels=[draw_remainder(curve, bins, k) for k, curve in enumerate(shown)],
        style="multiples",
    )
    said = element("summary", "The same less the polynomial")
    return [whole, element("details", said, left.to_html())]


def draw_orders(fit: ThermalFit) -> Figure | Markup:
    """The variance of the scaled residuals of each coefficient over the order, and who chose the
    order."""
    chosen = fit.calibration.degree
    auto = fit.calibration.provenance.settings.get("degree") == "auto"
    said = (
        f"Order {chosen}: the smallest after which no variance falls markedly."
        if auto
        else f"Order {chosen}, as asked for."
    )
    if fit.variances is None:
        return element("p", said)
    shown = np.log10(np.maximum(fit.variances, _LEAST_VARIANCE))
    known, order = shown[np.isfinite(shown)], np.arange(shown.shape[1])
    kinds = ["bias"] * 3 + ["matrix"] * (len(shown) - 3)
    return figure(
        "Variance of what the polynomials leave of the bins, over that of their noise",
        Axis("order of the polynomial", -0.3, float(order[-1]) + 0.3),
        Axis(
            "variance of the scaled residuals, power of ten",
            min(-0.2, float(known.min())),
            max(1.0, 1.05 * float(known.max())),
        ),
        marks.upright("chosen", chosen, words="used"),
        *(
            marks.curve(f"of-{kind}", order, row, words=kind)
            for row, kind in zip(shown, kinds, strict=True)
        ),
        note=said,
    )


def draw_stations(found: Spread, held_out: HeldOut | None, unit: str) -> Figure:
    """The standard deviation of the readings at every station, before and after, as bars, for x, y,
    z and |B|."""
    kinds = [
        ("before", "before", found.stations, found.before),
        ("after", "after", found.stations, found.after),
    ]
    note = ""
    if held_out is not None:
        words = "after, by a fit that has not seen the station"
        kinds.append(("unseen", words, held_out.spread.stations, held_out.spread.after))
        note = f"{held_out.folds} fits, each without some of the stations, were tried on those."
    numbers, width = np.array(found.stations, dtype=np.float64), 0.8 / len(kinds)
    x = Axis("station", float(numbers.min()) - 0.6, float(numbers.max()) + 0.6)
    panels = []
    for column, component in enumerate(COMPONENTS):
        highest = max(float(values[:, column].max(initial=0.0)) for *_, values in kinds)
        drawn = []
        for k, (name, words, at, values) in enumerate(kinds):
            left, of = np.array(at) - 0.4 + k * width, values[:, column]
            ends = left, left + 0.92 * width, 0 * of, of
            drawn.append(marks.bars(f"bar {name}", *ends, words=words))
        y = Axis(f"{component}, {unit}", 0.0, 1.05 * max(highest, 1e-9))
        panels.append(Panel(x=x, y=y, marks=drawn, kind="small"))
    title = "Standard deviation of the readings over temperature"
    return Figure(title=title, panels=panels, note=note, style="multiples two")


def draw_courses(courses: Mapping[int, Course], profile: Profile | None) -> Figure:
    """The temperature at every station over time, a value a minute, broken where nothing was
    recorded, and the programme behind it."""
    x = Axis("hours", 0.0, max(len(course.level_C) for course in courses.values()) / 60)
    levels, programme = [course.level_C for course in courses.values()], []
    if profile is not None:
        levels.append(np.array([profile.lowest_C, profile.highest_C]))
        hours, planned = profile.corners[0] / 3600, profile.corners[1]
        there = hours <= x.high
        programme = [marks.curve("chosen", hours[there], planned[there], words="programme")]
    y, panels = fit_axis("°C", np.concatenate(levels)), []
    for number, course in courses.items():
        step = max(1, -(-len(course.level_C) // MOST_DOTS))
        shown = course.level_C[::step]
        across = (np.arange(len(shown)) * step + 0.5) / 60
        median = marks.curve("common", across, shown, words="median of the thermometers")
        own = replace(y, label=f"station {number}, °C")
        panels.append(Panel(x=x, y=own, marks=[*programme, median], kind="small"))
    return Figure(title="Temperature at each station", panels=panels, style="multiples courses")


def draw_chamber(found: ChamberField) -> Figure:
    """The chamber's field along each axis over time, and what each sensor saw."""
    panels = [_draw_chamber_axis(found, axis) for axis in range(len(found.axes))]
    return Figure(title="Changes of the field at each station, less their mean", panels=panels)


def _draw_chamber_axis(found: ChamberField, axis: int) -> Panel:
    x, along = along_time(found.time, 0.0, float(found.time.max()), since="the campaign began")
    common = found.change[:, axis]
    each = [common + share.own[:, axis] for share in found.shares]
    reach = float(np.percentile(np.abs(np.concatenate([common, *each])), 99.0))
    new_station = np.flatnonzero(np.diff(found.station)) + 1
    time, broken = (np.insert(values, new_station, np.nan) for values in (along, common))
    limit = 1.1 * max(reach, float(np.abs(common).max()), 1e-9)
    seen = "each sensor, mean of a window"
    drawn = [
        marks.level("zero", 0.0),
        *(marks.dots("dots each", along, values, words=seen) for values in each),
        marks.curve("common", time, broken, words="common to all sensors"),
    ]
    y = about_zero(f"{found.axes[axis]}, nT", limit)
    return Panel(x=replace(x, high=1.01 * x.high), y=y, marks=drawn, kind="short")
