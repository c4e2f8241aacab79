"""`NorthFit`: where true north is on the circle, and what was pointed by it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.alignment.maths.north import North, Swing
from agonic.alignment.north.drift import NOT_TOLD, Drift
from agonic.alignment.north.platform import Aligned
from agonic.alignment.session.north import NorthSession
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.health import Finding, Judged


@dataclass(frozen=True, kw_only=True)
class Azimuth:
    """The azimuth of a sighting, degrees clockwise from true north; standard error in arcseconds.

    `collimation_arcsec` is the theodolite's, NaN where one face only was read; `excess` is how many
    times the stated noise the readings scatter, 1 where chance explains it.
    """

    name: str
    azimuth_deg: float
    sd_arcsec: float
    collimation_arcsec: float
    excess: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class NorthFit(Judged):
    """The result of `fit_north`.

    Parameters
    ----------
    by : what each method gives, the gyro's north on the circle: "swing", "reversal", "transit".
    method : the one with the smallest standard error, which the rest goes by.
    swing : the damped sinusoid. drift : of the gyro's zero, as the readings tell it.
    constant, constant_sd : c of the transits, degrees per (unit · s).
    azimuths : of what was sighted.
    aligned : the magnetometer's alignment with the platform; `calibration` the same to save.
    """

    session: NorthSession
    by: dict[str, North]
    method: str
    swing: Swing | None = None
    drift: Drift = NOT_TOLD
    constant: float | None = None
    constant_sd: float | None = None
    azimuths: tuple[Azimuth, ...] = ()
    aligned: Aligned | None = None
    calibration: Alignment | Chain | None = None
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def north_deg(self) -> float:
        """The circle's reading at true north: the gyro's, with the instrument's constant."""
        gyro = self.by[self.method].reading_deg
        return (gyro + self.session.constant_arcsec / 3600.0) % 360.0

    @property
    def sd_arcsec(self) -> float:
        """Its standard error, the constant's included."""
        own = 3600.0 * self.by[self.method].sd_deg
        return float(np.hypot(own, self.session.constant_sd_arcsec))

    @property
    def period_s(self) -> float | None:
        """The period of the swing."""
        return None if self.swing is None else float(2 * np.pi / self.swing.params[4])
