"""`agonic fit deviation SWING`: the deviation card of a compass."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agonic.console.options import Between, Json, Out, Robust, SensorChoice
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.headings.files.swing import Swing


def deviation(
    swing: Path,
    setup: Path | None = None,
    which: SensorChoice = SensorChoice(),
    between: Between = None,
    out: Out = None,
    card: Path | None = None,
    declination: float | None = None,
    power_state: str | None = None,
    current: float | None = None,
    terms: str = "ABCDE",
    heel: bool | None = None,
    noise_deg: float | None = None,
    drift_deg: float | None = None,
    robust: Robust = True,
    step: float = 15.0,
    paper: str = "A4",
    as_json: Json = False,
) -> int:
    """Deviation of a compass, A to E, from a swing; the card as text, page or picture.

    Exit status 1 where the headings do not determine it or something is to be looked at.

    Options
    -------
    swing <SWING> : Compass and reference headings, a row a reading; with --setup, a log.
    setup SETUP : Take SWING for a log with a heading of its own, and the compass heading from this
        setup or calibration.
    card FILE : Card to write: .html, .txt, or .svg (chart).
    declination DEG : East positive, where the reference is true heading.
    power_state : What was switched on; the card is valid with it.
    current A : The current drawn during the swing.
    terms : Terms to fit; the others are fixed at 0.
    heel : Heel terms; default: where roll was noted in a swing.
    noise_deg DEG : Of one reading, if known.
    drift_deg DEG : Of the reference from first reading to last, if known; 0: none.
    step DEG : From one row of the card to the next.
    paper : A4 or A5, for printing.
    """
    import math

    from agonic.console.finish import finish, write_as_named
    from agonic.files.calibration import save
    from agonic.headings.deviation import fit_deviation
    from agonic.headings.deviation.document import describe_deviation
    from agonic.headings.files.swing import read_swing

    if current is not None and not math.isfinite(current):
        raise AgonicError(f"--current {current} is not a current")
    read = read_swing(swing) if setup is None else _of_log(swing, setup, which, between)
    if heel and read.heel is None:
        raise AgonicError("--heel was asked for and the swing has no column roll_deg; add it")
    fit = fit_deviation(
        read.compass_deg,
        read.reference_deg,
        heel=read.heel if (setup is None if heel is None else heel) else None,
        declination_deg=_declination(read, declination),
        terms=terms,
        robust=robust,
        noise_deg=read.number("noise_deg") if noise_deg is None else noise_deg,
        drift_deg=read.number("drift_deg") if drift_deg is None else drift_deg,
        estimated=read.estimated,
        power_state=read.remarks.get("power_state", "") if power_state is None else power_state,
        current_A=read.number("current_A") if current is None else current,
        sensor=read.remarks.get("compass", "compass"),
        source=read.source,
    )
    details = {n.capitalize(): read.remarks[n] for n in ("date", "place") if n in read.remarks}
    made = describe_deviation(
        fit,
        step_deg=step,
        details=details,
        paper=paper,  # type: ignore[arg-type]
        blank=read.blank,
    )
    made.to_text()  # names a step that cannot be before anything is written
    forms = {
        ".html": made.to_html,
        ".svg": made.to_picture,
        ".txt": lambda: made.to_text() + "\n",
    }
    files = [] if card is None else [write_as_named(card, "--card", forms)]
    if out is not None and fit.verdict != "refused":
        files.append(str(save(fit.calibration, out)))
    return finish(made, files=files, as_json=as_json)


def _of_log(log: Path, setup: Path, which: SensorChoice, between: str | None) -> Swing:
    """The swing that a log with a heading of its own is."""
    from agonic.console.sensors import add_second, select_between
    from agonic.files.setup import load_setup
    from agonic.headings.deviation.swing_of_log import find_swing
    from agonic.logs.read import open_log

    compasses = load_setup(setup)
    first, recording = compasses.compasses[0], open_log(log, unit=which.unit)
    samples = recording.sensor(which.sensor or first.sensor)
    samples = add_second(first.calibration, samples, recording)
    return find_swing(select_between(samples, between), compasses)


def _declination(read: Swing, given: float | None) -> float | None:
    """The declination where the reference is true heading."""
    if read.reference == "magnetic":
        if given is not None:
            raise AgonicError(
                "the reference is a magnetic heading already; leave --declination out, or call "
                "the column true_deg"
            )
        return None
    declination = read.number("declination_deg") if given is None else given
    if declination is None:
        raise AgonicError(
            "the reference is true heading; give --declination DEG, east positive "
            "(agonic field --at LAT,LON --date DATE prints it)"
        )
    return declination
