"""Figures of one calibrated sensor: spheres before and after with what the page's script draws them
from, magnitude, residuals."""

from __future__ import annotations

import base64
from collections.abc import Mapping
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
from agonic.report.axes import Axis, Columns, along_rows, down, right
from agonic.report.digits import count, degrees, group_digits, percent, quantity
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, markup
from agonic.report.strips import (
    arrows,
    beyond_words,
    caption,
    level,
    line,
    mark_rows,
    path,
    plot,
    points,
    spread,
)

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


def draw_residuals(result: Calibrated, residuals: Residuals) -> list[Markup]:
    """The magnitude over time; residuals over time, as a histogram and over the sphere."""
    noise = quantity(residuals.noise, residuals.unit, 2)
    strips = [_caption_strip(result, residuals, "Residuals over time", f"± noise, {noise}")]
    for kind, channel in result.fit.channels.items():
        if kind != "magnitude":  # what the attitude gives: how far from its dip and its azimuth
            own = replace(residuals, values=channel.residuals, noise=channel.noise)
            scatter = quantity(channel.noise, residuals.unit, 2)
            words = f"± scatter, {scatter}: the sensor’s noise and the attitude’s"
            strips.append(_caption_strip(result, own, f"Residuals of the {kind} over time", words))
    usual = np.median(residuals.weights[residuals.weights > 0]) if residuals.weights.any() else 1.0
    doubted = int(np.sum(residuals.weights < 0.5 * usual))  # repeated readings share one weight
    histogram = caption(
        "Histogram of residuals",
        draw_histogram(residuals),
        {"bars": "readings", "normal": f"normal curve of the noise, {noise}"},
        f"{count(doubted, 'reading')} {'counts' if doubted == 1 else 'count'} less than half in "
        "the fit.",
    )
    shows = f"Mean residual of each direction. {residuals.worst}"
    sphere = _draw_sphere(
        "residuals",
        shows,
        f"{shows} Near half and far half of the sphere; full colour at "
        f"±{quantity(residuals.mean_limit, residuals.unit, 2)}, "
        f"blank with fewer than {MIN_IN_CELL} readings.",
        class_="wide",
    )
    keys = {"before": "before", "after": "after the correction"}
    picked = result.samples.time is not None and result.samples.source is not None
    return [
        caption("Magnitude over time", draw_magnitude(result), keys, PICK if picked else ""),
        *strips,
        element("div", histogram, sphere, class_="pair"),
    ]


def _caption_strip(result: Calibrated, residuals: Residuals, name: str, noise: str) -> Markup:
    """Residuals over time, with the words of its colours; `noise` are those of its lines."""
    keys = {"range": "least to largest", "mean": "mean, weighted as in the fit", "noise": noise}
    if find_held_out(result) is not None:
        keys["held-out"] = "held out of the fit"
    beyond = beyond_words(residuals.values, residuals.limit, residuals.unit)
    return caption(name, draw_strip(result, residuals), keys, beyond)


def draw_strip(result: Calibrated, residuals: Residuals) -> Markup:
    """Residuals over time with lines at the stated noise, and a bar under what was held out."""
    limit = residuals.limit
    x, along = along_rows(result.samples.time, np.arange(len(result.samples)))
    y = Axis(f"residual, {residuals.unit}", -limit, limit)
    columns = Columns(x, along)
    layers = [
        spread(columns, y, residuals.values, "range"),
        line(columns, y, columns.mean(residuals.values, residuals.weights), "mean"),
        *(level(y, at * residuals.noise, "noise") for at in (-1.0, 1.0)),
    ]
    held_out = find_held_out(result)
    if held_out is not None:
        layers.append(mark_rows(columns, held_out, "held-out"))
    label = f"Residuals between −{limit:.3g} and +{limit:.3g} over time"
    return plot(x, y, layers, label, arrows(columns, y, residuals.values))


