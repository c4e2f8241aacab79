"""What is said and shown of north, a sheet, a coil, an accelerometer, and a turned platform."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from agonic.alignment.coil.result import METHOD, CoilFit, Direction, Level
from agonic.alignment.figures import (
    draw_residuals,
    draw_series,
    draw_settings,
)
from agonic.alignment.gravity import GravityFit
from agonic.alignment.maths.columns import average, find_rows
from agonic.alignment.maths.north import Swing, evaluate_swing_deg
from agonic.alignment.north.di_flux import DiFluxFit
from agonic.alignment.north.fit import NorthFit
from agonic.alignment.remanence import RemanenceFit
from agonic.alignment.session.laboratory import SwingRecord
from agonic.health import Judged
from agonic.readable import make_record
from agonic.report.axes import fit_axis, over_rows
from agonic.report.digits import group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.figure import Figure, figure
from agonic.report.marks import level, mean
from agonic.report.section import Section, Table, list_inputs, tabulate

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
METHODS = {"swing": "damped sinusoid", "reversal": "turning points", "transit": "transits"}


def make_document(fit: Judged, found: dict[str, Any], **given: Any) -> Document:
    """The document of a result: its verdict and findings, and what was `found`. A refused one has
    no numbers; sections and further values only where they are among those `given`."""
    if fit.verdict != "refused":
        given["values"] = {**given.get("values", {}), **found}
    calibration = getattr(fit, "calibration", None)
    return Document.judge(fit, calibration=calibration, styles=["alignment.css"], **given)


def describe_coil(fit: CoilFit) -> Document:
    """The axis in every frame, the constant at each current, and what was objected to."""
    session, sections = fit.session, []
    reference = None if session.reference is None else session.reference.origin
    left, along = fit.estimate.residuals, [f"along {letter}" for letter in "xyz"]
    drawn = partial(draw_series, left, fit.stretches.time, along, "nT")
    if fit.levels:
        sections.append(Section("Linearity", [_list_levels(fit)], printed=True))
    sections.append(Section("Residuals of the stretches", [drawn]))
    entries = {"Constant": f"{with_sd(fit.constant, fit.constant_sd)} nT/A"}
    for letter, direction in fit.directions.items():
        entries[f"Axis {letter}"] = _write_coil_axis(letter, direction, fit.time)
    if fit.geometric_deg is not None and fit.geometric_sd_arcsec is not None:
        away = with_sd(3600 * fit.geometric_deg, fit.geometric_sd_arcsec)
        entries["As drawn"] = f"{away}″ away"
    noise = float(np.sqrt((fit.estimate.noise**2).mean()))
    entries["Noise"] = f"{quantity(noise, 'nT', 2)} of a reading, {fit.n} stretches"
    return make_document(
        fit,
        {},
        schema="agonic/fit-coil@1",
        kind=f"Magnetic axis of a coil, {fit.reversals} current reversals",
        name=session.coil,
        title=session.name or session.coil,
        method=f"magnetic axis from {fit.reversals} current reversals",
        entries=entries,
        sections=[
            *(sections if fit.verdict != "refused" else ()),
            list_inputs(session.magnetometer.origin, reference, method=METHOD),
        ],
        values={
            "coil": session.coil,
            **make_record(fit),
            "even_nT_A2": fit.estimate.even,
            "noise_nT": fit.estimate.noise,
        },
    )


def _list_levels(fit: CoilFit) -> Table:
    """The constant at each size of the current."""
    columns: dict[str, Callable[[Level], str]] = {
        "Current, A": lambda level: group_digits(level.current_A, 5),
        "Constant, nT/A": lambda level: group_digits(level.constant, 3),
        "Standard error": lambda level: significant(level.sd, 2),
        "Departure": lambda level: significant(level.departure, 2),
        "Departure, ppm": lambda level: significant(1e6 * level.departure / fit.constant, 2),
    }
    return tabulate(fit.levels, columns, "numbers small")


def _write_coil_axis(letter: str, direction: Direction, time: float | None) -> str:
    """The axis in a frame, with its angles where they have names."""
    x, y, z = (group_digits(float(part), 8) for part in direction.axis)
    words = f"{x}, {y}, {z} ± {significant(direction.sd_arcsec, 2)}″ ({FRAMES[letter]})"
    names = ANGLES.get(letter, ())
    for name, angle in zip(names, direction.angles_deg, strict=False):
        words += f", {name} {group_digits(angle, 5)}°"
    if letter == "i" and time:
        when = datetime.fromtimestamp(time, UTC)  # the sky turns by 15″ a second
        words += f" at {when:%Y-%m-%d %H:%M:%S}.{when.microsecond // 1000:03d} UTC"
    return words


def describe_gravity(fit: GravityFit, sensor: str) -> Document:
    """The rotation from the magnetometer of a name to the accelerometer; a refused one has none."""
    estimate = fit.estimate
    rows = (" ".join(group_digits(float(v), 6) for v in row) for row in fit.rot_bm)
    return make_document(
        fit,
        {**make_record(fit), "bias": estimate.bias, "residuals": estimate.residuals},
        schema="agonic/fit-gravity@1",
        kind="Alignment with an accelerometer",
        name=sensor,
        method=f"against the accelerometer, {fit.n} orientations at rest",
        entries={
            "Turn": quantity(fit.angle_deg, "°", 4),
            "Error": f"about the accelerometer's {write_by_axis(fit.sd_deg, '°')}",
            "Matrix": "; ".join(rows),
            "Dip": f"{group_digits(fit.inclination_deg, 2)}°",
        },
        values={"sensor": sensor, "n": fit.n},
    )


def describe_remanence(fit: RemanenceFit) -> Document:
    """The platform's own field, what is induced in it, and what was read at each angle."""
    turned = f"{with_sd(fit.size_arcsec, fit.sd_arcsec)}″"
    entries = {"Remanence": f"{with_sd(fit.size, fit.sd)} nT across the axis of the turn, {turned}"}
    if fit.induced is not None:
        entries["Induced"] = f"{with_sd(fit.induced, fit.induced_sd)} nT, twice in a turn"
    read = [one.origin for one in (fit.samples, fit.reference) if one is not None]
    cosine, sine = fit.harmonics.parts[0]
    angles = np.round(fit.angle_deg).astype(np.int64)
    title = "What is read at each angle of the platform beside the mean"
    along = "angle of the platform, °"
    drawn = partial(draw_residuals, fit.field, fit.noise, angles, along, title)
    clean = "Use the platform; turn it again when something on it was changed."
    return make_document(
        fit,
        make_record(fit),
        schema="agonic/fit-remanence@1",
        kind="Remanence of a platform",
        name=fit.samples.name,
        method=f"platform turned to {fit.n} settings",
        move=next((finding.move for finding in fit.findings), clean),
        entries=entries,
        sections=[
            Section("At each angle of the platform", [drawn]),
            list_inputs(*read, method=METHOD),
        ],
        values={"sensor": fit.samples.name, "cosine_nT": cosine, "sine_nT": sine},
    )


