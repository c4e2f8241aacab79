"""`DiFluxFit`: what a sheet of a fluxgate theodolite tells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from agonic.alignment.maths.di_flux import NAMES, SheetEstimate
from agonic.alignment.maths.north import Pointing
from agonic.alignment.session.di_flux import DiSheet
from agonic.health import Finding, Judged
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.frames import ARCSEC_RAD


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
        return abs(self.estimate.noise / self.scale) / ARCSEC_RAD
