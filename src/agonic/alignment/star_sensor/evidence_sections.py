"""The sections of an alignment's page that show what it rests on: residuals, skies, budget."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from agonic.alignment.figures import draw_residuals
from agonic.alignment.star_sensor.axes_figure import draw_axes
from agonic.alignment.star_sensor.budget import error_budget
from agonic.alignment.star_sensor.figures import draw_dome, draw_sky
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.report.digits import group_digits, significant, write_minus
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table
from agonic.report.tables import NOTHING

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
