"""`fit_di_flux`: declination, inclination and the errors of a fluxgate theodolite from a sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from agonic.alignment.maths.di_flux import NAMES, Settings, SheetEstimate
from agonic.alignment.maths.north import Pointing, average_faces
from agonic.alignment.north.theodolite import LEVEL_SIN, estimate_sheet
from agonic.alignment.session.di_flux import DiSheet
from agonic.health import Finding, Judged, figure
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.frames import ARCSEC_RAD

METHOD = ("brunke-matzka-2018",)
OFF_MERIDIAN_DEG = 0.1
SCALE_READING = 30.0
"""A reading so large tells how many units of the fluxgate an angle is."""
WIDE_ARCSEC = 10.0
BIG_ERROR_DEG = 1.0
COPIED_DEG = 1e-7
"""Readings of the mark that agree better were read once; their spread tells nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DiFluxFit(Judged):
    """The result of `fit_di_flux`: angles in degrees, standard errors in arcseconds.

    `estimate` holds the unknowns: meridian, inclination, collimation δ and ε, offset, scale;
    `mark` the direction to the azimuth mark on the circle and the telescope's own collimation.
    `scaled`: whether sheet or caller say how many units of the fluxgate an angle is.
    """

    sheet: DiSheet
    estimate: SheetEstimate
    mark: Pointing
    scaled: bool = True
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """How many settings of the circles."""
        return len(self.estimate.residuals)

    @cached_property
    def _sd_arcsec(self) -> dict[str, float]:
        sd = np.sqrt(np.diag(self.estimate.covariance)) / ARCSEC_RAD
        return dict(zip(NAMES, sd.tolist(), strict=True))

    def _deg(self, name: str) -> float:
        return float(np.degrees(self.estimate.params[NAMES.index(name)]))

    @property
    def meridian_deg(self) -> float:
        """The circle's reading in the magnetic meridian, looking north."""
        return self._deg("meridian") % 360.0

    @property
    def meridian_sd_arcsec(self) -> float:
        """Its standard error."""
        return self._sd_arcsec["meridian"]

    @property
    def declination_deg(self) -> float | None:
        """East positive, within ±90°: the sheet does not say which face the mark was read in
        first. `None` where the azimuth of the mark is not known."""
        if self.sheet.mark_azimuth_deg is None:
            return None
        turned = self.sheet.mark_azimuth_deg - self.mark.reading_deg
        return float(wrap_deg(2 * (self.meridian_deg + turned)) / 2)

    @property
    def declination_sd_arcsec(self) -> float:
        """Its standard error: the meridian's and, where its readings tell one, the mark's."""
        mark = 3600.0 * self.mark.sd_deg if np.isfinite(self.mark.sd_deg) else 0.0
        return float(np.hypot(self.meridian_sd_arcsec, mark))

    @property
    def inclination_deg(self) -> float:
        """Down positive."""
        return self._deg("inclination")

    @property
    def inclination_sd_arcsec(self) -> float:
        """Its standard error."""
        return self._sd_arcsec["inclination"]

    @property
    def collimation_arcsec(self) -> tuple[float, float]:
        """δ, to the right of the telescope, and ε, to greater zenith angles, of the fluxgate."""
        return 3600.0 * self._deg("delta"), 3600.0 * self._deg("epsilon")

    @property
    def collimation_sd_arcsec(self) -> tuple[float, float]:
        """Their standard errors."""
        return self._sd_arcsec["delta"], self._sd_arcsec["epsilon"]

    @property
    def offset_arcsec(self) -> tuple[float, float]:
        """S₀/F as an angle, and its standard error."""
        return float(self.estimate.params[4]) / ARCSEC_RAD, self._sd_arcsec["offset"]

    @property
    def scale(self) -> float:
        """F in the unit of the fluxgate's readings."""
        return float(self.estimate.params[-1])

    @property
    def offset(self) -> float:
        """S₀, in the unit of the fluxgate's readings."""
        return float(self.estimate.params[4]) * self.scale

    @property
    def offset_sd(self) -> float:
        """Its standard error."""
        return self._sd_arcsec["offset"] * ARCSEC_RAD * self.scale

    @property
    def noise_arcsec(self) -> float:
        """What is left of a setting, as an angle of the field."""
        return self.estimate.noise / self.scale / ARCSEC_RAD


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
    return replace(fit, findings=_findings(fit, at), remarks=_remarks(fit))


def _mark(sheet: DiSheet) -> Pointing:
    """The mark's direction; readings taken one after the other in one face count once."""
    marks = sheet.mark_deg
    faces = np.abs(wrap_deg(marks - marks[0])) > 90.0
    runs = np.concatenate([[0], np.cumsum(np.diff(faces.astype(int)) != 0)])
    each = [marks[runs == run] for run in range(int(runs[-1]) + 1)]
    read = average_faces(np.array([a[0] + wrap_deg(a - a[0]).mean() for a in each]))
    return read if read.sd_deg > COPIED_DEG else read._replace(sd_deg=float("nan"))


def _findings(fit: DiFluxFit, at: Settings) -> tuple[Finding, ...]:
    """What the sheet's reader should know."""
    said = []
    if fit.sheet.mark_azimuth_deg is None:
        said.append(
            Finding(
                "no mark",
                "note",
                "the sheet has no azimuth of the mark, so the declination is left open",
                "give Abs-AzimuthMark",
            )
        )
    elif not np.isfinite(fit.mark.sd_deg):
        said.append(
            Finding(
                "mark read once",
                "note",
                "the readings of the mark do not differ, so its own "
                "error is not in that of the declination",
                "read it in both faces before and after",
            )
        )
    sides = at.horizontal[~at.from_meridian & (np.abs(np.sin(at.zenith)) <= LEVEL_SIN)]
    if len(sides):
        off = np.abs(wrap_deg(2 * (np.degrees(sides) - fit.meridian_deg)) / 2).max()
        if off > OFF_MERIDIAN_DEG:
            said.append(
                Finding(
                    "off the meridian",
                    "note",
                    "the inclination was taken "
                    f"{figure(float(off))}° off the magnetic meridian; this is corrected",
                    "check the circle's readings there",
                )
            )
    if not fit.scaled and np.abs(fit.sheet.reading).max() > 0:
        said.append(
            Finding(
                "no scale",
                "check",
                "neither the total field nor a reading of known tilt "
                "tells what a unit of the fluxgate is",
                "give --field",
            )
        )
    if fit.noise_arcsec > WIDE_ARCSEC:
        said.append(
            Finding(
                "settings disagree",
                "check",
                f"the settings disagree by {figure(fit.noise_arcsec)}″ of the field's direction",
                "look for a misread circle, iron on the observer or a disturbed field",
            )
        )
    worst = max(np.abs(fit.collimation_arcsec)) / 3600.0
    if worst > BIG_ERROR_DEG:
        said.append(
            Finding(
                "collimation",
                "check",
                f"the fluxgate is {figure(worst)}° from the telescope",
                "adjust it; errors of second order are no longer small",
            )
        )
    return tuple(said)


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
