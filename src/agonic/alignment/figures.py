"""Residuals as bars or over time, the sky where a star sensor looked, the angles: as SVG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.maths.rotations.frames import r2, r3
from agonic.report.axes import Axis, about_zero, over_rows
from agonic.report.digits import MINUS, group_digits
from agonic.report.figure import Figure, figure
from agonic.report.marks import Mark, bars, level, mean, spread
from agonic.report.markup import Markup, element

MIN_BARS = 5.0
"""That an axis has room for, so that its ticks are whole numbers."""
RADIUS, MAX_DOT = 130.0, 11.0
"""Of a drawing in the middle of a height of 320, and of the dot of the largest residual."""
LETTER_HIGH = 9.0


def draw_residuals(
    values: Array,
    sd: Array,
    numbers: NDArray[np.int64],
    along: str = "orientation",
    title: str = "Residuals along the magnetometer’s axes",
) -> Figure:
    """Residuals (k, 3), nT, of the orientations `numbers` (k,), a bar an axis. Bands reach to twice
    the standard deviations `sd` (k, 3), nT. `along` is what the numbers count."""
    limit = 1.1 * max(float(np.abs(values).max()), 2 * float(sd.max()), 1e-12)
    places = np.unique(numbers).astype(np.float64)
    first, step = float(places[0]), float(np.diff(places).min()) if len(places) > 1 else 1.0
    last = max(float(places[-1]), first + step * (MIN_BARS - 1))
    at, reach = numbers.astype(np.float64), 2 * np.sqrt((sd**2).mean(axis=1))
    x = Axis(along, first - step / 2, last + step / 2)
    marks = [_bars("band", at, 0.42 * step, -reach, reach, words="± 2 standard deviations")]
    for name, shift, one in zip("xyz", (-0.24, 0.0, 0.24), values.T, strict=True):
        middle = at + shift * step
        marks.append(_bars(f"bar-{name}", middle, 0.1 * step, 0 * one, one, words=name))
    y = about_zero("residual, nT", limit)
    return figure(title, x, y, *marks, level("zero", 0.0))


def draw_figure(drawn: Markup, caption: str) -> Markup:
    """A drawing with what it shows in words below."""
    return element("figure", drawn, element("figcaption", caption))


def draw_settings(values: Array, unit: str) -> Figure:
    """What is left of each setting (k,), a bar each, numbered from one."""
    x = Axis("setting", 0.5, max(len(values), MIN_BARS) + 0.5)
    shown = _bars("bar-x", np.arange(1.0, len(values) + 1), 0.3, 0 * values, values)
    return figure("Residuals", x, make_residual_axis(values, unit), shown, level("zero", 0.0))


def _bars(name: str, middle: Array, half: float, start: Array, end: Array, words: str = "") -> Mark:
    """Bars (k,) about the places `middle`, from one value to another."""
    return bars(name, middle - half, middle + half, start, end, words=words)


def svg(parts: list[Markup], name: str, label: str, wide: float = 320.0) -> Markup:
    """A drawing of a class, with what it shows in words."""
    box = f"0 0 {wide:g} 320"
    return element("svg", *parts, class_=name, viewBox=box, role="img", aria_label=label)


def svg_text(x: float, y: float, text: str, name: str) -> Markup:
    """Text of a class at a place."""
    return element("text", text.replace("-", MINUS), x=f"{x:.1f}", y=f"{y:.1f}", class_=name)


def draw_series(values: Array, time: Array | None, names: Sequence[str], unit: str) -> list[Figure]:
    """Columns of values (n, k) over time, a strip each; without times in their order."""
    y, columns = make_residual_axis(values, unit), over_rows(time, len(values))
    return [
        figure(name, columns.x, y, spread(columns, one), level("noise", 0.0), mean(columns, one))
        for name, one in zip(names, values.T, strict=True)
    ]


def make_residual_axis(values: Array, unit: str) -> Axis:
    """The axis of residuals, zero in its middle."""
    return about_zero(f"residual, {unit}", 1.1 * max(float(np.abs(values).max()), 1e-9))


def draw_dome(boresight_n: Array, numbers: NDArray[np.int64], residual_arcsec: Array) -> Markup:
    """The sky over the site as seen lying on one's back is mirrored; this is the map from above.
    North is up and east to the right, the zenith in the middle, the horizon at the rim, rings every
    30° of elevation."""
    north, east, down = boresight_n.T
    zenith = np.degrees(np.arccos(np.clip(-down, -1, 1)))
    return _draw_map(
        np.minimum(zenith, 100.0) / 90.0,
        np.arctan2(east, north),
        ("N", "E", "S", "W"),
        {1 / 3: 60, 2 / 3: 30},
        numbers,
        residual_arcsec,
        "over the site",
    )


def draw_sky(boresight_i: Array, numbers: NDArray[np.int64], residual_arcsec: Array) -> Markup:
    """The same among the stars: the nearer celestial pole in the middle, right ascension round it.
    The rim is the other pole; rings at declinations of 60°, 0° and −60° (of the other sign in the
    south)."""
    x, y, z = boresight_i.T
    side = -1 if z.mean() < 0 else 1
    hours = ("0 h", "18 h", "12 h", "6 h")  # seen from inside the sphere
    return _draw_map(
        np.arccos(np.clip(side * z, -1, 1)) / np.pi,
        -side * np.arctan2(y, x),
        hours if side > 0 else (hours[0], *reversed(hours[1:])),
        {1 / 6: side * 60, 1 / 2: 0, 5 / 6: side * -60},
        numbers,
        residual_arcsec,
        "among the stars",
    )


def _draw_map(
    away: Array,
    azimuth: Array,
    rim: tuple[str, ...],
    rings: dict[float, int],
    numbers: NDArray[np.int64],
    residual: Array,
    where: str,
) -> Markup:
    """A round map of directions `away` (k,) from the middle, as a share of the radius, and by
    `azimuth` (k,), rad, clockwise from the top: names round the rim from there, and rings with
    their angles. A dot is as large as its residual, ″, with its number beside it."""
    middle, far = 160.0, RADIUS + 14
    x, y = middle + RADIUS * away * np.sin(azimuth), middle - RADIUS * away * np.cos(azimuth)
    parts = [_circle(middle, middle, RADIUS * s, "ring") for s in (1.0, *reversed(rings))]
    for name, (aside, below) in zip(rim, ((0, -1), (1, 0), (0, 1), (-1, 0)), strict=True):
        parts.append(svg_text(middle + aside * far, middle + below * far + 4, name, "rim-name"))
    for s, angle in rings.items():
        parts.append(svg_text(middle + 4, middle - RADIUS * s - 3, f"{angle}°", "ring-name"))
    radius = 3.0 + (MAX_DOT - 3.0) * residual / max(float(residual.max()), 1e-12)
    for k in np.argsort(-radius):
        said = element("title", f"orientation {numbers[k]}: {residual[k]:.2f}″")
        parts.append(_circle(x[k], y[k], radius[k], "dot", said))
    parts += _names(x, y, radius, numbers)
    return svg(parts, "dome", f"Where the star sensor looked {where}")


def _circle(x: float, y: float, radius: float, name: str, *inside: Markup) -> Markup:
    at = {"cx": f"{x:.1f}", "cy": f"{y:.1f}", "r": f"{radius:.1f}"}
    return element("circle", *inside, **at, class_=name)


def _names(x: Array, y: Array, radius: Array, numbers: NDArray[np.int64]) -> list[Markup]:
    """The number of each orientation beside its dot; of several at one place, how many."""
    there: dict[tuple[int, int], list[int]] = {}
    for k in range(len(x)):
        there.setdefault((round(x[k]), round(y[k])), []).append(k)
    groups = list(there.values())
    names = [str(numbers[g[0]]) if len(g) == 1 else f"{len(g)}×" for g in groups]
    first = np.array([g[0] for g in groups])
    at = np.stack([x[first], y[first]], axis=1)
    drawn: list[Markup] = []
    for name, dot, place in zip(names, at, place_apart(at, radius[first], names), strict=True):
        if np.hypot(*(place - dot)) > MAX_DOT:
            lead = f"M{dot[0]:.1f} {dot[1]:.1f}L{place[0]:.1f} {place[1]:.1f}"
            drawn.insert(0, element("path", d=lead, class_="lead"))
        drawn.append(svg_text(place[0], place[1] + LETTER_HIGH / 3, name, "dot-name"))
    return drawn


def place_apart(at: Array, radius: Array, names: Sequence[str]) -> Array:
    """Where the names of dots stand (k, 2), so that none covers another: those in the middle of a
    crowd move farthest out of it."""
    box = np.array([[5.6 * len(name) + 3, LETTER_HIGH] for name in names])
    crowd = at.mean(axis=0)
    order = np.argsort(-np.hypot(*(at - crowd).T), kind="stable")
    placed: list[int] = []
    places = at.copy()
    for k in order:
        for place in _trials(at[k], float(radius[k])):
            apart = np.abs(places[placed] - place) >= (box[placed] + box[k]) / 2
            others = np.delete(np.arange(len(at)), k)
            clear = np.hypot(*(at[others] - place).T) > radius[others] + LETTER_HIGH / 3
            if apart.any(axis=1).all() and clear.all():
                places[k] = place
                break
        placed.append(int(k))
    return places


def _trials(dot: Array, radius: float) -> Iterator[Array]:
    """On the dot, then round it farther and farther away."""
    yield dot
    for away in np.arange(radius + LETTER_HIGH * 0.8, 8 * LETTER_HIGH, LETTER_HIGH / 2):
        for turn in np.radians(np.arange(0, 360, 30)):
            yield dot + away * np.array([np.cos(turn), np.sin(turn)])


def draw_axes(alpha_deg: float, beta_deg: float, gamma_deg: float) -> Markup:
    """Both sets of axes, and the arcs of R3(γ) R2(β) R3(α): about z, the new y, the newest z."""
    once = r3(np.radians(alpha_deg))
    twice = r2(np.radians(beta_deg)) @ once
    last = r3(np.radians(gamma_deg)) @ twice
    star = np.eye(3)
    flat = _choose_view(np.concatenate([star, last]))
    parts = [
        *_axis(flat, 0.9 * once[0], "x₁", ("between", "half-way"), 1.02 / 0.9),
        *_axis(flat, 0.5 * twice[0], "x₂", ("between", "half-way"), 0.62 / 0.5),
        *_arc(flat, star[0], star[2], alpha_deg, "α", 0.9),
        *_arc(flat, once[2], once[1], beta_deg, "β", 0.7),
        *_arc(flat, twice[0], twice[2], gamma_deg, "γ", 0.5),
    ]
    for axes, kind, sign in ((star, "old", ""), (last, "new", "₃")):
        for axis, name in zip(axes, "xyz", strict=True):
            parts += _axis(flat, axis, f"{name}{sign}", (f"{kind} line", kind), 1.1)
    parts.sort(key=lambda part: str(part).startswith("<text"))  # texts over all lines
    words = "Axes of the star sensor and of the magnetometer, and the three turns between them"
    return svg(parts, "axes", words, 420.0)


def _choose_view(axes: Array) -> Array:
    """The projection (3, 2) in which the ends of axes (k, 3) and the middle lie farthest apart, so
    that no axis points at the eye or hides another."""
    best, widest = np.zeros((3, 2)), -1.0
    for turn in np.linspace(0, 2 * np.pi, 72, endpoint=False):
        for rise in np.radians([20.0, 30.0, 40.0]):
            right = np.array([-np.sin(turn), np.cos(turn), 0.0])
            level = np.array([np.cos(turn), np.sin(turn), 0.0])
            up = np.array([0.0, 0.0, 1.0]) * np.cos(rise) - level * np.sin(rise)
            flat = np.stack([right, -up], axis=1)
            ends = np.concatenate([axes @ flat, np.zeros((1, 2))])
            apart = np.linalg.norm(ends[:, None] - ends, axis=2)
            nearest = float(apart[np.triu_indices(len(ends), 1)].min())
            if nearest > widest:
                best, widest = flat, nearest
    return best


def _place(flat: Array, vectors: Array) -> Array:
    """Places in the drawing (…, 2) of vectors (…, 3)."""
    return np.asarray([210.0, 160.0] + RADIUS * (vectors @ flat))


def _axis(
    flat: Array, end: Array, name: str, styles: tuple[str, str], label: float
) -> list[Markup]:
    """An axis with its name, at so many times its length."""
    (x0, y0), (x1, y1), (x, y) = _place(flat, np.outer([0.0, 1.0, label], end))
    drawn = element("path", d=f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}", class_=styles[0])
    return [drawn, svg_text(x, y + 4, name, styles[1])]


def _arc(
    flat: Array, start: Array, about: Array, angle_deg: float, name: str, radius: float
) -> list[Markup]:
    """The turn of an axis by an angle, right-handed, with its value half-way."""
    steps = np.radians(np.linspace(0.0, angle_deg, 40))[:, None]
    across = np.cross(about, start)
    path = radius * (np.cos(steps) * start + np.sin(steps) * across)
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in _place(flat, path))
    x, y = _place(flat, 1.15 * path[len(path) // 2])
    return [
        element("polyline", points=places, class_="turn"),
        svg_text(x, y, f"{name} = {group_digits(angle_deg, 3)}°", "angle"),
    ]
