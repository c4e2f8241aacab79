"""Maps: lines of equal value over two axes of equal scale, as layers of a plot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agonic.arrays import Array
from agonic.report.axes import Axis
from agonic.report.digits import significant
from agonic.report.markup import Markup, element
from agonic.report.strips import path

ASPECT = 1.5
"""Width over height of a map, as `contours.css` has it for plots of the kind "contours"."""


def fit_axes(labels: tuple[str, str], at: Array, margin: float = 0.1) -> tuple[Axis, Axis]:
    """Axes across and up that show places (n, 2) at one scale.

    >>> x, y = fit_axes(("x, m", "y, m"), np.array([[0.0, 0.0], [3.0, 1.0]]), margin=0.0)
    >>> (x.low, x.high, y.low, y.high)
    (0.0, 3.0, -0.5, 1.5)
    """
    low, high = at.min(axis=0), at.max(axis=0)
    middle, span = (low + high) / 2, (1 + 2 * margin) * np.maximum(high - low, 1e-6)
    tall = max(span[1], span[0] / ASPECT)
    half = np.array([tall * ASPECT, tall]) / 2
    ends = [(float(a), float(b)) for a, b in zip(middle - half, middle + half, strict=True)]
    return Axis(labels[0], *ends[0]), Axis(labels[1], *ends[1])


def list_nodes(x: Axis, y: Axis, rows: int = 26) -> tuple[Array, tuple[int, int]]:
    """Places (n, 2) of a grid over two axes, row by row from below, and its (rows, columns)."""
    shape = (rows, round(rows * ASPECT))
    up, across = np.linspace(y.low, y.high, shape[0]), np.linspace(x.low, x.high, shape[1])
    return np.stack([np.tile(across, shape[0]), np.repeat(up, shape[1])], axis=1), shape


def contour(values: Array, level: float, name: str) -> tuple[Markup, Array]:
    """The line on which values (rows, columns) of a grid over the whole map reach a level, and one
    of its points (2,), 0…1 from the left and from below, for its label; NaN without any.

    Each cell is two triangles, in which values are linear.

    >>> drawn, at = contour(np.array([[0.0, 1.0], [0.0, 1.0]]), 0.5, "level")
    >>> drawn.count("M"), at[0].item()
    (2, 0.5)
    """
    rows, columns = values.shape
    up, across = np.mgrid[0:rows, 0:columns]
    nodes = np.stack([across / (columns - 1), up / (rows - 1), values], axis=-1)
    a, b, c, d = nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, 1:], nodes[1:, :-1]
    corners = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)
    ends = np.roll(corners, -1, axis=1)
    above, after = corners[..., 2] > level, ends[..., 2] > level
    known = np.isfinite(corners[..., 2]).all(axis=1)[:, None]
    crossed = (above != after) & known
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (level - corners[..., 2]) / (ends[..., 2] - corners[..., 2])
        points = corners[..., :2] + share[..., None] * (ends - corners)[..., :2]
    segments = points[crossed].reshape(-1, 2, 2)
    if not len(segments):
        return path("", name), np.full(2, np.nan)
    room = (segments[:, 0] < 0.93).all(axis=1)  # for the label, right of the point and above it
    label = segments[np.argmax(segments[:, 0].sum(axis=1) * room), 0]
    return draw_lines(segments, name), label


def draw_lines(segments: Array, name: str) -> Markup:
    """Pieces (n, 2, 2) from end to end, 0…1 from the left and from below."""
    ends = np.round(1000 * np.stack([segments[..., 0], 1 - segments[..., 1]], axis=-1), 1)
    pieces = (f"M{a:g} {b:g}L{c:g} {d:g}" for (a, b), (c, d) in ends.tolist())
    return path("".join(pieces), name)


def draw_contours(
    values: Array, levels: Sequence[float], unit: str
) -> tuple[list[Markup], list[Markup]]:
    """Lines of a grid of values at levels, the higher the thicker, and their labels."""
    layers, labels = [], []
    for k, level in enumerate(sorted(levels)):
        line, at = contour(values, level, f"contour level-{min(k, 4)}")
        layers.append(line)
        if np.isfinite(at).all():
            labels.append(label(f"{significant(level, 2)}{unit}", at, "level"))
    return layers, labels


def locate(x: Axis, y: Axis, at: Array) -> Array:
    """Where places (…, 2) lie on a map, 0…1 from the left and from below."""
    return np.stack([x.share(at[..., 0]), y.share(at[..., 1])], axis=-1)


def draw_dots(at: Array, name: str) -> Markup:
    """Dots at places (n, 2), 0…1 from the left and from below."""
    return draw_lines(np.stack([at, at], axis=1), name)


def label(text: str, at: Array, name: str) -> Markup:
    """Text beside a place (2,), 0…1 from the left and from below."""
    x, y = f"{100 * at[0]:.1f}%", f"{100 * (1 - at[1]):.1f}%"
    return element("text", text, x=x, y=y, dx="0.4em", dy="-0.3em", class_=name)
