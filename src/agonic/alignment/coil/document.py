"""What is said and shown of a coil: its constant, its axis in every frame, its linearity."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from agonic.alignment.coil.fit import METHOD
from agonic.alignment.coil.result import CoilFit, Direction
from agonic.alignment.figures import draw_series
from agonic.report.digits import group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.origin import list_inputs
from agonic.report.section import Section, Table

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

    >>> from agonic.alignment.coil import fit_coil
    >>> from agonic.alignment.simulation.coil import simulate_coil
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
        verdict=fit.verdict,
        status=fit.status,
        findings=fit.findings,
        entries=_entries(fit),
        sections=[
            *([_linearity(fit)] if fit.levels and not refused else []),
            *([] if refused else [Section("Residuals of the stretches", [drawn])]),
            list_inputs(session.magnetometer.origin, reference, method=METHOD),
        ],
        values=_values(fit),
        styles=["alignment.css"],
    )


def _entries(fit: CoilFit) -> dict[str, str]:
    """What was found, by name."""
    entries = {"Constant": f"{with_sd(fit.constant, fit.constant_sd)} nT/A"}
    for letter, direction in fit.directions.items():
        entries[f"Axis {letter}"] = _axis(letter, direction, fit.time)
    if fit.geometric_deg is not None and fit.geometric_sd_arcsec is not None:
        away = with_sd(3600 * fit.geometric_deg, fit.geometric_sd_arcsec)
        entries["As drawn"] = f"{away}″ away"
    noise = float(np.sqrt((fit.estimate.noise**2).mean()))
    entries["Noise"] = f"{quantity(noise, 'nT', 2)} of a reading, {fit.n} stretches"
    return entries


def _axis(letter: str, direction: Direction, time: float | None) -> str:
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


def _linearity(fit: CoilFit) -> Section:
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


def _values(fit: CoilFit) -> dict[str, Any]:
    return {
        "coil": fit.session.coil,
        "n": fit.n,
        "reversals": fit.reversals,
        "constant_nT_A": fit.constant,
        "constant_sd_nT_A": fit.constant_sd,
        "axes": {
            letter: {"axis": one.axis, "sd_arcsec": one.sd_arcsec, "covariance": one.covariance}
            for letter, one in fit.directions.items()
        },
        "unix_s": fit.time,
        "geometric_deg": fit.geometric_deg,
        "geometric_sd_arcsec": fit.geometric_sd_arcsec,
        "levels": [asdict(level) for level in fit.levels],
        "p_linear": fit.p_linear,
        "even_nT_A2": fit.estimate.even,
        "noise_nT": fit.estimate.noise,
    }
