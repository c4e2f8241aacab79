"""`agonic verify CAL LOG`: named checks on other data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agonic.console.options import CalibrationPath, Json, LogPath, Place, SensorChoice

if TYPE_CHECKING:
    from agonic.verification import Check


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
    b and a matrix A as text, JSON or .mat; their equation is found with the log and reported.

    Options
    -------
    out -o CAL : Keep what another program made as a calibration.
    against CAL : Compare with this calibration, also one of another program.
    """
    from dataclasses import asdict

    from agonic.cli.calibration_and_log import open_calibration_and_log, set_against
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
