"""`agonic apply CAL LOG -o OUT`: the corrected field as a table."""

from __future__ import annotations

from pathlib import Path

from agonic.console.options import CalibrationPath, Json, LogPath, SensorChoice


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
    from agonic.cli.calibration_and_log import open_calibration_and_log
    from agonic.console.finish import require_table
    from agonic.console.output import finish_made
    from agonic.exports.csv import make_parquet, make_table, write_csv

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
