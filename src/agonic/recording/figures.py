"""Figures of one calibrated sensor: spheres before and after with what the page's script draws them
from, magnitude, residuals."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.maths.equation.coverage import icosphere
from agonic.maths.one_pass import find_length, median
from agonic.recording.calibrated import Calibrated
from agonic.recording.ladder import Rung
from agonic.recording.quantities import MIN_IN_CELL, Residuals, find_held_out, find_level
from agonic.report.axes import Axis, about_zero, over_rows
from agonic.report.digits import count, degrees, group_digits, percent, quantity
from agonic.report.figure import Figure, Panel, beyond_words, figure
from agonic.report.labels import unit_label
from agonic.report.marks import curve, foot, histogram, level, line, spread
from agonic.report.markup import Markup, element

MOST_POINTS = 50_000
"""Points that a report holds, over all its sensors; more are thinned evenly."""

_REACH = 4.0  # in radii: what lies farther is drawn there, so that one stray costs no resolution
_STEPS = 32767  # of an int16
_EDGE = 0.85  # of a distance that is still inside the picture: above 2 FILL of canvas.js


def list_corners() -> list[float]:
    """The corners of the 80 cells, nine numbers a cell."""
    return [float(v) for v in icosphere()[1].round(4).ravel()]


def pack_sphere(result: Calibrated, residuals: Residuals, most: int) -> dict[str, Any]:
    """All that the page's script needs to draw one sensor. Points are raw − bias as base64 int16 in
    `step`s of raw units; `matrix` turns them into the field, `bias` back into readings. Magnitudes
    are coloured up to the relative `deviation` from `levelRaw` before and `level` after; `counts`
    and `means` (null where few) are per cell."""
    calibration = result.fit.calibration
    centred = (result.cleaned - calibration.bias)[thin(len(result.samples), most)]
    radius = median(find_length(centred)) or 1.0
    middle, extent = find_middle(centred)
    size = np.linalg.norm(centred, axis=1, keepdims=True)
    inside = centred * np.minimum(1.0, _REACH * radius / np.maximum(size, radius))
    step = max(float(np.abs(inside).max()), radius) / _STEPS
    points = np.round(inside / step).astype("<i2")
    return {
        "points": base64.b64encode(points.tobytes()).decode(),
        "step": step,
        "radius": extent,
        "middle": middle.tolist(),
        "bias": calibration.bias.tolist(),
        "matrix": calibration.matrix.ravel().tolist(),
        "levelRaw": float(np.mean(np.linalg.norm(centred + calibration.bias, axis=1))),
        "level": find_level(result),
        "deviation": find_deviation_limit(result),
        "counts": result.fit.coverage.cells.tolist(),
        "means": [None if np.isnan(m) else float(m) for m in residuals.means],
        "meanLimit": residuals.mean_limit,
    }


def find_middle(centred: Array) -> tuple[Array, float]:
    """Where the cloud of readings is shown about, (3,) from the bias, and how far it reaches. About
    the bias, or where that lies outside the cloud, as of a refused fit, about its middle."""
    middle = np.median(centred, axis=0)
    away = np.linalg.norm(centred - middle, axis=1)
    if float(np.linalg.norm(middle)) > 1.5 * float(np.percentile(away, 90)):
        return middle, _EDGE * float(np.percentile(away, 95)) or 1.0
    size = find_length(centred)
    return np.zeros(3), max(median(size), _EDGE * float(np.percentile(size, 95))) or 1.0


def thin(n: int, most: int) -> NDArray[np.int64]:
    """Rows that are shown: all, or `most` of them evenly."""
    return np.linspace(0, n, min(n, most), endpoint=False).astype(np.int64)


def find_deviation_limit(result: Calibrated) -> float:
    """The relative deviation of the magnitude at which colour is full, to one digit. It covers 98 %
    of the readings before the correction, and is the same before and after."""
    magnitude = result.verification.magnitude_before
    relative = np.abs(magnitude / max(float(magnitude.mean()), np.finfo(float).tiny) - 1.0)
    reach = max(float(np.percentile(relative, 98)), 1e-4)
    power = 10.0 ** np.floor(np.log10(reach))
    return float(np.ceil(reach / power) * power)


def describe_coverage(result: Calibrated) -> str:
    """How many of the 80 cells were visited."""
    cells = result.fit.coverage.cells
    visited = int(np.count_nonzero(cells))
    return f"{visited} of {len(cells)} directions were visited"


PICK = "Drag along a strip of time for the command that calibrates that interval."
TURNING = "Drag to turn (start sideways on a touch screen) or use the arrow keys; Home turns back."


def draw_spheres(result: Calibrated, most: int) -> list[Markup]:
    """Two canvases that turn together, with what they show in words; `most` points are drawn."""
    n, verification = len(result.samples), result.verification
    calibration = result.fit.calibration
    middle, extent = find_middle(result.cleaned - calibration.bias)
    about = "their own centre, as the bias lies outside" if middle.any() else "the bias"
    size = quantity(extent, unit_label(calibration.unit_in), 3)
    level = quantity(find_level(result), unit_label(calibration.unit_out), 3)
    limit = percent(find_deviation_limit(result))
    drawn = f"{group_digits(most)} of {group_digits(n)} readings are drawn, evenly chosen."
    return [
        element(
            "div",
            _draw_sphere(
                "before",
                f"Raw readings, whose magnitude spreads by {percent(verification.spread_before)}.",
                f"Before: readings as logged, about {about}, axes drawn from {size} "
                "outwards; the cross is where a reading of zero lies.",
            ),
            _draw_sphere(
                "after",
                "Calibrated readings, whose magnitude spreads by "
                f"{percent(verification.spread_after)}; {describe_coverage(result)}.",
                f"After: the calibrated field, axes drawn from {level} outwards, and the 80 "
                "directions; those never seen are red.",
            ),
            class_="pair",
        ),
        element(
            "p",
            element("span", f"−{limit} "),
            element("i", class_="ramp"),
            element("span", f" +{limit}"),
            " magnitude against its mean, in the same colours before and after",
            class_="legend",
        ),
        element(
            "p",
            f"All {group_digits(n)} readings are drawn." if n <= most else drawn,
            " ",
            element("span", TURNING, class_="screen-only"),
            class_="aside",
        ),
    ]


def _draw_sphere(part: str, shows: str, caption: str, **attributes: str) -> Markup:
    canvas = element(
        "canvas",
        shows,
        data_part=part,
        tabindex=0,
        role="img",
        aria_label=f"{shows} Arrow keys turn it.",
    )
    return element("figure", canvas, element("figcaption", caption), **attributes)


def draw_residuals(result: Calibrated, residuals: Residuals) -> list[Markup | Figure]:
    """The magnitude over time; residuals over time, as a histogram and over the sphere."""
    noise = quantity(residuals.noise, residuals.unit, 2)
    strips = [draw_strip(result, residuals, "Residuals over time", f"± noise, {noise}")]
    for kind, channel in result.fit.channels.items():
        if kind != "magnitude":  # what the attitude gives: how far from its dip and its azimuth
            own = replace(residuals, values=channel.residuals, noise=channel.noise)
            scatter = quantity(channel.noise, residuals.unit, 2)
            words = f"± scatter, {scatter}: the sensor’s noise and the attitude’s"
            strips.append(draw_strip(result, own, f"Residuals of the {kind} over time", words))
    shows = f"Mean residual of each direction. {residuals.worst}"
    sphere = _draw_sphere(
        "residuals",
        shows,
        f"{shows} Near half and far half of the sphere; full colour at "
        f"±{quantity(residuals.mean_limit, residuals.unit, 2)}, "
        f"blank with fewer than {MIN_IN_CELL} readings.",
        class_="wide",
    )
    histogram = draw_histogram(residuals).to_html()
    return [draw_magnitude(result), *strips, element("div", histogram, sphere, class_="pair")]


def draw_strip(result: Calibrated, residuals: Residuals, title: str, noise: str) -> Figure:
    """Residuals over time with lines at the stated noise, whose words are `noise`, and a bar under
    what was held out."""
    columns, values = over_rows(result.samples.time, len(result.samples)), residuals.values
    held_out = find_held_out(result)
    unseen = np.zeros(len(values), dtype=bool) if held_out is None else held_out
    weighted = columns.mean(values, residuals.weights)
    return figure(
        title,
        columns.x,
        about_zero(f"residual, {residuals.unit}", residuals.limit),
        spread(columns, values),
        line(columns, weighted, words="mean, weighted as in the fit"),
        level("noise", [-residuals.noise, residuals.noise], words=noise),
        foot(columns, unseen, "held-out", "held out of the fit"),
        note=beyond_words(values, residuals.limit, residuals.unit),
    )


def draw_histogram(residuals: Residuals, bins: int = 60) -> Figure:
    """How often each residual occurs, with the normal curve of the stated noise."""
    limit, weights = residuals.limit, residuals.weights
    counts, edges = np.histogram(residuals.values, bins=bins, range=(-limit, limit))
    at = np.linspace(-limit, limit, 201)
    expected, noise = np.zeros_like(at), residuals.noise
    if noise > 0.0:
        normal = np.exp(-0.5 * (at / noise) ** 2) / (noise * np.sqrt(2 * np.pi))
        expected = len(residuals.values) * (edges[1] - edges[0]) * normal
    usual = np.median(weights[weights > 0]) if weights.any() else 1.0
    doubted = int(np.sum(weights < 0.5 * usual))  # repeated readings share one weight
    stated = quantity(noise, residuals.unit, 2)
    return figure(
        "Histogram of residuals",
        about_zero(f"residual, {residuals.unit}", limit),
        Axis("readings", 0.0, 1.05 * float(max(counts.max(), expected.max(), 1.0))),
        histogram("bars", counts, edges, words="readings"),
        curve("normal", at, expected, words=f"normal curve of the noise, {stated}"),
        note=f"{count(doubted, 'reading')} {'counts' if doubted == 1 else 'count'} less than half "
        "in the fit.",
    )


def draw_magnitude(result: Calibrated) -> Figure:
    """The magnitude of the field over time, before and after the correction: on one axis, or on two
    where the readings are in another unit than the field."""
    checked, calibration = result.verification, result.fit.calibration
    columns = over_rows(result.samples.time, len(result.samples))
    values = {"before": checked.magnitude_before, "after": checked.magnitude_after}
    words = {"before": "before", "after": "after the correction"}
    into, out = (unit_label(u) for u in (calibration.unit_in, calibration.unit_out))
    together = [(out, ["before", "after"])]
    panels = []
    for unit, names in together if into == out else [(into, ["before"]), (out, ["after"])]:
        y = _hold_counted(result, [values[name] for name in names], f"magnitude, {unit}")
        marks = [spread(columns, values[name], name, words[name]) for name in names]
        panels.append(Panel(x=columns.x, y=y, marks=marks))
    picked = result.samples.time is not None and result.samples.source is not None
    return Figure(title="Magnitude over time", panels=panels, note=PICK if picked else "")


def _hold_counted(result: Calibrated, magnitudes: Sequence[Array], label: str) -> Axis:
    """An axis that holds what counted in the fit; of the rest, arrows say where it lies beyond."""
    weights = result.fit.weights
    counted = np.ones(len(result.samples), dtype=bool) if weights is None else weights > 0
    if not counted.any():
        counted[:] = True
    every = np.concatenate([values[counted] for values in magnitudes])
    low, high = (float(v) for v in np.percentile(every, (0.25, 99.75)))
    reach = 0.25 * (high - low)  # so that noise is not cut off, and outliers still are
    low, high = max(low - reach, float(every.min())), min(high + reach, float(every.max()))
    margin = max(0.05 * (high - low), 1e-6 * abs(high), 1e-9)
    return Axis(label, low - margin, high + margin)


def draw_headings(result: Calibrated) -> list[Markup | Figure]:
    """The heading's error over the heading of the level vehicle: as recorded beside the standard
    error of the calibration; by the fits between, folded."""
    first, *others = (rung for rung in result.ladder if rung.errors_deg)
    vehicle = None if result.fit.accuracy is None else result.fit.accuracy.vehicle_heading_deg
    sd = result.fit.coverage.heading_sd_deg if vehicle is None else vehicle
    recorded = f"as recorded, {degrees(first.heading_error_deg)} rms"
    folded = [_draw_heading_error(one.name, one).to_html() for one in others if not one.chosen]
    said = element("summary", "By the simpler fits")
    return [
        _draw_heading_error("Heading error, level", first, recorded, sd),
        element("details", said, *folded, class_="folded") if folded else element("div"),
    ]


def _draw_heading_error(title: str, rung: Rung, words: str = "", sd: float = 0.0) -> Figure:
    """The mean error of a fit at each heading, and lines at a standard error where one is given."""
    errors = np.array([*rung.errors_deg, rung.errors_deg[0]])
    stated = f"calibrated: ± its standard error, {degrees(sd)}"
    return figure(
        title,
        Axis("true heading, °", 0.0, 360.0),
        about_zero("error, °", 1.1 * max(float(np.abs(errors).max()), sd, 0.01)),
        curve("mean", np.linspace(0.0, 360.0, len(errors)), errors, words=words),
        level("noise", [-sd, sd] if sd else [], words=stated),
        note="" if words else f"{degrees(rung.heading_error_deg)} rms",
    )
