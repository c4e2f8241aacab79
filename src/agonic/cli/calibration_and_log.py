"""`agonic apply CAL LOG` and `agonic verify CAL LOG`: the commands of a calibration and a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agonic.attitude.delay import remove_delay
from agonic.calibration.base import Calibration
from agonic.calibration.steps import compose, require_calibration
from agonic.console.options import CalibrationPath, Json, LogPath, Place, SensorChoice
from agonic.console.sensors import add_second, choose_name
from agonic.errors import UnitError
from agonic.files.calibration import load
from agonic.files.foreign import understand
from agonic.files.foreign_forms import is_foreign, read_foreign
from agonic.logs.read import open_log
from agonic.samples import Logged, Samples

if TYPE_CHECKING:
    from agonic.verification import Check


def open_calibration_and_log(
    cal: Path, log: Path, sensor: str | None, unit: str | None
) -> tuple[Calibration, Samples]:
    """The calibration, and the log's sensor of that name, or the one asked for, or its only one.

    The samples come with the second magnetometer where the calibration mixes one, and each with
    the moment it was measured at where the calibration knows how late the readings are. One that
    another program made is read as the log shows that it is meant.
    """
    foreign = is_foreign(cal)
    calibration = None if foreign else require_calibration(load(cal))
    if foreign:
        read_foreign(cal)  # what it is not is the first thing to know
    recording = open_log(log, unit=unit)
    if calibration is None:
        names = (one.name for one in recording.sensors)
        samples = recording.sensor(choose_name(names) if sensor is None else sensor)
        return understand(cal, samples).calibration, samples
    if sensor is None:
        names = (samples.name for samples in recording.sensors)
        sensor = choose_name(names, calibration.sensor)
    samples = add_second(calibration, recording.sensor(sensor), recording)
    return calibration, remove_delay(calibration, samples)


def set_against(samples: Samples, old: Path) -> Samples:
    """The samples beside another calibration, also one of another program, to compare with."""
    foreign = is_foreign(old)
    one = understand(old, samples).calibration if foreign else require_calibration(load(old))
    whole = compose(one)
    if whole.unit_in != samples.unit:
        raise UnitError(
            f"{old.name} takes readings in {whole.unit_in} and {samples.name} is in {samples.unit}"
        )
    known = Logged(bias=whole.bias, matrix=whole.matrix, source=old.name)
    return samples.with_columns(logged=known)


def apply(
    cal: CalibrationPath,
    log: LogPath,
    out: Path,
    which: SensorChoice = SensorChoice(),
    as_json: Json = False,
) -> int:
    """Correct a log's readings and write them with everything recorded beside them.

    Options
    -------
    out -o OUT : Table to write, .csv or .parquet.
    """
    from agonic.atomic import write_atomically
    from agonic.calibration.base import apply as correct
    from agonic.console.finish import require_table
    from agonic.console.output import finish_made
    from agonic.exports.csv import make_table, write_csv
    from agonic.exports.parquet import make_parquet

    as_parquet = out.suffix.lower() == ".parquet"
    calibration, samples = open_calibration_and_log(cal, log, *which)
    if not as_parquet:
        require_table(out)
    corrected = correct(calibration, samples)
    if as_parquet:
        write_atomically(out, make_parquet(make_table(corrected)))
    else:
        write_csv(corrected, out)
    record = {"sensor": corrected.name, "n": len(corrected), "unit": corrected.unit, "files": [out]}
    return finish_made(
        len(corrected),
        f"corrected readings of {corrected.name}",
        out,
        record=record,
        as_json=as_json,
        schema="agonic/apply@1",
    )


def verify(
    cal: CalibrationPath,
    log: LogPath,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    out: Path | None = None,
    against: Path | None = None,
    as_json: Json = False,
) -> int:
    """Check a calibration on a log. Exit status 1 where a check failed.

    CAL may be of another program: parameters of ArduPilot or PX4, MotionCal's packet, or a vector
    b and a matrix A as text, JSON or .mat; how they are meant is found on the log and said.

    Options
    -------
    out -o CAL : Keep what another program made as a calibration.
    against CAL : Compare with this calibration, also one of another program.
    """
    from dataclasses import asdict

    from agonic.console.output import print_json, say
    from agonic.console.place import find_reference
    from agonic.files.calibration import save
    from agonic.verification import verify as check

    calibration, samples = open_calibration_and_log(cal, log, *which)
    read_as = calibration.provenance.settings.get("read_as")
    files = [] if out is None else [str(save(calibration, out))]
    if against is not None:
        samples = set_against(samples, against)
    reference, _ = find_reference(samples, *place)
    if calibration.unit_out != "nT":
        reference = None
    verification = check(calibration, samples, reference)
    own = samples.source is not None and any(
        given.sha256 == samples.source.sha256 for given in calibration.provenance.inputs
    )
    if as_json:
        print_json(
            "agonic/verify@1",
            {
                "sensor": samples.name,
                "verdict": "good" if verification.passed else "check",
                "own_data": own,
                "read_as": read_as,
                "files": files,
                "spread_before": verification.spread_before,
                "spread_after": verification.spread_after,
                "checks": [asdict(check) for check in verification.checks],
            },
        )
    else:
        if read_as is not None:
            say(f"Read as {read_as}\n")
        say("\n".join(_line(c) for c in verification.checks))
        if files:
            say(f"\nWritten   {files[0]}")
        if own:
            say("Note: this is the log that the calibration was made from; use another to be sure.")
    return 0 if verification.passed else 1


def _line(check: Check) -> str:
    from agonic.report.tables import state_check

    mark = {True: "✓", False: "✗", None: "·"}[check.passed]
    return f"{mark} {state_check(check)}; {check.meaning}"