def describe_north(fit: NorthFit) -> Document:
    """North by every method, the swing, azimuths, and the alignment; refused ones have none."""
    session, aligned = fit.session, fit.aligned
    sections, values = [], make_record(fit)
    if session.swing is not None and fit.swing is not None:
        drawn = partial(draw_swing, session.swing, fit.swing)
        sections.append(Section("The swing", [drawn]))
    if aligned is not None:
        found, numbers = aligned.solution, aligned.orientation
        rows = [
            [str(n), f"{group_digits(float(at), 4)}°", *(group_digits(float(v), 3) for v in left)]
            for n, at, left in zip(numbers, aligned.heading_deg, found.residuals, strict=True)
        ]
        bars = partial(draw_residuals, found.residuals, found.residuals_sd, numbers)
        head = ("Orientation", "Heading", "x, nT", "y, nT", "z, nT")
        table = Table(head, rows, "numbers small")
        sections.append(Section("Residuals of the platform", [bars, table]))
        values |= {"n": len(numbers), **make_record(aligned), "residuals_nT": found.residuals}
        values |= {"chi2": found.chi2, "freedom": found.freedom}
    return make_document(
        fit,
        values,
        schema="agonic/fit-north@1",
        kind="North by a gyrotheodolite",
        name=session.name or "north",
        method=f"north by a gyrotheodolite, {METHODS[fit.method]}",
        entries=_list_north(fit),
        sections=[] if fit.verdict == "refused" else sections,
        values={"method": fit.method},
    )


def write_by_axis(sds: Iterable[float], unit: str = "″", between: str = "   ") -> str:
    """Standard errors (3,) about the axes x, y and z."""
    return between.join(
        f"{a} {significant(float(sd), 2)}{unit}" for a, sd in zip("xyz", sds, strict=True)
    )


def format_angle(value_deg: float, sd_arcsec: float) -> str:
    """An angle with its standard error, where that is known."""
    known = f" ± {significant(sd_arcsec, 2)}″" if np.isfinite(sd_arcsec) else ""
    return f"{group_digits(value_deg, 5)}°{known}"


