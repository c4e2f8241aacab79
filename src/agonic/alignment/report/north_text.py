"""North, absolute measurements, coil axes and gravity as plain text, and their tables."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from datetime import UTC, datetime

import numpy as np

from agonic.alignment.coil import CoilFit
from agonic.alignment.gravity import GravityFit
from agonic.alignment.north import DiFluxFit, NorthFit
from agonic.health import Judged
from agonic.report.digits import grouped, minused, quantity, significant, with_sd
from agonic.report.text import SIGNS
from agonic.report.verdict import MEANINGS

WIDTH, NOTHING = 98, "–"
METHODS = {"swing": "damped sinusoid", "reversal": "turning points", "transit": "transits"}
FRAMES = {
    "m": "magnetometer",
    "b": "platform",
    "c": "star sensor",
    "n": "north, east, down",
    "e": "Earth-fixed",
    "i": "inertial",
}
ANGLES = {
    "n": ("azimuth", "elevation"),
    "i": ("right ascension", "declination"),
    "e": ("longitude", "latitude"),
}


def north_text(fit: NorthFit) -> str:
    """Verdict, north by every method, azimuths, and the alignment, on one screen.

    >>> from agonic.alignment.north import fit_north
    >>> from agonic.alignment.simulation.north import simulate_north
    >>> print(north_text(fit_north(simulate_north().session)).splitlines()[0])
    ✓ simulated: good (north by a gyrotheodolite, damped sinusoid)
    """
    about = f"north by a gyrotheodolite, {METHODS[fit.method]}"
    return _text(fit, fit.session.name or "north", about, north_entries(fit))


def north_entries(fit: NorthFit) -> dict[str, str]:
    """What was found, by a short name."""
    said = {"North": f"{_angle(fit.north_deg, fit.sd_arcsec)} on the circle, constant included"}
    for name, found in fit.by.items():
        value = _angle(found.reading_deg, 3600 * found.sd_deg)
        said[name.capitalize()] = f"{value}, gyro north by {METHODS[name]}"
    if fit.constant is not None and fit.constant_sd is not None:
        said["c"] = f"{with_sd(fit.constant, fit.constant_sd)} degrees per unit of amplitude and s"
    if fit.period_s is not None:
        said["Period"] = quantity(fit.period_s, "s", 5)
    for azimuth in fit.azimuths:
        faces = azimuth.collimation_arcsec
        both = f", collimation {grouped(faces, 1)}″" if np.isfinite(faces) else ""
        said[azimuth.name] = f"azimuth {_angle(azimuth.azimuth_deg, azimuth.sd_arcsec)}{both}"
    if fit.aligned is not None:
        sd = "   ".join(
            f"{axis} {significant(float(s), 2)}″"
            for axis, s in zip("xyz", fit.aligned.sd_arcsec, strict=True)
        )
        said["Alignment"] = f"with the platform, about the magnetometer's {sd}"
    return said


PLATFORM_HEAD = ("Orientation", "Heading", "x, nT", "y, nT", "z, nT")


def platform_rows(fit: NorthFit) -> list[list[str]]:
    """Each orientation of the platform: its heading and what is left."""
    found = fit.aligned
    if found is None:
        return []
    return [
        [str(number), f"{grouped(float(heading), 4)}°", *(grouped(float(v), 3) for v in left)]
        for number, heading, left in zip(
            found.orientation, found.heading_deg, found.residuals, strict=True
        )
    ]


def di_flux_text(fit: DiFluxFit) -> str:
    """Declination, inclination, and the errors of the instrument.

    >>> from agonic.alignment.north import fit_di_flux
    >>> from agonic.alignment.simulation.di_flux import simulate_di_flux
    >>> print(di_flux_text(fit_di_flux(simulate_di_flux().sheet)).splitlines()[0])
    ✓ simulated: good (absolute measurement with a fluxgate theodolite, 9 settings)
    """
    about = f"absolute measurement with a fluxgate theodolite, {fit.n} settings"
    return _text(fit, fit.sheet.name, about, di_flux_entries(fit))


def di_flux_entries(fit: DiFluxFit) -> dict[str, str]:
    """What the sheet gives, by name."""
    (delta, epsilon), (delta_sd, epsilon_sd) = fit.collimation_arcsec, fit.collimation_sd_arcsec
    said = {}
    if fit.declination_deg is not None:
        said["Declination"] = _angle(fit.declination_deg, fit.declination_sd_arcsec)
    said["Inclination"] = _angle(fit.inclination_deg, fit.inclination_sd_arcsec)
    said["Meridian"] = f"{_angle(fit.meridian_deg, fit.meridian_sd_arcsec)} on the circle"
    said["Mark"] = (
        f"{_angle(fit.mark.reading_deg, 3600 * fit.mark.sd_deg)} on the circle, telescope's "
        f"collimation {grouped(3600 * fit.mark.collimation_deg, 1)}″"
    )
    said["δ"] = f"{with_sd(delta, delta_sd)} ″, fluxgate to the right of the telescope"
    said["ε"] = f"{with_sd(epsilon, epsilon_sd)} ″, to greater zenith angles"
    said["S₀/F"] = f"{with_sd(*fit.offset_arcsec)} ″, the fluxgate's offset as an angle"
    if fit.scaled:
        said["S₀"] = f"{with_sd(fit.offset, fit.offset_sd)} units of the fluxgate"
    if fit.scaled and fit.sheet.magnitude is not None:
        said["Scale"] = f"{significant(fit.scale / fit.sheet.magnitude, 4)} units per nT"
    return said


def coil_text(fit: CoilFit) -> str:
    """Constant, axis in every frame, angle to the one as drawn, linearity.

    >>> from agonic.alignment.coil import fit_coil
    >>> from agonic.alignment.simulation.coil import simulate_coil
    >>> print(coil_text(fit_coil(simulate_coil().session)).splitlines()[0])
    ✓ coil: good (magnetic axis from 100 current reversals)
    """
    about = f"magnetic axis from {fit.reversals} current reversals"
    entries = coil_entries(fit)
    for level in fit.levels:
        entries[f"{level.current_A:.4g} A"] = (
            f"{with_sd(level.constant, level.sd)} nT/A, {significant(level.departure, 2)} from all"
        )
    return _text(fit, fit.session.coil, about, entries)


def coil_entries(fit: CoilFit) -> dict[str, str]:
    """What was found, by name."""
    said = {"Constant": f"{with_sd(fit.constant, fit.constant_sd)} nT/A"}
    for letter, direction in fit.directions.items():
        x, y, z = (grouped(float(part), 8) for part in direction.axis)
        said[f"Axis {letter}"] = (
            f"{x}, {y}, {z} ± {significant(direction.sd_arcsec, 2)}″ ({FRAMES[letter]})"
        )
        if letter in ANGLES:
            names, angles = ANGLES[letter], direction.angles_deg
            when = f" at {_moment(fit.time)}" if letter == "i" and fit.time else ""
            said[f"Axis {letter}"] += (
                "".join(
                    f", {name} {grouped(angle, 5)}°"
                    for name, angle in zip(names, angles, strict=True)
                )
                + when
            )
    if fit.geometric_deg is not None and fit.geometric_sd_arcsec is not None:
        said["As drawn"] = f"{with_sd(3600 * fit.geometric_deg, fit.geometric_sd_arcsec)} ″ away"
    noise = float(np.sqrt((fit.estimate.noise**2).mean()))
    said["Noise"] = f"{quantity(noise, 'nT', 2)} of a reading, {fit.n} stretches"
    return said


def gravity_text(fit: GravityFit, name: str) -> str:
    """The turn between magnetometer and accelerometer.

    >>> from agonic.alignment.gravity import fit_gravity
    >>> from agonic.alignment.simulation.gravity import simulate_gravity
    >>> print(gravity_text(fit_gravity(simulate_gravity().samples), "mag").splitlines()[0])
    ✓ mag: good (against the accelerometer, 24 orientations at rest)
    """
    about = f"against the accelerometer, {fit.n} orientations at rest"
    matrix = "; ".join(" ".join(grouped(float(v), 6) for v in row) for row in fit.rot_bm)
    sd = "   ".join(
        f"{a} {significant(float(s), 2)}°" for a, s in zip("xyz", fit.sd_deg, strict=True)
    )
    return _text(
        fit,
        name,
        about,
        {
            "Turn": f"{quantity(fit.angle_deg, '°', 4)}",
            "Error": f"about the accelerometer's {sd}",
            "Matrix": matrix,
            "Dip": f"{grouped(fit.inclination_deg, 2)}°",
        },
    )


def _text(fit: Judged, name: str, about: str, entries: Mapping[str, str]) -> str:
    """Verdict, status, and what was found; nothing of that where it was refused."""
    word = MEANINGS[fit.verdict][0].lower()
    lines = [f"{SIGNS[fit.verdict]} {name}: {word} ({about})"]
    lines += textwrap.wrap(minused(fit.status), WIDTH, initial_indent="  ", subsequent_indent="  ")
    if fit.verdict == "refused":
        return "\n".join(lines)
    wide = max(map(len, entries)) + 2
    for key, text in entries.items():
        lines += textwrap.wrap(
            text,
            WIDTH,
            initial_indent=f"  {key:<{wide}}",
            subsequent_indent=" " * (wide + 2),
            break_long_words=False,
        )
    return "\n".join(lines)


def _angle(value_deg: float, sd_arcsec: float) -> str:
    """An angle with its standard error."""
    known = f" ± {significant(sd_arcsec, 2)}″" if np.isfinite(sd_arcsec) else ""
    return f"{grouped(value_deg, 5)}°{known}"


def _moment(unix_s: float) -> str:
    return datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
