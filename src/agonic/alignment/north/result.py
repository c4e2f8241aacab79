"""`NorthFit`: where true north is on the circle, and what was pointed by it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agonic.alignment.maths.north import North, Swing
from agonic.alignment.north.platform import Aligned
from agonic.alignment.session.north import NorthSession
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.health import Finding, Judged
from agonic.maths.estimation.inference.model_averaging import average_over_term

DRIFTS = 3.0
"""Standard errors by which a drift of the zero stands out."""
LIKELY = 0.5
"""Probability of a drift before the readings are seen: gyros warm up."""


class Drift(NamedTuple):
    """How far the zero moves over the readings, its standard error, and what is to be allowed for,
    degrees; infinite where nothing tells it."""

    size_deg: float = 0.0
    sd_deg: float = float("inf")
    allowed_deg: float = 0.0

    @property
    def seen(self) -> bool:
        """Whether the zero moves by more than chance."""
        return abs(self.size_deg) > DRIFTS * self.sd_deg


NOT_TOLD = Drift()


def estimate_drift(size_deg: float, sd_deg: float) -> Drift:
    """A drift that was found with a standard error, averaged over its being there and not.

    >>> estimate_drift(5.0, 1.0).seen, round(estimate_drift(5.0, 1.0).allowed_deg, 1)
    (True, 4.9)
    >>> estimate_drift(0.5, 1.0).allowed_deg
    0.0
    """
    if not np.isfinite(sd_deg) or not sd_deg > 0:
        return Drift(size_deg, sd_deg)
    found = average_over_term(np.array([size_deg]), np.array([[sd_deg**2]]), slice(0, 1), LIKELY)
    allowed = np.hypot(found.params[0], np.sqrt(max(found.covariance[0, 0], 0.0)))
    return Drift(size_deg, sd_deg, float(allowed))


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