def _list_north(fit: NorthFit) -> dict[str, str]:
    """What was found, by a short name."""
    north = format_angle(fit.north_deg, fit.sd_arcsec)
    entries = {"North": f"{north} on the circle, constant included"}
    for name, found in fit.by.items():
        value = format_angle(found.reading_deg, found.sd_arcsec)
        entries[name.capitalize()] = f"{value}, gyro north by {METHODS[name]}"
    if fit.constant is not None and fit.constant_sd is not None:
        constant = with_sd(fit.constant, fit.constant_sd)
        entries["c"] = f"{constant} degrees per unit of amplitude and s"
    if fit.period_s is not None:
        entries["Period"] = quantity(fit.period_s, "s", 5)
    for azimuth in fit.azimuths:
        faces = azimuth.collimation_arcsec
        both = f", collimation {group_digits(faces, 1)}″" if np.isfinite(faces) else ""
        value = format_angle(azimuth.azimuth_deg, azimuth.sd_arcsec)
        entries[azimuth.name] = f"azimuth {value}{both}"
    if fit.aligned is not None:
        sd = write_by_axis(fit.aligned.sd_arcsec)
        entries["Alignment"] = f"with the platform, about the magnetometer's {sd}"
    return entries


def draw_swing(record: SwingRecord, swing: Swing) -> list[Figure]:
    """Readings of the circle over time with the gyro's north across, and what the fit leaves."""
    columns, reading = over_rows(record.time_s, len(record.time_s)), record.reading_deg
    circle = fit_axis("reading of the circle, °", reading)
    north = level("noise", swing.params[0], words="the gyro’s north")
    shown = mean(columns, reading, words="reading")
    left = 3600 * (reading - evaluate_swing_deg(swing.params, record.time_s - record.time_s[0]))
    rest = draw_series(left[:, None], record.time_s, ["What the damped sinusoid leaves"], "″")
    return [figure("The circle following the gyro", columns.x, circle, north, shown), *rest]


def describe_di_flux(fit: DiFluxFit) -> Document:
    """Declination, inclination, errors of the instrument, and the residual of each setting."""
    sheet, left = fit.sheet, -np.asarray(fit.estimate.residuals)
    about = ", ".join(text for text in (sheet.pillar, sheet.theodolite, sheet.sensor) if text)
    unit = "units of the fluxgate" if fit.scaled else "its own units"
    own = find_rows(sheet.setting, np.unique(sheet.setting))
    read = np.stack([sheet.horizontal_deg, sheet.zenith_deg, sheet.reading], axis=1)
    shown = ((4, "°"), (4, "°"), (2, ""), (2, ""))
    rows = [
        [str(k), *(f"{group_digits(v, n)}{sign}" for v, (n, sign) in zip(row, shown, strict=True))]
        for k, row in enumerate(np.column_stack([average(read, own), left]).tolist(), start=1)
    ]
    head = ("Setting", "Horizontal circle", "Zenith circle", "Fluxgate", "Residual")
    table = Table(head, rows, "numbers small")
    settings = Section("Settings", [table, partial(draw_settings, left, unit)])
    return make_document(
        fit,
        _record_sheet(fit),
        schema="agonic/fit-di-flux@1",
        kind=f"Absolute measurement {about}".rstrip(),
        name=sheet.name,
        method=f"absolute measurement with a fluxgate theodolite, {fit.n} settings",
        entries=_list_sheet(fit),
        sections=[settings, list_inputs(*sheet.sources)],
    )


def _list_sheet(fit: DiFluxFit) -> dict[str, str]:
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


def _record_sheet(fit: DiFluxFit) -> dict[str, Any]:
    """The numbers for programs; without a scale those in units of the fluxgate are null."""
    values = {
        **make_record(fit),
        "freedom": fit.estimate.freedom,
        "mark_deg": fit.mark.reading_deg,
        "mark_sd_arcsec": 3600 * fit.mark.sd_deg,
        "telescope_collimation_arcsec": 3600 * fit.mark.collimation_deg,
        "magnitude_nT": fit.sheet.magnitude,
    }
    for one, *both in (
        ("delta", fit.collimation_arcsec[0], fit.collimation_sd_arcsec[0]),
        ("epsilon", fit.collimation_arcsec[1], fit.collimation_sd_arcsec[1]),
        ("offset", *fit.offset_arcsec),
    ):
        values |= dict(zip((f"{one}_arcsec", f"{one}_sd_arcsec"), both, strict=True))
    return values if fit.scaled else values | dict.fromkeys(("offset", "offset_sd", "scale"))
