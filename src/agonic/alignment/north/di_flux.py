"""`fit_di_flux`: declination, inclination and the errors of a fluxgate theodolite from a sheet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.alignment.maths.di_flux import LEAST_RAD
from agonic.alignment.maths.north import Pointing, average_faces
from agonic.alignment.north import di_flux_evidence
from agonic.alignment.north.di_flux_result import DiFluxFit
from agonic.alignment.north.theodolite import estimate_sheet
from agonic.alignment.session.di_flux import DiSheet
from agonic.health import figure
from agonic.maths.rotations.angles import wrap_deg

METHOD = ("brunke-matzka-2018",)
SCALE_READING = 30.0
"""A reading so large tells how many units of the fluxgate an angle is."""
COPIED_DEG = 1e-7
"""Readings of the mark that agree better were read once; their spread tells nothing."""


def fit_di_flux(sheet: DiSheet, *, magnitude: float | None = None) -> DiFluxFit:
    """Declination and inclination of a DI-flux sheet, with the errors of the instrument.

    The fluxgate on the telescope, off by small angles δ and ε and with an offset S₀, reads

        S = F [cos I (sin v cos A − δ sin A + ε cos v cos A) + sin I (ε sin v − cos v)] + S₀

    at azimuth A from the magnetic meridian and zenith reading v. Every setting of the circles is
    one equation, whatever the scheme; the usual eight leave three to tell the noise.

    Parameters
    ----------
    sheet : readings (`read_di_flux`). magnitude : F, nT, where the sheet does not say.

    Returns a `DiFluxFit`. Raises `CoverageError` where the settings leave something open.

    Source: H.-P. Brunke, J. Matzka, Geoscientific Instrumentation, Methods and Data Systems 7,
    2018.

    >>> from agonic.alignment.simulation.di_flux import simulate_di_flux
    >>> made = simulate_di_flux(seed=1)
    >>> fit = fit_di_flux(made.sheet)
    >>> bool(abs(fit.inclination_deg - made.inclination_deg) < 5 / 3600)
    True
    """
    measured = bool(np.abs(sheet.reading).max() > SCALE_READING)
    found, at = estimate_sheet(sheet, magnitude, measured)
    scaled = measured or magnitude is not None or sheet.magnitude is not None
    fit = DiFluxFit(sheet=sheet, estimate=found, mark=_mark(sheet), scaled=scaled)
    return replace(fit, findings=di_flux_evidence.examine(fit, at), remarks=_remarks(fit))


def _mark(sheet: DiSheet) -> Pointing:
    """The mark's direction; readings taken one after the other in one face count once."""
    marks = sheet.mark_deg
    faces = np.abs(wrap_deg(marks - marks[0])) > 90.0
    runs = np.concatenate([[0], np.cumsum(np.diff(faces.astype(int)) != 0)])
    each = [marks[runs == run] for run in range(int(runs[-1]) + 1)]
    read = average_faces(np.array([a[0] + wrap_deg(a - a[0]).mean() for a in each]))
    if not read.sd_deg > COPIED_DEG:
        return read._replace(sd_deg=float("nan"))
    return read._replace(sd_deg=max(read.sd_deg, np.degrees(LEAST_RAD) / np.sqrt(len(each))))


def _remarks(fit: DiFluxFit) -> tuple[str, ...]:
    declination = fit.declination_deg
    first = (
        ()
        if declination is None
        else (f"declination {declination:.4f}° ± {figure(fit.declination_sd_arcsec)}″",)
    )
    return (
        *first,
        f"inclination {fit.inclination_deg:.4f}° ± {figure(fit.inclination_sd_arcsec)}″, "
        f"{fit.n} settings, {fit.estimate.freedom} degrees of freedom",
    )
