"""The picture of `growth`: a panel for each estimator, time and memory over size, logarithmic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

WIDE, HIGH, GAP_X, GAP_Y, ACROSS = 190, 130, 34, 52, 4
TIME, MEMORY, GRID = "#c2571a", "#2b7bba", "#ddd"
LEAST_S, MOST_S = 1e-4, 1e2


class Curve(NamedTuple):
    """An estimator: name, what is counted, fitted exponent, and (size, seconds, MB) measured."""

    name: str
    of: str
    exponent: float
    points: Sequence[tuple[int, float, float]]


def draw(curves: Sequence[Curve]) -> str:
    """All panels as one SVG."""
    rows = -(-len(curves) // ACROSS)
    wide, high = ACROSS * (WIDE + GAP_X) + 16, rows * (HIGH + GAP_Y) + 40
    panels = [
        f'<g transform="translate({30 + k % ACROSS * (WIDE + GAP_X)} '
        f'{44 + k // ACROSS * (HIGH + GAP_Y)})">{panel(curve)}</g>'
        for k, curve in enumerate(curves)
    ]
    body = "\n".join(panels)
    key = (
        f'<circle cx="34" cy="14" r="3.5" fill="{TIME}"/><text x="42" y="18">processor time, '
        f'10⁻⁴ to 10² s</text><circle cx="254" cy="14" r="3.5" fill="{MEMORY}"/>'
        '<text x="262" y="18">memory beside the readings, 10⁻¹ to 10⁵ MB; grey: a decade; '
        "dashed: linear</text>"
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" '
        'font-family="sans-serif" font-size="12" fill="#222">\n'
        f'<rect width="100%" height="100%" fill="#fff"/>\n{key}\n{body}\n</svg>\n'
    )


def panel(curve: Curve) -> str:
    """One estimator: axes, a linear line through the last time, both series."""
    sizes = [n for n, _, _ in curve.points]
    low, high = _ends(sizes)

    def at(n: float, share: float) -> tuple[float, float]:
        x = WIDE * (math.log10(n) - low) / (high - low)
        return round(x, 1), round(HIGH * (1.0 - share), 1)

    parts = [f'<rect width="{WIDE}" height="{HIGH}" fill="none" stroke="{GRID}"/>']
    for k in range(1, 6):
        y = round(HIGH * k / 6, 1)
        parts.append(f'<path stroke="{GRID}" d="M0 {y}H{WIDE}"/>')
    for power in range(math.ceil(low), math.floor(high) + 1):
        x, _ = at(10.0**power, 0.0)
        parts.append(f'<path stroke="{GRID}" d="M{x} 0V{HIGH}"/>')
        place = f'x="{x}" y="{HIGH + 14}" text-anchor="middle" font-size="10"'
        parts.append(f"<text {place}>{_label(power)}</text>")
    last, seconds, _ = curve.points[-1]
    line = [at(n, _share(seconds * n / last, LEAST_S)) for n in sizes]
    shown = [(x, y) for x, y in line if 0 <= y <= HIGH]
    parts.append(_polyline(shown, "#999", ' stroke-dasharray="4 4"'))
    for column, least, ink in ((2, 1e-1, MEMORY), (1, LEAST_S, TIME)):
        of = [at(p[0], _share(p[column], least)) for p in curve.points if p[column] > 0]
        parts.append(_polyline(of, ink))
        parts += [f'<circle cx="{x}" cy="{y}" r="3" fill="{ink}"/>' for x, y in of]
    parts.append(f'<text y="-6" font-weight="600">{curve.name}</text>')
    parts.append(
        f'<text x="{WIDE - 5}" y="{HIGH - 6}" text-anchor="end">n^{curve.exponent:.2f}</text>'
    )
    return "".join(parts)


def _share(value: float, least: float) -> float:
    """Where a value lies on a logarithmic axis of six decades."""
    return min(max(math.log10(max(value, least) / least) / 6.0, 0.0), 1.0)


def _ends(sizes: Sequence[int]) -> tuple[float, float]:
    low, high = math.log10(min(sizes)), math.log10(max(sizes))
    pad = 0.06 * max(high - low, 0.5)
    return low - pad, high + pad


def _label(power: int) -> str:
    return f'10<tspan dy="-4" font-size="8">{power}</tspan>'


def _polyline(points: Sequence[tuple[float, float]], ink: str, more: str = "") -> str:
    joined = " ".join(f"{x},{y}" for x, y in points)
    return f'<polyline fill="none" stroke="{ink}" stroke-width="1.5"{more} points="{joined}"/>'
