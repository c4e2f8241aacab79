"""`agonic heading SETUP LOG -o OUT`: true headings with their standard errors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import At, Date, Json, LogPath, Sensor, Unit
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.calibration.setup import Setup
    from agonic.headings.result import Heading
    from agonic.logs.log import Log
    from agonic.samples import Samples

COLUMNS = (
    "time_s",
    "elapsed_s",
    "compass_deg",
    "magnetic_deg",
    "true_deg",
    "sd_deg",
    "tilt_sd_deg",
    "disagreement_deg",
    "sensor",
    "flags",
)
"""Of the table that is written."""


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("heading")(heading)


def heading(
    setup: Annotated[
        Path, typer.Argument(metavar="SETUP", help="A setup (TOML), or a calibration file alone.")
    ],
    log: LogPath,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="OUT", help="CSV file to write.")],
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    as_json: Json = False,
) -> int:
    """Find the true heading of a vehicle at each reading, and where not to trust it.

    Writes the log's time and the seconds since the first reading, compass, magnetic and true
    heading, standard error, that of the tilt, disagreement between sensors, the sensor that was
    used, and flags. Exit status 1 where no heading can be trusted at all.
    """
    from agonic.atomic import write_atomically
    from agonic.console.output import print_json, say
    from agonic.console.sensors import add_second
    from agonic.files.setup import load_setup
    from agonic.headings.compute import heading as find
    from agonic.logs.read import open_log

    recording = open_log(log, unit=unit)
    chosen, samples = paired(load_setup(setup), recording, sensor)
    samples = tuple(
        placed(add_second(compass.calibration, one, recording), at, date)
        for compass, one in zip(chosen.compasses, samples, strict=True)
    )
    found = find(samples, chosen)
    said = summary(found, samples[0])
    said["notes"] = (*said["notes"], *_assumed(chosen, recording, samples, at, date))
    write_atomically(out, table(found))
    if as_json:
        print_json("agonic/heading@1", {**said, "files": [str(out)]})
    else:
        say("\n".join([*sentences(said), f"Written   {out}"]))
    return 0 if found.trusted.any() else 1


def _assumed(
    setup: Setup, log: Log, samples: tuple[Samples, ...], at: str | None, date: str | None
) -> list[str]:
    """What was taken for granted because nobody said otherwise, in sentences."""
    notes = []
    if at is not None and date is None and log.sensors[0].epoch is None:
        notes.append("the log has no date: the declination is today's; --date gives another")
    names = {one.name for one in log.sensors}
    for compass, one in zip(setup.compasses, samples, strict=True):
        if compass.sensor != one.name and not {compass.sensor, one.name} & {"mag"}:
            other = "" if compass.sensor in names else ", which the log does not name"
            notes.append(f"{one.name} is read with the calibration of {compass.sensor}{other}")
    return notes


def paired(setup: Setup, log: Log, sensor: str | None) -> tuple[Setup, tuple[Samples, ...]]:
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


def placed(samples: Samples, at: str | None, date: str | None) -> Samples:
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


def table(found: Heading) -> str:
    """The headings as CSV; a number that there is not is left empty."""
    import csv
    from io import StringIO

    import numpy as np

    def written(values: Any, digits: int) -> list[str]:
        if values is None:
            return [""] * len(found)
        return ["" if np.isnan(v) else f"{v:.{digits}f}" for v in values.tolist()]

    def angles(values: Any) -> list[str]:  # rounding must not make 360
        return written(None if values is None else np.round(values, 3) % 360.0, 3)

    columns = (
        [""] * len(found) if found.time is None else [repr(t) for t in found.time.tolist()],
        written(None if found.time is None else found.time - found.time[0], 6),
        angles(found.compass_deg),
        angles(found.magnetic_deg),
        angles(found.true_deg),
        written(found.sd_deg, 3),
        written(found.tilt_sd_deg, 3),
        written(found.disagreement_deg, 3),
        [found.sensors[k] for k in found.used.tolist()],
        found.flag_names(),
    )
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(zip(*columns, strict=True))
    return stream.getvalue()


def summary(found: Heading, samples: Samples) -> dict[str, Any]:
    """What there is to say about the headings as a whole."""
    import numpy as np

    good = found.trusted

    def middle(values: Any) -> float | None:
        return float(np.median(values[good])) if values is not None and good.any() else None

    return {
        "sensors": found.sensors,
        "n": len(found),
        "trusted": int(good.sum()),
        "tilt": found.tilt,
        "tilt_sd_deg": middle(found.tilt_sd_deg),
        "declination_deg": float(np.median(found.declination_deg)),
        "sd_deg": middle(found.sd_deg),
        "random_sd_deg": middle(found.random_sd_deg),
        "flagged": {name: int(rows.sum()) for name, rows in found.flags.items() if rows.any()},
        "used": {name: int((found.used == k).sum()) for k, name in enumerate(found.sensors)},
        "disagreement_deg": _rms(found.disagreement_deg, good),
        "against_log": _against(found, samples, good),
        "notes": found.notes,
    }


def _rms(values: Any, rows: Any) -> float | None:
    import numpy as np

    if values is None:
        return None
    known = values[rows & np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else None


def _against(found: Heading, samples: Samples, rows: Any) -> dict[str, float] | None:
    """Mean and rms of true − logged heading over trusted rows, where the log has a heading."""
    import numpy as np

    from agonic.maths.rotations.angles import wrap_deg

    if samples.heading_deg is None or not rows.any():
        return None
    difference = wrap_deg(found.true_deg - samples.heading_deg)[rows]
    return {
        "mean_deg": float(np.mean(difference)),
        "rms_deg": float(np.sqrt(np.mean(difference**2))),
    }


def sentences(said: dict[str, Any]) -> list[str]:
    """The summary for people."""
    n = said["n"]
    lines = [
        f"Headings  {n} of {', '.join(said['sensors'])}, {said['trusted']} to trust; "
        f"tilt: {said['tilt']}; declination {said['declination_deg']:.2f}°"
    ]
    if said["sd_deg"] is not None:
        lines.append(
            f"Sd        {said['sd_deg']:.2f}° in the middle, of which {said['random_sd_deg']:.2f}° "
            f"is new in every reading; tilt to {said['tilt_sd_deg']:.2f}°"
        )
    for name, rows in said["flagged"].items():
        lines.append(f"Flagged   {100 * rows / n:.1f} % {name}")
    if said["disagreement_deg"] is not None:
        shares = ", ".join(f"{name} {100 * rows / n:.0f} %" for name, rows in said["used"].items())
        lines.append(f"Sensors   differ by {said['disagreement_deg']:.2f}° rms; used: {shares}")
    if (against := said["against_log"]) is not None:
        lines.append(
            f"Logged    true − logged heading: mean {against['mean_deg']:+.2f}°, "
            f"rms {against['rms_deg']:.2f}°"
        )
    return [*lines, *(f"Note      {note}" for note in said["notes"])]