def draw_histogram(residuals: Residuals, bins: int = 60) -> Markup:
    """How often each residual occurs, with the normal curve of the stated noise."""
    limit = residuals.limit
    counts, edges = np.histogram(residuals.values, bins=bins, range=(-limit, limit))
    at = np.linspace(-limit, limit, 201)
    expected, noise = np.zeros_like(at), residuals.noise
    if noise > 0.0:
        normal = np.exp(-0.5 * (at / noise) ** 2) / (noise * np.sqrt(2 * np.pi))
        expected = len(residuals.values) * (edges[1] - edges[0]) * normal
    x = Axis(f"residual, {residuals.unit}", -limit, limit)
    y = Axis("readings", 0.0, 1.05 * float(max(counts.max(), expected.max(), 1.0)))
    steps = np.repeat(right(x, edges), 2)[1:-1], np.repeat(down(y, counts * 1.0), 2)
    layers = [
        path(f"M0 1000L{points(*steps)}L1000 1000Z", "bars"),
        path(f"M{points(right(x, at), down(y, expected))}", "normal"),
    ]
    return plot(x, y, layers, "Histogram of residuals with the normal curve of the stated noise")


def draw_magnitude(result: Calibrated) -> Markup:
    """The magnitude of the field over time, before and after the correction: on one axis, or on two
    where the readings are in another unit than the field."""
    checked, calibration = result.verification, result.fit.calibration
    before = {"before": checked.magnitude_before}
    after = {"after": checked.magnitude_after}
    into, out = (unit_label(u) for u in (calibration.unit_in, calibration.unit_out))
    if into == out:
        return _draw_magnitudes(result, before | after, out)
    return markup(_draw_magnitudes(result, before, into), _draw_magnitudes(result, after, out))


def _draw_magnitudes(result: Calibrated, magnitudes: Mapping[str, Array], unit: str) -> Markup:
    """Magnitudes by their class. The axis holds what counted in the fit; of the rest, arrows say
    where it lies beyond."""
    weights = result.fit.weights
    counted = np.ones(len(result.samples), dtype=bool) if weights is None else weights > 0
    if not counted.any():
        counted[:] = True
    every = np.concatenate([values[counted] for values in magnitudes.values()])
    low, high = (float(v) for v in np.percentile(every, (0.25, 99.75)))
    reach = 0.25 * (high - low)  # so that noise is not cut off, and outliers still are
    low, high = max(low - reach, float(every.min())), min(high + reach, float(every.max()))
    margin = max(0.05 * (high - low), 1e-6 * abs(high), 1e-9)
    x, along = along_rows(result.samples.time, np.arange(len(result.samples)))
    y = Axis(f"magnitude, {unit}", low - margin, high + margin)
    columns = Columns(x, along)
    layers = [spread(columns, y, values, name) for name, values in magnitudes.items()]
    words = f"Magnitude of the field over time, {' and '.join(magnitudes)}"
    return plot(x, y, layers, words, arrows(columns, y, [*magnitudes.values()][-1]))


def draw_headings(result: Calibrated) -> list[Markup]:
    """The heading's error over the heading of the level vehicle: as recorded beside the standard
    error of the calibration; by the fits between, folded."""
    first, *others = (rung for rung in result.ladder if rung.errors_deg)
    vehicle = None if result.fit.accuracy is None else result.fit.accuracy.vehicle_heading_deg
    sd = result.fit.coverage.heading_sd_deg if vehicle is None else vehicle
    keys = {"mean": f"as recorded, {degrees(first.heading_error_deg)} rms"}
    keys["noise"] = f"calibrated: ± its standard error, {degrees(sd)}"
    between = [one for one in others if not one.chosen]
    folded = [_draw_heading_error(one.name, one, {}) for one in between]
    said = element("summary", "By the simpler fits")
    return [
        _draw_heading_error("Heading error, level", first, keys, sd),
        element("details", said, *folded, class_="folded") if folded else element("div"),
    ]


def _draw_heading_error(name: str, rung: Rung, keys: dict[str, str], sd: float = 0.0) -> Markup:
    """The mean error of a fit at each heading, and lines at a standard error where one is given."""
    errors = np.array([*rung.errors_deg, rung.errors_deg[0]])
    limit = 1.1 * max(float(np.abs(errors).max()), sd, 0.01)
    x, y = Axis("true heading, °", 0.0, 360.0), Axis("error, °", -limit, limit)
    at = points(right(x, np.linspace(0.0, 360.0, len(errors))), down(y, errors))
    lines = [level(y, side * sd, "noise") for side in (-1.0, 1.0) if sd]
    drawn = plot(x, y, [*lines, path(f"M{at}", "mean")], f"{name}: error over the heading")
    note = "" if keys else f"{degrees(rung.heading_error_deg)} rms"
    return caption(name, drawn, keys, note)
