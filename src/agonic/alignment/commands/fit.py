"""`agonic fit alignment|north|coil|gravity|remanence`: the directions of a laboratory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from shlex import quote

from agonic.alignment.commands.plan_alignment import Solve, Wanted
from agonic.console.options import Between, Json, LogPath, Magnitude, Out, Report, SensorChoice
from agonic.console.parse import parse_names
from agonic.console.sensors import open_sensor

_TURNED = (
    "this needs the log of a magnetometer at rest beside a platform that is turned: its field, and "
    "the angle of the platform as heading_deg"
)


def alignment(
    session: Path,
    out: Out = None,
    solve: Solve = "alignment",
    wanted: Wanted = 2.0,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """The rotation between star sensor and magnetometer, from a session of many orientations.

    Options
    -------
    session <SESSION> : session.toml, or the folder it is in.
    """
    from agonic.alignment.files.sessions import read_session
    from agonic.alignment.star_sensor.document import describe_alignment
    from agonic.alignment.star_sensor.fit import fit_alignment
    from agonic.console.finish import finish, is_folder

    groups = parse_names(solve)
    fit = fit_alignment(read_session(session), solve=groups, wanted_sd_arcsec=wanted)
    made = describe_alignment(fit)
    if out is not None and made.verdict != "refused":
        saved = out / f"{made.name}.json" if is_folder(out) else out
        command = f"agonic direction {quote(str(saved))} {quote(str(session))} -o field.csv"
        made = replace(made, next_step=command)
    return finish(made, out=out, report=report, as_json=as_json)


def north(
    session: Path,
    out: Out = None,
    report: Report = None,
    field: Magnitude = None,
    as_json: Json = False,
) -> int:
    """True north by a gyrotheodolite; or declination and inclination from a DI-flux sheet.

    Options
    -------
    session <SESSION> : north.toml or its folder; or a DI-flux sheet.
    """
    from agonic.alignment.document import describe_di_flux, describe_north
    from agonic.alignment.files.read_di_flux import is_di_flux, read_di_flux
    from agonic.alignment.files.sessions import read_north
    from agonic.alignment.north.di_flux import fit_di_flux
    from agonic.alignment.north.fit import fit_north
    from agonic.console.finish import finish
    from agonic.errors import AgonicError

    if session.is_file() and is_di_flux(session):
        if out is not None:
            raise AgonicError("a DI-flux sheet gives no calibration; leave -o out")
        sheet = fit_di_flux(read_di_flux(session), magnitude=field)
        return finish(describe_di_flux(sheet), report=report, as_json=as_json)
    if field is not None:
        raise AgonicError("--field belongs to DI-flux sheets; a gyrotheodolite needs none")
    made = describe_north(fit_north(read_north(session)))
    if out is not None and made.verdict != "refused" and made.calibration is None:
        raise AgonicError("-o needs an alignment: give [platform], [magnetometer] and [reference]")
    return finish(made, out=out, report=report, as_json=as_json)


def coil(
    session: Path,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """The axis of a coil in every known frame, its constant and linearity, from reversals.

    Options
    -------
    session <SESSION> : coil.toml, or the folder it is in.
    """
    from agonic.alignment.coil.fit import fit_coil
    from agonic.alignment.document import describe_coil
    from agonic.alignment.files.sessions import read_coil
    from agonic.console.finish import finish

    return finish(describe_coil(fit_coil(read_coil(session))), report=report, as_json=as_json)


def gravity(
    log: LogPath,
    out: Out = None,
    which: SensorChoice = SensorChoice(),
    calibration: Path | None = None,
    bias: bool = False,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """The rotation from magnetometer to accelerometer, from orientations at rest.

    Options
    -------
    calibration CAL : Calibration to apply first.
    bias --bias : Solve for the bias too.
    """
    from agonic.alignment.document import describe_gravity
    from agonic.alignment.gravity import fit_gravity
    from agonic.calibration.steps import require_calibration
    from agonic.console.finish import finish
    from agonic.files.calibration import load

    samples = open_sensor(log, *which, between)
    known = None if calibration is None else require_calibration(load(calibration))
    fit = fit_gravity(samples, known, bias=bias)
    return finish(describe_gravity(fit, samples.name), out=out, as_json=as_json)


def remanence(
    log: LogPath,
    reference: Path | None = None,
    wanted: Wanted = 2.0,
    which: SensorChoice = SensorChoice(),
    between: Between = None,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """The field of a platform itself: it is turned, the magnetometer stands still.

    The angle of the platform is the column heading_deg. Exit status 1 where its field is not
    negligible.

    Options
    -------
    reference LOG : A distant magnetometer; its changes are subtracted.
    """
    from agonic.alignment.document import describe_remanence
    from agonic.alignment.remanence import fit_remanence
    from agonic.console.finish import finish

    samples = open_sensor(log, *which, between, needed=_TURNED)
    beside = None if reference is None else open_sensor(reference, None, which.unit)
    fit = fit_remanence(samples, beside, wanted_arcsec=wanted)
    return finish(describe_remanence(fit), report=report, as_json=as_json)
