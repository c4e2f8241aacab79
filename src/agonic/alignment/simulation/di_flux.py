"""`simulate_di_flux`: the sheet of an absolute measurement, and what is true of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import newton

from agonic.alignment.maths import di_flux as kernel
from agonic.alignment.session.laboratory import DiSheet
from agonic.arrays import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedDiFlux:
    """A sheet and its truth: angles in degrees, collimations in arcseconds, offset in nT."""

    sheet: DiSheet
    declination_deg: float
    inclination_deg: float
    delta_arcsec: float
    epsilon_arcsec: float
    offset: float


def simulate_di_flux(
    *,
    declination_deg: float = 4.2,
    inclination_deg: float = 64.3,
    magnitude: float = 48_800.0,
    delta_arcsec: float = 140.0,
    epsilon_arcsec: float = -230.0,
    offset: float = 6.0,
    mark_azimuth_deg: float = 180.137,
    mark_deg: float = 78.2555,
    telescope_arcsec: float = 4.0,
    noise: float = 0.5,
    mark_sd_arcsec: float = 1.0,
    seed: int = 0,
) -> SimulatedDiFlux:
    """The usual eight settings, twice each, and a ninth of known tilt for the scale.

    Parameters
    ----------
    delta_arcsec, epsilon_arcsec, offset : of the fluxgate. telescope_arcsec : collimation of the
        telescope. mark_deg : reading of the circle to the mark, at `mark_azimuth_deg`.
    noise : of a setting, nT: field and circle together. mark_sd_arcsec : of a sighting.

    Source: the model of Brunke and Matzka (2018), as in `fit_di_flux`.

    >>> simulate_di_flux().sheet.horizontal_deg.shape
    (18,)
    """
    rng = np.random.default_rng(seed)
    meridian = declination_deg - mark_azimuth_deg + mark_deg
    dip, off = inclination_deg, (delta_arcsec / 3600, epsilon_arcsec / 3600)
    truth = np.array([*np.radians([meridian, dip, *off]), offset / magnitude, magnitude])
    east, west = meridian + 90.0, meridian - 90.0
    circles = np.array(
        [
            [east, 90.0],
            [west, 90.0],
            [west, 270.0],
            [east, 270.0],
            [meridian, dip],
            [meridian, dip + 180],
            [meridian + 180, 360 - dip],
            [meridian + 180, 180 - dip],
            [meridian + 180, 180 - dip + 0.18],
        ]
    )
    # each circle is set to the minute nearest a zero reading, the fluxgate reads the rest
    circles[:4, 0] = np.round(_read_null(truth, circles[:4], 0) * 60) / 60
    circles[4:8, 1] = np.round(_read_null(truth, circles[4:8], 1) * 60) / 60
    circles[8, 1] = circles[7, 1] + 0.18
    at = _at(circles)
    reading = kernel.predict(truth, at)[0] + noise * rng.standard_normal(9)
    faces = np.array([0, 180, 0, 180])
    collimated = np.where(faces > 90, -1, 1) * telescope_arcsec
    marks = mark_deg + faces + (collimated + mark_sd_arcsec * rng.standard_normal(4)) / 3600
    return SimulatedDiFlux(
        sheet=DiSheet(
            mark_deg=np.repeat(marks, 2) % 360,
            mark_azimuth_deg=mark_azimuth_deg,
            horizontal_deg=np.repeat(circles[:, 0], 2) % 360,
            zenith_deg=np.repeat(circles[:, 1], 2),
            reading=np.repeat(reading, 2),
            setting=np.repeat(np.arange(9), 2),
            time=1.7e9 + 30.0 * np.arange(18.0),
            magnitude=magnitude,
            name="simulated",
            pillar="A",
        ),
        declination_deg=declination_deg,
        inclination_deg=inclination_deg,
        delta_arcsec=delta_arcsec,
        epsilon_arcsec=epsilon_arcsec,
        offset=offset,
    )


def _read_null(truth: Array, circles: Array, which: int) -> Array:
    """The readings (n,), degrees, of one circle at which the fluxgate reads nothing."""

    def read(angle_deg: Array) -> Array:
        turned = circles.copy()
        turned[:, which] = angle_deg
        return kernel.predict(truth, _at(turned))[0]

    return np.asarray(newton(read, circles[:, which]))


def _at(circles: Array) -> kernel.Settings:
    """Settings (n, 2) of the circles, degrees, without readings."""
    horizontal, zenith = np.radians(circles).T
    nothing = np.zeros(len(circles))
    return kernel.Settings(horizontal, zenith, nothing, np.zeros(len(circles), dtype=bool))
