"""Where the star sensor looked: over the site's dome and among the stars, as SVG."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.report.markup import Markup, element

SIZE, RADIUS = 320.0, 130.0
LEAST, MOST = 3.0, 11.0
"""Radius of the dot of the smallest and the largest residual."""


def dome(boresight_n: Array, numbers: NDArray[np.int64], residual_arcsec: Array) -> Markup:
    """The sky over the site as seen lying on one's back is mirrored; this is the map from above.

    North is up and east to the right, the zenith in the middle, the horizon at the rim, rings every
    30° of elevation.

    >>> drawn = dome(np.array([[0.0, 0.0, -1.0]]), np.array([7]), np.array([1.0]))
    >>> drawn.count("<circle"), 'cx="160.0"' in drawn
    (4, True)
    """
    north, east, down = boresight_n.T
    zenith = np.degrees(np.arccos(np.clip(-down, -1, 1)))
    away = np.minimum(zenith, 100.0) / 90.0 * RADIUS
    level = np.maximum(np.hypot(north, east), 1e-12)
    x, y = SIZE / 2 + away * east / level, SIZE / 2 - away * north / level
    rings = [_ring(RADIUS * share) for share in (1.0, 2 / 3, 1 / 3)]
    texts = _rim(("N", "E", "S", "W"))
    texts += [
        _text(SIZE / 2 + 4, SIZE / 2 - RADIUS * s - 3, f"{90 - 90 * s:.0f}°", "ring-name")
        for s in (1 / 3, 2 / 3)
    ]
    return _chart(
        [*rings, *texts, *_dots(x, y, numbers, residual_arcsec)],
        "Where the star sensor looked over the site",
    )


def sky(boresight_i: Array, numbers: NDArray[np.int64], residual_arcsec: Array) -> Markup:
    """The same among the stars: the nearer celestial pole in the middle, right ascension round it.

    The rim is the other pole; rings at declinations of 60°, 0° and −60° (of the other sign in the
    south).
    """
    south = boresight_i[:, 2].mean() < 0
    up = -boresight_i[:, 2] if south else boresight_i[:, 2]
    away = np.degrees(np.arccos(np.clip(up, -1, 1))) / 180.0 * RADIUS
    ra = np.arctan2(boresight_i[:, 1], boresight_i[:, 0])
    side = 1.0 if south else -1.0  # seen from inside the sphere
    x, y = SIZE / 2 + side * away * np.sin(ra), SIZE / 2 - away * np.cos(ra)
    rings = [_ring(RADIUS * share) for share in (1.0, 5 / 6, 1 / 2, 1 / 6)]
    sign = -1 if south else 1
    texts = _rim(("0 h", "6 h", "12 h", "18 h") if south else ("0 h", "18 h", "12 h", "6 h"))
    texts += [
        _text(SIZE / 2 + 4, SIZE / 2 - RADIUS * s - 3, f"{sign * (90 - 180 * s):.0f}°", "ring-name")
        for s in (1 / 6, 1 / 2, 5 / 6)
    ]
    return _chart(
        [*rings, *texts, *_dots(x, y, numbers, residual_arcsec)],
        "Where the star sensor looked among the stars",
    )


def _chart(parts: list[Markup], label: str) -> Markup:
    return element(
        "svg",
        *parts,
        class_="dome",
        viewBox=f"0 0 {SIZE:g} {SIZE:g}",
        role="img",
        aria_label=label,
    )


def _ring(radius: float) -> Markup:
    return element(
        "circle", cx=f"{SIZE / 2:.1f}", cy=f"{SIZE / 2:.1f}", r=f"{radius:.1f}", class_="ring"
    )


def _rim(names: tuple[str, str, str, str]) -> list[Markup]:
    """Names at the top, right, bottom and left of the rim."""
    middle, far = SIZE / 2, RADIUS + 14
    places = (
        (middle, middle - far),
        (middle + far, middle),
        (middle, middle + far),
        (middle - far, middle),
    )
    return [_text(x, y + 4, name, "rim-name") for name, (x, y) in zip(names, places, strict=True)]


def _text(x: float, y: float, text: str, name: str) -> Markup:
    return element("text", text.replace("-", "−"), x=f"{x:.1f}", y=f"{y:.1f}", class_=name)


def _dots(x: Array, y: Array, numbers: NDArray[np.int64], residual: Array) -> list[Markup]:
    """A dot for each orientation, as large as its residual, with its number."""
    largest = max(float(residual.max()), 1e-12)
    radius = LEAST + (MOST - LEAST) * residual / largest
    dots = []
    for k in np.argsort(-radius):
        said = element("title", f"orientation {numbers[k]}: {residual[k]:.2f}″")
        dots.append(
            element(
                "circle",
                said,
                cx=f"{x[k]:.1f}",
                cy=f"{y[k]:.1f}",
                r=f"{radius[k]:.1f}",
                class_="dot",
            )
        )
    return dots + _names(x, y, numbers)


def _names(x: Array, y: Array, numbers: NDArray[np.int64]) -> list[Markup]:
    """The number of each orientation; where several look at the same place, how many."""
    there: dict[tuple[int, int], list[int]] = {}
    for k in range(len(x)):
        there.setdefault((round(x[k]), round(y[k])), []).append(int(numbers[k]))
    return [
        _text(place[0], place[1] + 3, str(own[0]) if len(own) == 1 else f"{len(own)}×", "dot-name")
        for place, own in there.items()
    ]


def bars(values: Array, sd: Array, numbers: NDArray[np.int64]) -> Markup:
    """Residuals (k, 3), nT, of each orientation beside each other, with lines at twice the sd."""
    limit = 1.05 * max(float(np.abs(values).max()), 2 * float(sd.max()), 1e-12)
    wide, high, left, foot = 760.0, 200.0, 52.0, 24.0
    step = (wide - left) / len(values)

    def place(value: float) -> float:
        return (high - foot) * (0.5 - value / (2 * limit)) + 4

    parts = [element("path", d=f"M{left} {place(0):.1f}H{wide}", class_="zero")]
    for level in (-limit / 1.05, limit / 1.05):
        parts.append(_text(left - 6, place(level) + 4, f"{level:.2g}", "tick"))
    for k in range(len(values)):
        at = left + step * k
        band = np.sqrt((sd[k] ** 2).mean()) * 2
        parts.append(
            element(
                "rect",
                x=f"{at + 0.08 * step:.1f}",
                y=f"{place(band):.1f}",
                width=f"{0.84 * step:.1f}",
                height=f"{place(-band) - place(band):.1f}",
                class_="band",
            )
        )
        for axis in range(3):
            top = place(max(values[k, axis], 0.0))
            parts.append(
                element(
                    "rect",
                    x=f"{at + (0.16 + 0.24 * axis) * step:.1f}",
                    y=f"{top:.1f}",
                    width=f"{0.2 * step:.1f}",
                    height=f"{max(abs(place(values[k, axis]) - place(0)), 0.5):.1f}",
                    class_=f"bar-{'xyz'[axis]}",
                )
            )
        parts.append(_text(at + step / 2, high - 4, str(numbers[k]), "tick middle"))
    return element(
        "svg",
        *parts,
        class_="bars",
        viewBox=f"0 0 {wide:g} {high:g}",
        role="img",
        aria_label="Residuals of each orientation in nT",
    )
