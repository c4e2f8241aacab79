"""`agonic heading SETUP LOG -o OUT`: true headings with their standard errors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console.options import At, Date, Json, LogPath, Mounting, Report, SensorChoice
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.calibration.setup import Setup
    from agonic.logs.log import Log
    from agonic.samples import Samples


def heading(
    setup: Path,
    log: LogPath,
    out: Path,
    which: SensorChoice = SensorChoice(),
    smooth: bool = True,
    mounting: Mounting = None,
    at: At = None,
    date: Date = None,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """Find the true heading of a vehicle at each reading, and where not to trust it.

    Writes the log's time, compass, magnetic and true heading, standard error, that of the tilt,
    disagreement between sensors, the sensor that was used, and flags. Exit status 1 where no
    heading can be trusted at all.

    Options
    -------
    setup <SETUP> : A setup (TOML), or a calibration file alone.
    out -o OUT : CSV file to write.
    smooth --smooth/--each-row : All rows together, by compass and gyro, where the log has a gyro
        that makes the standard error smaller; or each row by itself.
    """
    from contextlib import nullcontext

    from agonic.calibration.base import correct_field, has_two_axes
    from agonic.console.finish import finish, require_table
    from agonic.console.sensors import add_second
    from agonic.files.setup import load_setup
    from agonic.headings.compute import heading as compute
    from agonic.headings.document import describe_headings
    from agonic.headings.files.write_headings import write_headings
    from agonic.logs.log import allow_two_axes
    from agonic.logs.read import open_log

    require_table(out)
    vehicle = load_setup(setup)
    two = any(has_two_axes(compass.calibration) for compass in vehicle.compasses)
    with allow_two_axes() if two else nullcontext():
        recording = open_log(log, unit=which.unit)
    chosen, samples = pair_compasses(vehicle, recording, which.sensor)
    if mounting is not None:
        chosen = mount(chosen, samples[0], mounting)
    samples = tuple(
        set_place(add_second(compass.calibration, one, recording), at, date)
        for compass, one in zip(chosen.compasses, samples, strict=True)
    )
    found = compute(samples, chosen, smooth=smooth)
    assumed = []  # what was taken for granted because nobody said otherwise
    if at is not None and date is None and recording.sensors[0].epoch is None:
        assumed.append("the log has no date: the declination is today's; --date gives another")
    names = {one.name for one in recording.sensors}
    for compass, one in zip(chosen.compasses, samples, strict=True):
        if compass.sensor != one.name and not {compass.sensor, one.name} & {"mag"}:
            other = "" if compass.sensor in names else ", which the log does not name"
            assumed.append(f"{one.name} is read with the calibration of {compass.sensor}{other}")
    files = [write_headings(found, out)]
    field = correct_field(chosen.compasses[0].calibration, samples[0]) if report else None
    inputs = [
        *(one.source for one in samples),
        *(i for compass in chosen.compasses for i in compass.calibration.provenance.inputs),
    ]
    document = describe_headings(found, samples[0], field=field, notes=assumed, inputs=inputs)
    finish(document, files=files, report=report, as_json=as_json)
    return 0 if found.trusted.any() else 1


def pair_compasses(setup: Setup, log: Log, sensor: str | None) -> tuple[Setup, tuple[Samples, ...]]:
    """The compasses to use, and the samples of their sensors.

    A sensor that is asked for is used alone: by its own compass, or by the only one there is.
    """
    from dataclasses import replace

    names = [compass.sensor for compass in setup.compasses]
    if sensor is not None:
        samples = log.sensor(sensor)
        own = [compass for compass in setup.compasses if compass.sensor == samples.name]
        if not own and len(names) > 1:
            raise AgonicError(
                f"the setup has compasses for {', '.join(names)} and none for {samples.name}; "
                "name one of them with --sensor"
            )
        if not own and names[0] in {each.name for each in log.sensors}:
            raise AgonicError(
                f"the calibration is of {names[0]}, which {log.path.name} holds too, and "
                f"--sensor asks for {samples.name}: give the calibration of {samples.name}, or a "
                f'setup that says sensor = "{samples.name}"'
            )
        return replace(setup, compasses=tuple(own) or setup.compasses), (samples,)
    if len(names) == 1 and len(log.sensors) == 1:
        return setup, log.sensors
    there = {samples.name: samples for samples in log.sensors}
    if missing := [name for name in names if name not in there]:
        raise AgonicError(
            f"the setup has a compass for {', '.join(missing)} and {log.path.name} holds "
            f"{', '.join(there)}; choose one with --sensor"
        )
    return setup, tuple(there[name] for name in names)


def mount(setup: Setup, samples: Samples, mounting: str) -> Setup:
    """The setup whose one compass gives the field in body axes, its sensor sitting as said."""
    from dataclasses import replace

    from agonic.calibration.affine import Affine
    from agonic.calibration.interference import turn_field
    from agonic.console.parse import parse_mounting

    turn = parse_mounting(mounting)
    compass, *others = setup.compasses
    if others:
        raise AgonicError(
            "--mounting turns one sensor and the setup has more: choose one with --sensor, or "
            "calibrate each with its own (agonic calibrate --mounting)"
        )
    if "b" in (samples.frame, compass.calibration.frame_out):
        whose = "readings" if samples.frame == "b" else "calibration"
        raise AgonicError(
            f"the {whose} of {samples.name} gives body axes already: leave --mounting out"
        )
    if not isinstance(compass.calibration, Affine):
        raise AgonicError(
            f"--mounting turns an affine calibration and that of {compass.sensor} is "
            f"{compass.calibration.kind}: calibrate with the mounting (agonic calibrate --mounting)"
        )
    turned = replace(compass, calibration=turn_field(compass.calibration, turn))
    return replace(setup, compasses=(turned,))


def set_place(samples: Samples, at: str | None, date: str | None) -> Samples:
    """The samples at the place and date given on the command line; at a place without date, now."""
    from datetime import UTC, datetime

    import numpy as np

    from agonic.console.parse import parse_position
    from agonic.field.decimal_year import parse_date

    changed: dict[str, Any] = {}
    if date is not None:
        changed["epoch"] = parse_date(date)
    elif at is not None and samples.epoch is None:
        changed["epoch"] = datetime.now(UTC)
    if at is not None:
        columns = ("latitude_deg", "longitude_deg", "altitude_m")
        for name, value in zip(columns, parse_position(at), strict=True):
            changed[name] = np.full(len(samples), value)
    return samples.with_columns(**changed) if changed else samples
