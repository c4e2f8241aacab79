"""The unknowns of a DI-flux sheet, from a start that needs no guess."""

from __future__ import annotations

import numpy as np

from agonic.alignment.maths import di_flux as kernel
from agonic.alignment.maths.di_flux import Settings, SheetEstimate
from agonic.alignment.session.di_flux import DiSheet
from agonic.arrays import Mask
from agonic.errors import CoverageError
from agonic.maths.rotations.angles import wrap_deg

USUAL_FIELD = 50_000.0
LEVEL_SIN = 0.99999  # the telescope is level to 0.26°: a setting for the declination
NOMINAL_DEG = 0.01
NEAR_MERIDIAN_DEG = 3.0


def estimate_sheet(
    sheet: DiSheet, magnitude: float | None, measured: bool
) -> tuple[SheetEstimate, Settings]:
    """The unknowns from either end of the meridian that may be north: the one that fits better.

    Two level settings half a turn apart look alike; with δ, ε and the offset in both kinds of
    settings only the right end fits.
    """
    _check(sheet)
    scale = magnitude or sheet.magnitude or USUAL_FIELD
    tried = []
    for meridian in _ends(sheet):
        at = _settings(sheet, meridian)
        azimuth = at.horizontal - np.where(at.from_meridian, 0.0, meridian)
        steep = ~level(sheet)
        inclination = np.arctan(np.tan(at.zenith[steep]) * np.cos(azimuth[steep]))
        start = np.array([meridian, float(np.median(inclination)), 0.0, 0.0, 0.0, scale])
        tried.append((kernel.estimate(at, start, sheet.setting, scale_known=not measured), at))
    return min(tried, key=lambda both: abs(both[0].noise / both[0].params[-1]))


def level(sheet: DiSheet) -> Mask:
    """The settings with the telescope level, for the declination."""
    return np.abs(np.sin(np.radians(sheet.zenith_deg))) > LEVEL_SIN


def _check(sheet: DiSheet) -> None:
    flat_rows = level(sheet)
    flat, steep = (len(np.unique(sheet.setting[rows])) for rows in (flat_rows, ~flat_rows))
    if flat < 4 or steep < 3:
        raise CoverageError(
            f"{flat} settings with the telescope level and {steep} others were given",
            undetermined="meridian, inclination and collimation together",
            turns="take four of each: east and west, north and south, sensor up and down",
        )


def _ends(sheet: DiSheet) -> list[float]:
    """The circle's readings, rad, that may be magnetic north: square to the level settings.

    Where the inclination's settings have readings of the circle the first looks north.
    """
    flat = level(sheet)
    doubled = np.exp(2j * np.radians(sheet.horizontal_deg[flat])).mean()
    meridian = float(np.angle(doubled) / 2 - np.pi / 2)
    both = [meridian, meridian + np.pi]
    if _nominal(sheet, meridian).any():
        return both
    first = np.radians(sheet.horizontal_deg[~flat][0])
    return [max(both, key=lambda end: float(np.cos(first - end)))]


def _nominal(sheet: DiSheet, meridian: float) -> Mask:
    """Settings whose horizontal reading is 0 or half a turn by name only, from the meridian."""
    off = wrap_deg(2 * (sheet.horizontal_deg - np.degrees(meridian))) / 2
    round_number = np.abs(wrap_deg(2 * sheet.horizontal_deg) / 2) < NOMINAL_DEG
    return ~level(sheet) & round_number & (np.abs(off) > NEAR_MERIDIAN_DEG)


def _settings(sheet: DiSheet, meridian: float) -> Settings:
    """What the kernel needs. Of the settings by name the first looks north; in the others the
    zenith reading tells which way, since tan I = tan v cos A has one sign."""
    h, v = np.radians(sheet.horizontal_deg), np.radians(sheet.zenith_deg)
    nominal = _nominal(sheet, meridian)
    if nominal.any():
        sign = np.sign(np.tan(v))
        first = int(np.flatnonzero(nominal)[0])
        h = np.where(nominal, np.where(sign == sign[first], 0.0, np.pi), h)
    return Settings(h, v, sheet.reading, nominal)
