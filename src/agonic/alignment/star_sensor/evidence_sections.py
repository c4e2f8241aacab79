"""The sections of an alignment's page that show what it rests on: residuals, skies, budget."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from agonic.alignment.figures import draw_residuals, svg, svg_text
from agonic.alignment.star_sensor.budget import error_budget
from agonic.alignment.star_sensor.figures import draw_dome, draw_sky
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.arrays import Array
from agonic.maths.rotations.frames import r2, r3
from agonic.report.digits import group_digits, significant, write_minus
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table
from agonic.report.tables import NOTHING

WIDE, HIGH, LONG = 420.0, 340.0, 130.0
VIEWS = 72
"""Sides that the drawing is tried from, so that no axis points at the eye or hides another."""
_ELEVATIONS_RAD = np.radians([20.0, 30.0, 40.0])


def draw_axes(alpha_deg: float, beta_deg: float, gamma_deg: float) -> Markup:
    """Both sets of axes, and the arcs of R3(γ) R2(β) R3(α): about z, the new y, the newest z.

    >>> drawn = draw_axes(37.0, 64.0, -112.0)
    >>> drawn.count('class="turn"'), "α = 37.000°" in drawn, "z₃" in drawn
    (3, True, True)
    """
    once = r3(np.radians(alpha_deg))
    twice = r2(np.radians(beta_deg)) @ once
    last = r3(np.radians(gamma_deg)) @ twice
    star = np.eye(3)
    flat = _choose_view(np.concatenate([star, last]))
    parts = [
        *_draw_axis_between(flat, once[0], 0.9, "x₁"),
        *_draw_axis_between(flat, twice[0], 0.5, "x₂"),
        *_arc(flat, star[0], star[2], alpha_deg, "α", 0.9),
        *_arc(flat, once[2], once[1], beta_deg, "β", 0.7),
        *_arc(flat, twice[0], twice[2], gamma_deg, "γ", 0.5),
        *(p for axis, name in zip(star, "xyz", strict=True) for p in _axis(flat, axis, name, "")),
        *(p for axis, name in zip(last, "xyz", strict=True) for p in _axis(flat, axis, name, "₃")),
    ]
    parts.sort(key=lambda part: str(part).startswith("<text"))  # texts over all lines
    words = "Axes of the star sensor and of the magnetometer, and the three turns between them"
    return svg(parts, "axes", WIDE, HIGH, words)


def _choose_view(axes: Array) -> Array:
    """The projection (3, 2) in which the ends of axes (k, 3) and the middle lie farthest apart."""
    best, widest = np.zeros((3, 2)), -1.0
    for turn in np.linspace(0, 2 * np.pi, VIEWS, endpoint=False):
        for rise in _ELEVATIONS_RAD:
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
    return np.asarray([WIDE / 2, HIGH / 2] + LONG * (vectors @ flat))


def _line(flat: Array, end: Array, name: str, long: float = 1.0) -> Markup:
    (x0, y0), (x1, y1) = _place(flat, np.stack([np.zeros(3), long * end]))
    return element("path", d=f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}", class_=name)


def _axis(flat: Array, end: Array, name: str, sign: str) -> list[Markup]:
    """An axis with its name: of the star sensor, or with a sign of the magnetometer."""
    x, y = _place(flat, 1.1 * end)
    kind = "new" if sign else "old"
    return [_line(flat, end, f"{kind} line"), svg_text(x, y + 4, f"{name}{sign}", kind)]


def _draw_axis_between(flat: Array, end: Array, long: float, name: str) -> list[Markup]:
    """An axis half-way through the turns, with its name."""
    x, y = _place(flat, (long + 0.12) * end)
    return [_line(flat, end, "between", long), svg_text(x, y + 4, name, "half-way")]


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


BUDGET_HEAD = ("Effect", "Size, ″", "Size, nT", "Done", "Remark")
BUDGET_NOTE = (
    "What was corrected: the size is what leaving it out would cost. What was not: the size is by "
    "how much a direction may be wrong."
)
RESIDUAL_HEAD = (
    "Orientation",
    "Time, UTC",
    "Azimuth",
    "Elevation",
    "Readings",
    "x, nT",
    "y, nT",
    "z, nT",
    "Expected sd, nT",
    "Direction, ″",
)


def list_evidence(fit: AlignmentFit) -> list[Section]:
    """Residuals, the sky, and the error budget."""
    residuals = Table(RESIDUAL_HEAD, _residual_rows(fit), "numbers small", scrolls=True)
    budget = Table(BUDGET_HEAD, _budget_rows(fit), "budget", scrolls=True)
    return [
        Section("Residuals of each orientation", [lambda: _draw(fit), residuals]),
        Section("Where the star sensor looked", [lambda: _skies(fit)], style="pair"),
        Section("Error budget", [BUDGET_NOTE, budget]),
    ]


def _draw(fit: AlignmentFit) -> Markup:
    return draw_residuals(fit.residuals, fit.residuals_sd, fit.observed.orientation)


def _residual_rows(fit: AlignmentFit) -> list[list[str]]:
    """Each orientation: where it looked, what is left in nT and in arcseconds."""
    boresight = fit.observed.boresight_n
    azimuth = np.degrees(np.arctan2(boresight[:, 1], boresight[:, 0])) % 360
    rows = []
    for k, number in enumerate(fit.observed.orientation.tolist()):
        when = datetime.fromtimestamp(float(fit.observed.time[k]), UTC)
        sd = float(np.sqrt((fit.residuals_sd[k] ** 2).mean()))
        rows.append(
            [
                str(number),
                when.strftime("%H:%M:%S"),
                f"{group_digits(float(azimuth[k]))}°",
                f"{group_digits(float(fit.observed.elevation_deg[k]))}°",
                f"{int(fit.observed.readings[k, 1])}",
                *(group_digits(float(value), 3) for value in fit.residuals[k]),
                group_digits(sd, 3),
                group_digits(float(fit.residuals_arcsec[k]), 2),
            ]
        )
    return rows


def _skies(fit: AlignmentFit) -> list[Markup]:
    seen = fit.observed
    over_site = draw_dome(seen.boresight_n, seen.orientation, fit.residuals_arcsec)
    among_stars = draw_sky(seen.boresight_i, seen.orientation, fit.residuals_arcsec)
    up = "Over the site: north up, east right, the horizon at the rim"
    pole = (
        "Among the stars: right ascension round the celestial pole, J2000. The larger the dot, the "
        "larger the residual"
    )
    return [
        element("figure", drawn, element("figcaption", caption))
        for drawn, caption in ((over_site, up), (among_stars, pole))
    ]


def _budget_rows(fit: AlignmentFit) -> list[list[str]]:
    """The error budget, a row an effect; a size of 0 means that nothing is known of it."""
    rows = []
    for effect in error_budget(fit):
        sizes = (effect.size_arcsec, effect.size_nT(fit.solution.magnitude))
        shown = [significant(size, 3) if size else NOTHING for size in sizes]
        rows.append([effect.name, *shown, effect.treatment, write_minus(effect.remark)])
    return rows


def caption_axes(fit: AlignmentFit) -> Markup:
    """Both sets of axes with the turns between them, as a figure."""
    caption = (
        "Axes of the star sensor (x, y, z; z the boresight) and of the magnetometer (x₃, y₃, z₃): "
        "turned by α about z (x to x₁), by β about the new y (z to z₃), by γ about the newest z "
        "(x₂ to x₃); seen from a side, the angles between the axes are true"
    )
    drawn = draw_axes(*map(float, fit.angles_deg))
    return element("figure", drawn, element("figcaption", caption))
