"""What is said and shown of an absolute measurement with a fluxgate theodolite."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from agonic.alignment.figures import draw_settings
from agonic.alignment.north.di_flux_result import DiFluxFit
from agonic.alignment.north.document import format_angle
from agonic.report.digits import group_digits, significant, with_sd
from agonic.report.document import Document
from agonic.report.origin import list_inputs
from agonic.report.section import Section, Table

SETTING_HEAD = ("Setting", "Horizontal circle", "Zenith circle", "Fluxgate", "Residual")


def describe_di_flux(fit: DiFluxFit) -> Document:
    """Declination, inclination, errors of the instrument, and the residual of each setting.

    >>> from agonic.alignment.north import fit_di_flux
    >>> from agonic.alignment.simulation.di_flux import simulate_di_flux
    >>> made = describe_di_flux(fit_di_flux(simulate_di_flux().sheet))
    >>> print(made.to_text().splitlines()[0])
    ✓ simulated: good (absolute measurement with a fluxgate theodolite, 9 settings)
    >>> made.to_html().count("<tr>")
    10
    """
    sheet = fit.sheet
    about = ", ".join(text for text in (sheet.pillar, sheet.theodolite, sheet.sensor) if text)
    left = -np.asarray(fit.estimate.residuals)
    unit = "units of the fluxgate" if fit.scaled else "its own units"
    drawn = partial(draw_settings, left, unit)
    rows = Table(SETTING_HEAD, _setting_rows(fit), "numbers small")
    return Document(
        schema="agonic/fit-di-flux@1",
        kind=f"Absolute measurement {about}".rstrip(),
        name=sheet.name,
        method=f"absolute measurement with a fluxgate theodolite, {fit.n} settings",
        verdict=fit.verdict,
        status=fit.status,
        findings=fit.findings,
        entries=_entries(fit),
        sections=[]
        if fit.verdict == "refused"
        else [Section("Settings", [rows, drawn]), list_inputs(*sheet.sources)],
        values=_values(fit),
        styles=["alignment.css"],
    )


def _entries(fit: DiFluxFit) -> dict[str, str]:
    """What the sheet gives, by name."""
    (delta, epsilon), (delta_sd, epsilon_sd) = fit.collimation_arcsec, fit.collimation_sd_arcsec
    entries = {}
    if fit.declination_deg is not None:
        entries["Declination"] = format_angle(fit.declination_deg, fit.declination_sd_arcsec)
    mark = format_angle(fit.mark.reading_deg, 3600 * fit.mark.sd_deg)
    meridian = format_angle(fit.meridian_deg, fit.meridian_sd_arcsec)
    entries |= {
        "Inclination": format_angle(fit.inclination_deg, fit.inclination_sd_arcsec),
        "Meridian": f"{meridian} on the circle",
        "Mark": f"{mark} on the circle, telescope's collimation "
        f"{group_digits(3600 * fit.mark.collimation_deg, 1)}″",
        "δ": f"{with_sd(delta, delta_sd)}″, fluxgate to the right of the telescope",
        "ε": f"{with_sd(epsilon, epsilon_sd)}″, to greater zenith angles",
        "S₀/F": f"{with_sd(*fit.offset_arcsec)}″, the fluxgate's offset as an angle",
    }
    if fit.scaled:
        entries["S₀"] = f"{with_sd(fit.offset, fit.offset_sd)} units of the fluxgate"
    if fit.scaled and fit.sheet.magnitude is not None:
        entries["Scale"] = f"{significant(fit.scale / fit.sheet.magnitude, 4)} units per nT"
    return entries


def _setting_rows(fit: DiFluxFit) -> list[list[str]]:
    """Each setting of the circles: means of its readings, and what is left."""
    sheet = fit.sheet
    own_rows = [sheet.setting == number for number in np.unique(sheet.setting)]
    return [
        [
            str(k),
            f"{group_digits(float(sheet.horizontal_deg[own].mean()), 4)}°",
            f"{group_digits(float(sheet.zenith_deg[own].mean()), 4)}°",
            group_digits(float(sheet.reading[own].mean()), 2),
            group_digits(float(-left), 2),
        ]
        for k, (own, left) in enumerate(zip(own_rows, fit.estimate.residuals, strict=True), 1)
    ]


def _values(fit: DiFluxFit) -> dict[str, Any]:
    (delta, epsilon), (delta_sd, epsilon_sd) = fit.collimation_arcsec, fit.collimation_sd_arcsec
    return {
        "n": fit.n,
        "freedom": fit.estimate.freedom,
        "declination_deg": fit.declination_deg,
        "declination_sd_arcsec": fit.declination_sd_arcsec,
        "inclination_deg": fit.inclination_deg,
        "inclination_sd_arcsec": fit.inclination_sd_arcsec,
        "meridian_deg": fit.meridian_deg,
        "meridian_sd_arcsec": fit.meridian_sd_arcsec,
        "mark_deg": fit.mark.reading_deg,
        "mark_sd_arcsec": 3600 * fit.mark.sd_deg,
        "telescope_collimation_arcsec": 3600 * fit.mark.collimation_deg,
        "delta_arcsec": delta,
        "delta_sd_arcsec": delta_sd,
        "epsilon_arcsec": epsilon,
        "epsilon_sd_arcsec": epsilon_sd,
        "offset_arcsec": fit.offset_arcsec[0],
        "offset_sd_arcsec": fit.offset_arcsec[1],
        "offset": fit.offset if fit.scaled else None,
        "offset_sd": fit.offset_sd if fit.scaled else None,
        "scale": fit.scale if fit.scaled else None,
        "magnitude_nT": fit.sheet.magnitude,
        "noise_arcsec": fit.noise_arcsec,
    }
