"""What the reader of a DI-flux sheet should know of its result."""

from __future__ import annotations

import numpy as np

from agonic.alignment.maths.di_flux import Settings
from agonic.alignment.north.di_flux_result import DiFluxFit
from agonic.alignment.north.theodolite import LEVEL_SIN
from agonic.health import Finding, figure
from agonic.maths.rotations.angles import wrap_deg

OFF_MERIDIAN_DEG = 0.1
WIDE_ARCSEC = 10.0
BIG_ERROR_DEG = 1.0


def examine(fit: DiFluxFit, at: Settings) -> tuple[Finding, ...]:
    """The findings of a sheet, in the order of its parts: mark, meridian, scale, scatter."""
    found = (
        _mark(fit),
        _off_meridian(fit, at),
        _no_scale(fit),
        _backwards(fit),
        _disagree(fit),
        _collimation(fit),
    )
    return tuple(one for one in found if one is not None)


def _mark(fit: DiFluxFit) -> Finding | None:
    if fit.sheet.mark_azimuth_deg is None:
        what = "the sheet has no azimuth of the mark, so the declination is left open"
        return Finding("no mark", "note", what, "give Abs-AzimuthMark")
    if np.isfinite(fit.mark.sd_deg):
        return None
    what = (
        "the readings of the mark do not differ, so its own error is not in that of the declination"
    )
    return Finding("mark read once", "note", what, "read it in both faces before and after")


def _off_meridian(fit: DiFluxFit, at: Settings) -> Finding | None:
    sides = at.horizontal[~at.from_meridian & (np.abs(np.sin(at.zenith)) <= LEVEL_SIN)]
    if not len(sides):
        return None
    off = float(np.abs(wrap_deg(2 * (np.degrees(sides) - fit.meridian_deg)) / 2).max())
    if off <= OFF_MERIDIAN_DEG:
        return None
    what = f"the inclination was taken {figure(off)}° off the magnetic meridian; this is corrected"
    return Finding("off the meridian", "note", what, "check the circle's readings there")


def _no_scale(fit: DiFluxFit) -> Finding | None:
    if fit.scaled or np.abs(fit.sheet.reading).max() <= 0:
        return None
    what = (
        "neither the total field nor a reading of known tilt tells what a unit of the fluxgate is"
    )
    return Finding("no scale", "check", what, "give --field")


def _backwards(fit: DiFluxFit) -> Finding | None:
    """The field turned round with a fluxgate turned round reads the same at all settings."""
    if fit.estimate.params[-1] > 0:
        return None
    what = (
        "the fluxgate reads less where the field along it is more: its sign is reversed, or the "
        "first setting of the inclination does not look north and the field dips the other way"
    )
    return Finding("reads backwards", "check", what, "look for settings that were exchanged")


def _disagree(fit: DiFluxFit) -> Finding | None:
    if fit.noise_arcsec <= WIDE_ARCSEC:
        return None
    what = f"the settings disagree by {figure(fit.noise_arcsec)}″ of the field's direction"
    move = "look for a misread circle, iron on the observer or a disturbed field"
    return Finding("settings disagree", "check", what, move)


def _collimation(fit: DiFluxFit) -> Finding | None:
    worst = max(np.abs(fit.collimation_arcsec)) / 3600.0
    if worst <= BIG_ERROR_DEG:
        return None
    what = f"the fluxgate is {figure(worst)}° from the telescope"
    return Finding("collimation", "check", what, "adjust it; errors of second order are not small")
