"""What is said and shown of a coil, of an accelerometer's turn, and of a turned platform."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import partial

import numpy as np

from agonic.alignment.coil.fit import METHOD
from agonic.alignment.coil.result import CoilFit, Direction
from agonic.alignment.figures import draw_figure, draw_residuals, draw_series
from agonic.alignment.findings import judge, write_by_axis
from agonic.alignment.gravity import GravityFit
from agonic.alignment.remanence import RemanenceFit
from agonic.readable import make_record
from agonic.report.digits import group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.markup import Markup
from agonic.report.section import Section, Table, list_inputs

WHEN_CLEAN = "Use the platform; turn it again when something on it was changed."
CAPTION = "What is read at each angle of the platform beside the mean"
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
LEVEL_HEAD = ("Current, A", "Constant, nT/A", "Standard error", "Departure", "Departure, ppm")


def describe_coil(fit: CoilFit) -> Document:
    """The axis in every frame, the constant at each current, and what was objected to.

    >>> from agonic.alignment.coil.fit import fit_coil
    >>> from agonic.alignment.simulation.laboratory import simulate_coil
    >>> made = describe_coil(fit_coil(simulate_coil(levels=(1.0, 0.5)).session))
    >>> made.to_html().count("<h2>"), len(made.values["levels"])
    (5, 2)
    """
    session, refused = fit.session, fit.verdict == "refused"
    reference = None if session.reference is None else session.reference.origin
    left, along = fit.estimate.residuals, [f"along {letter}" for letter in "xyz"]
    drawn = partial(draw_series, left, fit.stretches.time, along, "nT")
    return Document(
        schema="agonic/fit-coil@1",
        kind=f"Magnetic axis of a coil, {fit.reversals} current reversals",
        name=session.coil,
        title=session.name or session.coil,
        method=f"magnetic axis from {fit.reversals} current reversals",
        **judge(fit),
        entries=_list_coil(fit),
        sections=[
            *([_tabulate_coil(fit)] if fit.levels and not refused else []),
            *([] if refused else [Section("Residuals of the stretches", [drawn])]),
            list_inputs(session.magnetometer.origin, reference, method=METHOD),
        ],
        values={
            "coil": session.coil,
            **make_record(fit),
            "even_nT_A2": fit.estimate.even,
            "noise_nT": fit.estimate.noise,
        },
        styles=["alignment.css"],
    )


def _list_coil(fit: CoilFit) -> dict[str, str]:
    """What was found, by name."""
    entries = {"Constant": f"{with_sd(fit.constant, fit.constant_sd)} nT/A"}
    for letter, direction in fit.directions.items():
        entries[f"Axis {letter}"] = _write_coil_axis(letter, direction, fit.time)
    if fit.geometric_deg is not None and fit.geometric_sd_arcsec is not None:
        away = with_sd(3600 * fit.geometric_deg, fit.geometric_sd_arcsec)
        entries["As drawn"] = f"{away}″ away"
    noise = float(np.sqrt((fit.estimate.noise**2).mean()))
    entries["Noise"] = f"{quantity(noise, 'nT', 2)} of a reading, {fit.n} stretches"
    return entries


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


def _tabulate_coil(fit: CoilFit) -> Section:
    rows = [
        [
            group_digits(level.current_A, 5),
            group_digits(level.constant, 3),
            significant(level.sd, 2),
            *(significant(level.departure * per, 2) for per in (1.0, 1e6 / fit.constant)),
        ]
        for level in fit.levels
    ]
    return Section("Linearity", [Table(LEVEL_HEAD, rows, "numbers small")], printed=True)


def describe_gravity(fit: GravityFit, sensor: str) -> Document:
    """The rotation from the magnetometer of a name to the accelerometer; a refused one has none.

    >>> from agonic.alignment.gravity import fit_gravity
    >>> from agonic.alignment.simulation.laboratory import simulate_gravity
    >>> made = describe_gravity(fit_gravity(simulate_gravity().samples), "mag")
    >>> print(made.to_text().splitlines()[0])
    ✓ mag: good (against the accelerometer, 24 orientations at rest)
    """
    refused, estimate = fit.verdict == "refused", fit.estimate
    found = {**make_record(fit), "bias": estimate.bias, "residuals": estimate.residuals}
    rows = (" ".join(group_digits(float(v), 6) for v in row) for row in fit.rot_bm)
    return Document(
        schema="agonic/fit-gravity@1",
        kind="Alignment with an accelerometer",
        name=sensor,
        method=f"against the accelerometer, {fit.n} orientations at rest",
        **judge(fit),
        entries={
            "Turn": quantity(fit.angle_deg, "°", 4),
            "Error": f"about the accelerometer's {write_by_axis(fit.sd_deg, '°')}",
            "Matrix": "; ".join(rows),
            "Dip": f"{group_digits(fit.inclination_deg, 2)}°",
        },
        values={"sensor": sensor, "n": fit.n, **({} if refused else found)},
        calibration=None if refused else fit.calibration,
    )


def describe_remanence(fit: RemanenceFit) -> Document:
    """The platform's own field, what is induced in it, and what was read at each angle.

    >>> from agonic.alignment.remanence import fit_remanence
    >>> from agonic.alignment.simulation.session import simulate_remanence
    >>> made = describe_remanence(fit_remanence(simulate_remanence()))
    >>> print(made.to_text().splitlines()[0])
    ✓ magnetometer: good (platform turned to 12 settings)
    """
    turned = f"{with_sd(fit.size_arcsec, fit.sd_arcsec)}″"
    entries = {"Remanence": f"{with_sd(fit.size, fit.sd)} nT across the axis of the turn, {turned}"}
    if fit.induced is not None:
        entries["Induced"] = f"{with_sd(fit.induced, fit.induced_sd)} nT, twice in a turn"
    read = [one.origin for one in (fit.samples, fit.reference) if one is not None]
    cosine, sine = fit.harmonics.once[:2]
    found = {"sensor": fit.samples.name, "cosine_nT": cosine, "sine_nT": sine}
    return Document(
        schema="agonic/fit-remanence@1",
        kind="Remanence of a platform",
        name=fit.samples.name,
        method=f"platform turned to {fit.n} settings",
        **judge(fit),
        move=next((finding.move for finding in fit.findings), WHEN_CLEAN),
        entries=entries,
        sections=[
            Section("At each angle of the platform", [lambda: _draw_remanence(fit)]),
            list_inputs(*read, method=METHOD),
        ],
        values={**found, **make_record(fit)},
        styles=["alignment.css"],
    )


def _draw_remanence(fit: RemanenceFit) -> Markup:
    angles = np.round(fit.angle_deg).astype(np.int64)
    drawn = draw_residuals(fit.field, fit.noise, angles, "angle of the platform, °")
    return draw_figure(drawn, CAPTION)
