"""`agonic export CAL --to TARGET`: a calibration, or a setup, for an autopilot or firmware."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Date, Json
from agonic.errors import AgonicError
from agonic.exports.targets import (
    TARGETS,
    USE,
    compass_number,
    find_target,
    list_words,
    write_vehicle,
)
from agonic.exports.targets import write as write_target

if TYPE_CHECKING:
    from agonic.calibration.setup import Setup
    from agonic.exports.convert import Export
    from agonic.exports.firmware import DeclinationGrid


def export(
    cal: Path,
    to: Annotated[str, typer.Option("--to", help=f"{list_words(list(TARGETS), 'or')}.")],
    out: Path | None = None,
    number: int | None = None,
    device_id: int | None = None,
    on: Path | None = None,
    temperature: float | None = None,
    voltage: float | None = None,
    whole: bool = False,
    name: str | None = None,
    declination: float | None = None,
    at: str | None = None,
    box: str | None = None,
    tolerance: float = 0.1,
    date: Date = None,
    window: int | None = None,
    layout: str | None = None,
    as_json: Json = False,
) -> int:
    """Write a calibration in another program's own form, with what that form cannot hold.

    A setup file (TOML) becomes firmware: C for the whole chain from readings to true heading; the
    state file of agonic track becomes C that continues on board. A calibration that changes with
    temperature is written whole where the target can hold it; for the others --temperature says at
    which temperature.

    Options
    -------
    cal <CAL|SETUP|TRACK> : A calibration file, or for c a setup or a track file.
    out -o PATH : File, or folder; default beside CAL.
    number ≥1 ≤4 : Which compass of the vehicle, from 1; default: by the sensor's name.
    device_id : PX4 device id; default: the calibration's own.
    on OLD : Parameters that had corrected the readings when CAL's log was recorded.
    temperature C : At which to evaluate a calibration that changes with temperature; for px4 TREF.
    voltage V : ardupilot: battery voltage, for the terms of each motor.
    whole --whole : c: compute the heading as well, also for a CAL alone.
    name : c: what the names start with; default: the sensor's, or compass.
    declination : c: degrees, east positive; default: the setup's own.
    at LAT,LON[,ALT] : c: declination and field of the model there.
    box S,N,W,E : c: a table of the model's declination, degrees.
    tolerance DEG : c: largest error of that table against the model.
    window ROWS : c: train the network on board, on this many readings.
    layout --as arduino : c: a library for Arduino and PlatformIO.
    """
    from agonic.exports.firmware import write_firmware
    from agonic.files.foreign_forms import is_foreign
    from agonic.files.setup import load_setup
    from agonic.logs.contents import read_bytes

    library = _choose_library(layout, to, out or cal.with_suffix(""))
    out = out if library is None else library / "src"
    content = read_bytes(cal).lstrip()
    is_setup = not content.startswith(b"{") and not is_foreign(cal)
    if is_setup and to in USE and not whole:
        written = _export_vehicle(cal, to, out)
        _report(written, (written.path,), as_json)
        return 0
    if (is_setup or whole) and to != "c":
        raise AgonicError(
            f"{to} takes one calibration and not a setup; export the calibration files that the "
            "setup names, one by one"
        )
    if content.startswith(b'{"schema":"agonic/track-state@'):
        written = _export_track(cal, to, out, name)
    elif window is not None:
        written = _export_training(cal, to, out, name, window)
    elif is_setup or whole:
        if temperature is not None:
            raise AgonicError(
                "firmware is given the temperature at each reading; --temperature is for targets "
                "that hold one calibration"
            )
        setup, source = _place_setup(load_setup(cal), declination, at, box, tolerance, date)
        prefix = "compass" if name is None else name
        written = write_firmware(setup, out or cal.with_suffix(""), name=prefix, declination=source)
    else:
        options = {"number": number, "device_id": device_id, "temperature_C": temperature}
        options["voltage_V"] = voltage
        written = _export_calibration(cal, on, to, out, name, library is not None, options)
    files: tuple[Path, ...] = getattr(written, "files", (written.path,))
    if library is not None:
        from agonic.exports.firmware.arduino import write_library

        files = write_library(library, files)
    _report(written, files, as_json)
    return 0


def _choose_library(layout: str | None, to: str, folder: Path) -> Path | None:
    """The folder of the library, where one is asked for."""
    if layout is None:
        return None
    if layout != "arduino" or to != "c":
        raise AgonicError(
            f"--as {layout} with --to {to}: the only layout is --as arduino, and it is for c"
        )
    return folder


def _export_vehicle(setup: Path, to: str, out: Path | None) -> Export:
    """All compasses of a setup in one file of parameters."""
    from agonic.files.setup import load_setup

    held = load_setup(setup).compasses
    path = out or setup.with_suffix(TARGETS[to].suffix)
    written = write_vehicle(to, {one.sensor: one.calibration for one in held}, path)
    cards = [one.sensor for one in held if one.deviation is not None]
    left = f"the deviation card of {', '.join(cards)} is left out: {to} has no place for one"
    return replace(written, warnings=(*written.warnings, left)) if cards else written


def _export_calibration(
    cal: Path,
    on: Path | None,
    to: str,
    out: Path | None,
    name: str | None,
    in_library: bool,
    options: dict[str, Any],
) -> Export:
    """A calibration file in the form of the target."""
    from agonic.calibration.steps import compose, require_calibration
    from agonic.exports.convert import add_to
    from agonic.exports.firmware.c_text import make_c_name
    from agonic.files.calibration import load
    from agonic.files.foreign import read_plain
    from agonic.files.foreign_forms import is_foreign

    number = options["number"]
    calibration = read_plain(cal, number) if is_foreign(cal) else require_calibration(load(cal))
    if on is not None:
        which = compass_number(calibration.sensor) if number is None else number
        old = read_plain(on, which) if is_foreign(on) else compose(require_calibration(load(on)))
        calibration = add_to(old, calibration)
    path = out or cal.with_suffix(find_target(to).suffix)
    if in_library:
        path /= f"{make_c_name(calibration.sensor) if name is None else name}.h"
        path.parent.mkdir(parents=True, exist_ok=True)
    return write_target(to, calibration, path, name=name, **options)


def _export_track(state: Path, to: str, out: Path | None, name: str | None) -> Export:
    """What goes on following a calibration; other targets hold the calibration of a moment."""
    from agonic.exports.firmware.tracker import write_tracker
    from agonic.inflight.tracking import Tracker

    if to != "c":
        raise AgonicError(
            f"{to} cannot follow a calibration; use --to c, or save the calibration of this "
            "moment (Tracker.resume(...).calibration) and export that"
        )
    tracker = Tracker.resume(state)
    return write_tracker(tracker.params, tracker.state, out or state.with_suffix(""), name=name)


def _export_training(cal: Path, to: str, out: Path | None, name: str | None, window: int) -> Export:
    """What trains a network on the controller."""
    from agonic.calibration.steps import require_calibration
    from agonic.exports.firmware.training import write_training
    from agonic.files.calibration import load

    if to != "c":
        raise AgonicError(f"{to} cannot train a network; --window is for c")
    calibration = require_calibration(load(cal))
    return write_training(calibration, out or cal.with_suffix(""), window=window, name=name)


def _place_setup(
    setup: Setup,
    declination: float | None,
    at: str | None,
    box: str | None,
    tolerance: float,
    date: str | None,
) -> tuple[Setup, float | DeclinationGrid | None]:
    """The setup with the field to expect, and where the controller has its declination from."""
    from datetime import UTC, datetime

    from agonic.console.parse import parse_numbers, parse_position
    from agonic.exports.firmware import declination_grid
    from agonic.field.decimal_year import decimal_year
    from agonic.field.place import choose_model

    if declination is not None and not abs(declination) <= 180.0:
        raise AgonicError(f"--declination {declination:g} must lie within ±180°, east positive")
    if sum(choice is not None for choice in (declination, at, box)) > 1:
        raise AgonicError("--declination, --at and --box exclude each other; give one of them")
    when = date or datetime.now(UTC).date().isoformat()
    if box is not None:
        south, north, west, east = parse_numbers("--box", box, "S,N,W,E in degrees")
        return setup, declination_grid((south, north), (west, east), when, tolerance_deg=tolerance)
    if at is None:
        return setup, declination
    here = choose_model(float(decimal_year(when))).at(*parse_position(at), when)
    if setup.horizontal is None:
        setup = replace(setup, horizontal=float(here.horizontal), vertical=float(here.down))
    return setup, float(here.declination_deg)


def _report(written: Export, paths: tuple[Path, ...], as_json: bool) -> None:
    """Say what was written and how large it is."""
    from dataclasses import asdict

    from agonic.console.output import print_json, say
    from agonic.exports.firmware import Firmware

    firmware = written if isinstance(written, Firmware) else None
    files = [str(file) for file in paths]
    sizes = firmware.sizes if firmware else {}
    if as_json:
        values: dict[str, Any] = {
            "target": written.target,
            "files": files,
            "warnings": written.warnings,
        }
        if firmware:
            values["constants"] = firmware.constants
            values["sizes"] = {name: asdict(size) for name, size in sizes.items()}
        print_json("agonic/export@1", values)
        return
    for file in files:
        say(f"Written   {file}")
    for name, size in sizes.items():
        say(
            f"Size      {name}: {size.code} bytes of code, {size.constants} of constants, "
            f"{size.variables} of variables ({size.compiler})"
        )
    if firmware and not sizes:
        say(f"Size      {firmware.constants} float constants; no compiler here to measure the code")
    for warning in written.warnings:
        say(f"Warning   {warning}")
