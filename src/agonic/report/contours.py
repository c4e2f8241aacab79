"""Maps: lines of equal value over two axes of equal scale, and what stands on them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from agonic.arrays import Array
from agonic.report.axes import Axis
from agonic.report.digits import significant
from agonic.report.figure import Panel, caption, path
from agonic.report.markup import Markup, element

MAP_ASPECT = 1.5
"""Width over height of a map, as `contours.css` has it for plots of the kind "contours"."""


def fit_axes(labels: tuple[str, str], at: Array, margin: float = 0.1) -> tuple[Axis, Axis]:
    """Axes across and up that show places (n, 2) at one scale."""
    low, high = at.min(axis=0), at.max(axis=0)
    middle, span = (low + high) / 2, (1 + 2 * margin) * np.maximum(high - low, 1e-6)
    tall = max(span[1], span[0] / MAP_ASPECT)
    half = np.array([tall * MAP_ASPECT, tall]) / 2
    ends = [(float(a), float(b)) for a, b in zip(middle - half, middle + half, strict=True)]
    return Axis(labels[0], *ends[0]), Axis(labels[1], *ends[1])


def list_nodes(x: Axis, y: Axis, rows: int = 26) -> tuple[Array, tuple[int, int]]:
    """Places (n, 2) of a grid over two axes, row by row from below, and its (rows, columns)."""
    shape = (rows, round(rows * MAP_ASPECT))
    up, across = np.linspace(y.low, y.high, shape[0]), np.linspace(x.low, x.high, shape[1])
    return np.stack([np.tile(across, shape[0]), np.repeat(up, shape[1])], axis=1), shape


def draw_map(
    axes: tuple[Axis, Axis],
    values: Array,
    levels: Array,
    unit: str = "",
    *,
    title: str,
    keys: Mapping[str, str],
    marks: Iterable[tuple[str, Array]],
    names: Iterable[tuple[str, Array, str]],
    said: str = "",
) -> Markup:
    """Lines on which values (rows, columns) of a grid reach levels, the higher the thicker.

    `marks` stand on the map by their class in the style sheet: dots at places (n, 2), lines from
    end to end (n, 2, 2); `names` beside places (2,), with their class. `keys` are the words of the
    classes, `said` is read out where it differs from the `title`.
    """
    layers, labels = [], []
    for k, level in enumerate(np.sort(levels)):
        line = trace_contour(values, level)
        layers.append(_draw_lines(line, f"contour level-{min(k, 4)}"))
        if len(line):
            room = (line[:, 0] < 0.93).all(axis=1)  # right of the point and above it
            at = line[np.argmax(line[:, 0].sum(axis=1) * room), 0]
            labels.append(_write_beside(f"{significant(float(level), 2)}{unit}", at, "level"))
    for name, at in marks:
        ends = at if at.ndim == 3 else np.stack([at, at], axis=1)
        layers.append(_draw_lines(_locate(axes, ends), name))
    labels += [_write_beside(text, _locate(axes, at), name) for text, at, name in names]
    panel = Panel(
        x=axes[0], y=axes[1], marks=layers, said=said or title, signs=labels, kind="contours"
    )
    return caption(title, panel.to_html(), keys)


def trace_contour(values: Array, level: float) -> Array:
    """Pieces (n, 2, 2) of the line on which values (rows, columns) of a grid over the whole map
    reach a level, 0…1 from the left and from below. Each cell is two triangles, in which values
    are linear."""
    rows, columns = values.shape
    up, across = np.mgrid[0:rows, 0:columns]
    nodes = np.stack([across / (columns - 1), up / (rows - 1), values - level], axis=-1)
    a, b, c, d = nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, 1:], nodes[1:, :-1]
    corners = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)
    corners = corners[np.isfinite(corners[..., 2]).all(axis=1)]
    ends = np.roll(corners, -1, axis=1)
    crossed = (corners[..., 2] > 0) != (ends[..., 2] > 0)
    start, stop = corners[crossed], ends[crossed]
    share = start[:, 2:] / (start - stop)[:, 2:]
    return np.asarray((start + share * (stop - start))[:, :2].reshape(-1, 2, 2))


def _draw_lines(segments: Array, name: str) -> Markup:
    """Pieces (n, 2, 2) from end to end, 0…1 from the left and from below."""
    ends = np.round(1000 * np.stack([segments[..., 0], 1 - segments[..., 1]], axis=-1), 1)
    pieces = (f"M{a:g} {b:g}L{c:g} {d:g}" for (a, b), (c, d) in ends.tolist())
    return path("".join(pieces), name)


def _locate(axes: tuple[Axis, Axis], at: Array) -> Array:
    """Where places (…, 2) lie on a map, 0…1 from the left and from below."""
    return np.stack([axis.share(at[..., k]) for k, axis in enumerate(axes)], axis=-1)


def _write_beside(text: str, at: Array, name: str) -> Markup:
    """Text beside a place (2,), 0…1 from the left and from below."""
    x, y = f"{100 * at[0]:.1f}%", f"{100 * (1 - at[1]):.1f}%"
    return element("text", text, x=x, y=y, dx="0.4em", dy="-0.3em", class_=name)
