"""Figures of a flight: residuals over time and along other quantities, the bias, the map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index
from agonic.inflight.report.flight import Course, Flight
from agonic.report.axes import Axis, Columns, about_zero, along_time, over_time, right
from agonic.report.digits import group_digits, quantity
from agonic.report.figure import Figure, Panel, beyond_words, figure, path, robust_limit
from agonic.report.labels import unit_label
from agonic.report.marks import band, foot, line, residuals, span, spread, upright
from agonic.report.markup import Markup, element

MOST_SHADOWS = 60
"""Stretches of shadow beyond which they are too narrow to be drawn."""
CELLS = (90, 45)
"""Cells of the map, across and down."""
SHADES = 5
"""Steps of colour from none to full."""
_WIDE_DEG = 60.0  # an area from which the map shows the whole Earth


def residual_limit(flight: Flight) -> float:
    """Half the height of the strips, nT: what was used is inside."""
    least = max(5.0 * flight.noise, 1e-6)
    return robust_limit(flight.residuals, least, flight.used.astype(np.float64))


def draw_over_time(flight: Flight, limit: float) -> Figure:
    """Residuals over time; the shadow of the Earth behind them, what was left out at the foot."""
    x, along = along_time(flight.time, float(flight.time[0]), float(flight.time[-1]))
    columns = Columns(x, along)
    begin, end = (along[np.minimum(rows, len(along) - 1)] for rows in find_shadows(flight).T)
    return figure(
        "Over time",
        x,
        about_zero("residual, nT", limit),
        span("shadow", begin, end, words="in the Earth’s shadow"),
        *residuals(columns, flight.residuals),
        foot(columns, ~flight.used, "left-out", "mostly left out"),
        note=beyond_words(flight.residuals, limit, "nT"),
    )


def draw_along(flight: Flight, values: Array, name: str, unit: str, limit: float) -> Figure:
    """Residuals along another quantity: of each column the extremes, the middle and the median.

    What was left out, such as a filter's start, is drawn over time alone: here it would hide what
    goes with the quantity.
    """
    left = flight.residuals
    if flight.used.any():
        values, left = values[flight.used], left[flight.used]
    low, high = float(values.min()), float(values.max())
    x = Axis(f"{name}, {unit}", low, high if high > low else low + 1.0)
    # readings that a column needs on average before its quartiles are drawn
    columns = Columns(x, values, int(np.clip(len(values) // 25, 8, 180)))
    y = about_zero("residual, nT", limit)
    return figure(f"Along {name}", x, y, *residuals(columns, left))


def find_shadows(flight: Flight) -> Index:
    """Where each stretch of shadow begins and where the next begins that is none, (s, 2); none
    where there are so many that they cannot be drawn."""
    shadow = np.zeros(1, dtype=bool) if flight.eclipse is None else flight.eclipse
    edges = np.flatnonzero(np.diff(shadow.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    return edges if len(edges) <= MOST_SHADOWS else edges[:0]


def draw_course(course: Course, words: str) -> Figure:
    """The bias over time, whose words these are, with its band and its jumps."""
    title = f"Bias along x, y and z, {unit_label(course.unit)}"
    return Figure(title=title, panels=[_draw_bias(course, axis, words) for axis in range(3)])


def draw_direction(time: Array, error_deg: Array, used: Array) -> Figure:
    """The angle to the field of the model over time; `used` are those that took part."""
    columns = over_time(time)
    y = Axis("angle, °", 0.0, max(1.1 * float(np.percentile(used, 99.5)), 1e-9))
    middle = columns.percentiles(error_deg, (50.0,))[0]
    marks = spread(columns, error_deg), line(columns, middle, words="median")
    return figure("Angle to the field of the model", columns.x, y, *marks)


def _draw_bias(course: Course, axis: int, words: str) -> Panel:
    """One axis of the bias over time with the band of two standard errors, and the jumps."""
    x, at = along_time(course.time, float(course.time[0]), float(course.time[-1]))
    if x.high == x.low:
        x = Axis(x.label, x.low, x.low + 1.0)
    bias, sd = course.bias[:, axis], course.sd[:, axis]
    usual = float(np.median(sd))
    settled = sd <= 5 * usual
    low = float((bias - 2 * sd)[settled].min())
    high = float((bias + 2 * sd)[settled].max())
    margin = max(0.08 * (high - low), 1e-9 * abs(high), 1e-9)
    columns = Columns(x, at)
    mean, known = columns.mean(bias), columns.mean(sd)
    mean = np.where(known <= 5 * usual, mean, np.nan)  # what is not known yet is left blank
    scale = (x.high - x.low) / max(course.time[-1] - course.time[0], 1e-9)
    jumps = [(jump.time - course.time[0]) * scale for jump in course.jumps]
    marks = [
        band(columns, mean - 2.0 * known, mean + 2.0 * known, words="± 2 standard errors"),
        line(columns, mean, "bias", words),
        upright("jump", jumps, words="a jump"),
    ]
    y = Axis(f"{'xyz'[axis]}, {course.unit}", low - margin, high + margin)
    return Panel(x=x, y=y, marks=marks, kind="short")


def draw_map(flight: Flight, limit: float) -> Figure:
    """The mean residual of each cell of latitude and longitude, outliers clipped; colour is full at
    a mean that one cell in fifty exceeds."""
    latitude, longitude = flight.latitude_deg, flight.longitude_deg
    assert latitude is not None
    assert longitude is not None
    x, y, east = _map_axes(latitude, longitude)
    across, below = CELLS
    column = np.minimum((x.share(east) * across).astype(np.int64), across - 1)
    row = np.minimum(((1 - y.share(latitude)) * below).astype(np.int64), below - 1)
    cell = (row * across + column)[flight.used]
    counts = np.bincount(cell, minlength=across * below)
    clipped = np.clip(flight.residuals[flight.used], -limit, limit)
    sums, seen = np.bincount(cell, clipped, minlength=across * below), np.flatnonzero(counts)
    means = sums[seen] / counts[seen]
    full, alone = 1.0, 1.0
    if len(seen):
        full = max(float(np.percentile(np.abs(means), 98)), 1e-9)
        alone = max(float(np.median(counts[seen])) / flight.correlation, 1.0)
    shade = np.round(SHADES * np.clip(means / full, -1, 1)).astype(int)
    layers = [_cells(seen[shade == k], int(k)) for k in np.unique(shade)]
    ends = (element("span", f"{sign}{quantity(full, 'nT', 2)}") for sign in "−+")
    scale = element("p", next(ends), element("i", class_="ramp through"), *ends, class_="legend")
    sd = quantity(flight.noise / float(np.sqrt(alone)), "nT", 2)
    note = f"The mean residual of the readings in a cell, which a typical cell knows to ±{sd}."
    panel = Panel(x=x, y=y, marks=layers, kind="map")
    return Figure(title="Where the residuals lie", panels=[panel], note=note, above=scale)


def _map_axes(latitude: Array, longitude: Array) -> tuple[Axis, Axis, Array]:
    """Axes round the track, or round the Earth, and the longitudes as they lie on them."""
    east = (longitude + 180.0) % 360.0 - 180.0
    if np.ptp(east) > 180.0:
        shifted = longitude % 360.0
        if np.ptp(shifted) < _WIDE_DEG:  # a small area across the date line
            east = shifted
    if max(np.ptp(east), np.ptp(latitude)) >= _WIDE_DEG:
        return Axis("longitude, °", -180.0, 180.0), Axis("latitude, °", -90.0, 90.0), east
    reach = 0.55 * max(float(np.ptp(latitude)), float(np.ptp(east)) / 2, 1e-4)
    centre = float(latitude.min() + latitude.max()) / 2, float(east.min() + east.max()) / 2
    return (
        Axis("longitude, °", centre[1] - 2 * reach, centre[1] + 2 * reach),
        Axis("latitude, °", centre[0] - reach, centre[0] + reach),
        east,
    )


def _cells(cells: NDArray[np.int64], shade: int) -> Markup:
    """All cells of one shade as one path."""
    across, below = CELLS
    left, top = 1000.0 * (cells % across) / across, 1000.0 * (cells // across) / below
    wide, tall = 1000.0 / across, 1000.0 / below
    squares = (
        f"M{a:.1f} {b:.1f}h{wide:.1f}v{tall:.1f}h-{wide:.1f}z"
        for a, b in zip(left, top, strict=True)
    )
    name = "none" if shade == 0 else "low" if shade < 0 else "high"
    strength = 1.0 if shade == 0 else abs(shade) / SHADES
    return path("".join(squares), f"cell {name}", fill_opacity=f"{strength:.2g}")


def draw_sigmas(sigmas: float, reach: float) -> Markup:
    """A change in units of its standard error as a bar about zero, with lines at ±1 and ±2 and a
    whisker of one standard error to either side."""
    axis = Axis("", -reach, reach)
    zero, end = (float(right(axis, np.array(v))) for v in (0.0, sigmas))
    low, high = (float(right(axis, np.array(sigmas + step))) for step in (-1.0, 1.0))
    lines = (f"M{float(right(axis, np.array(v))):.0f} 0V100" for v in (-2.0, -1.0, 1.0, 2.0))
    kind = "bar far" if abs(sigmas) > 3.0 else "bar"
    parts = [
        path("".join(lines), "grid"),
        path(f"M{zero:.0f} 0V100", "zero"),
        path(f"M{zero:.0f} 25H{end:.0f}V75H{zero:.0f}Z", kind),
        path(f"M{low:.0f} 50H{high:.0f}", "whisker"),
    ]
    said = f"{group_digits(sigmas, 1)} standard errors"
    return element(
        "svg",
        *parts,
        class_="sigma",
        viewBox="0 0 1000 100",
        preserveAspectRatio="none",
        role="img",
        aria_label=said,
    )
