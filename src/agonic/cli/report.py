"""`agonic report CAL [LOG]`: the page for a calibration file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agonic.console.options import At, CalibrationPath, Date, Json, Magnitude, Sensor, Unit
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.calibration.base import Calibration
    from agonic.calibration.network import Network
    from agonic.calibration.thermal import Thermal


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("report")(report)


def report(
    cal: CalibrationPath,
    log: Annotated[
        Path | None,
        typer.Argument(metavar="[LOG]", help="Readings; default: the log it was made from."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="HTML", help="Page; default beside CAL.")
    ] = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    field: Magnitude = None,
    as_json: Json = False,
) -> int:
    """Show what a calibration does to a log: spheres, residuals, checks, provenance.

    One over temperature, or a network, is shown without a log too: its numbers and range.
    """
    from agonic.atomic import write_atomically
    from agonic.calibration.chain import find_step, require_calibration
    from agonic.calibration.network import Network
    from agonic.calibration.thermal import Thermal
    from agonic.console.output import print_json, say
    from agonic.console.place import find_reference
    from agonic.files.calibration import load
    from agonic.recording.calibrated import judge
    from agonic.recording.calibration_and_log import open_calibration_and_log
    from agonic.recording.report.page import render
    from agonic.recording.report.record import record

    given = require_calibration(load(cal))
    network = find_step(given, Network)
    if network is not None:
        return _network(given, network, cal, log, out, sensor, unit, at, date, field, as_json)
    thermal = find_step(given, Thermal)
    if thermal is not None:
        return _thermal(given, thermal, cal, log, out, sensor, unit, at, date, field, as_json)
    calibration, samples = open_calibration_and_log(cal, log or own_log(cal), sensor, unit)
    reference, settings = find_reference(samples, at, date, field)
    result = judge(calibration, samples, reference, **settings)
    path = write_atomically(
        out or cal.with_suffix(".html"), render([result], title=f"{cal.name} on {samples.name}")
    )
    if as_json:
        print_json("agonic/report@1", record(result, [str(path)]))
    else:
        say(f"Report    {path}")
    return 0 if result.verdict == "good" else 1


def _thermal(
    calibration: Calibration,
    thermal: Thermal,
    cal: Path,
    log: Path | None,
    out: Path | None,
    sensor: str | None,
    unit: str | None,
    at: str | None,
    date: str | None,
    field: float | None,
    as_json: bool,
) -> int:
    """The page of a calibration over temperature; with a log also what it does to it."""
    from dataclasses import asdict

    from agonic.atomic import write_atomically
    from agonic.console.output import print_json, say
    from agonic.console.place import find_reference
    from agonic.recording.calibration_and_log import open_calibration_and_log
    from agonic.thermal.calibration_document import describe_calibration
    from agonic.verification import verify

    samples, verification = None, None
    if log is not None:
        _, samples = open_calibration_and_log(cal, log, sensor, unit)
        reference, _ = find_reference(samples, at, date, field)
        known = reference if calibration.unit_out == "nT" else None
        verification = verify(calibration, samples, known)
    title = cal.name if samples is None else f"{cal.name} on {samples.name}"
    document = describe_calibration(
        calibration, thermal, title=title, samples=samples, verification=verification
    )
    path = write_atomically(out or cal.with_suffix(".html"), document.to_html())
    good = verification is None or verification.passed
    if as_json:
        checks = [] if verification is None else [asdict(c) for c in verification.checks]
        print_json(
            "agonic/report@1",
            {
                "sensor": calibration.sensor,
                "method": "thermal",
                "verdict": "good" if good else "check",
                "checks": checks,
                "range_C": thermal.validity.temperature_C,
                "degree": thermal.degree,
                "files": [str(path)],
            },
        )
    else:
        say(f"Report    {path}")
    return 0 if good else 1


def _network(
    calibration: Calibration,
    network: Network,
    cal: Path,
    log: Path | None,
    out: Path | None,
    sensor: str | None,
    unit: str | None,
    at: str | None,
    date: str | None,
    field: float | None,
    as_json: bool,
) -> int:
    """The page of a network; with a log also what it does to it, and where it is guarded."""
    from dataclasses import asdict

    from agonic.atomic import write_atomically
    from agonic.console.output import print_json, say
    from agonic.console.place import find_reference
    from agonic.network.report.document import describe_network_file
    from agonic.recording.calibration_and_log import open_calibration_and_log
    from agonic.verification import verify

    samples, verification = None, None
    if log is not None:
        _, samples = open_calibration_and_log(cal, log, sensor, unit)
        reference, _ = find_reference(samples, at, date, field)
        verification = verify(calibration, samples, reference)
    title = cal.name if samples is None else f"{cal.name} on {samples.name}"
    document = describe_network_file(
        calibration, network, title=title, samples=samples, verification=verification
    )
    path = write_atomically(out or cal.with_suffix(".html"), document.to_html())
    good = verification is None or verification.passed
    if as_json:
        checks = [] if verification is None else [asdict(c) for c in verification.checks]
        print_json(
            "agonic/report@1",
            {
                "sensor": calibration.sensor,
                "method": "network",
                "verdict": "good" if good else "check",
                "checks": checks,
                "hidden": network.shape.hidden,
                "target": network.target,
                "files": [str(path)],
            },
        )
    else:
        say(f"Report    {path}")
    return 0 if good else 1


def own_log(cal: Path) -> Path:
    """The log that a calibration was made from, where it still lies nearby unchanged."""
    from agonic.files.calibration import load
    from agonic.provenance import hash_file

    inputs = load(cal).provenance.inputs
    for given in inputs:
        for folder in (cal.parent, cal.parent.parent, Path()):
            path = folder / given.name
            if path.is_file() and hash_file(path) == given.sha256:
                return path
    names = ", ".join(given.name for given in inputs) or "its log"
    raise AgonicError(f"{names} is not beside {cal}; name the log: agonic report {cal} LOG")
