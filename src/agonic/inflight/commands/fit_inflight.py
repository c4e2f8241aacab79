"""`agonic fit inflight LOG`: a calibration against the world model, in flight and in orbit."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import typer

from agonic.console import options
from agonic.console.parse import parse_count, parse_numbers
from agonic.console.sensors import open_sensor

MOST_ROWS = 2_000_000
"""Rows of a Parquet table from which it is read piece by piece."""


_IN_MEMORY = ("--model", "--altitude", "--tle", "--at", "--between", "--within", "--attitude")
"""Options of a record that is read as a whole."""


def inflight(
    context: typer.Context,
    logs: list[Path],
    out: options.Out = None,
    ground: Path | None = None,
    solve: str | None = None,
    knots: str = "auto",
    latitudes: str | None = None,
    scalar: options.Scalar = None,
    attitude: str = "none",
    temperature: int = 0,
    matrix_rate: bool = False,
    sources: str = "",
    within: float | None = None,
    which: options.SensorChoice = options.SensorChoice(),
    at: options.At = None,
    date: options.Date = None,
    model: options.WorldModel = None,
    altitude: options.Altitude = None,
    tle: options.Elements = None,
    gain_sd: float = 0.01,
    robust: options.Robust = True,
    between: options.Between = None,
    report: options.Report = None,
    as_json: options.Json = False,
) -> int:
    """Bias, gains or all nine numbers from the known field along the track.

    Options
    -------
    logs <LOG...> : A recording; or the files of a mission in order of time, read piece by piece.
    ground CAL : The calibration made on the ground; it is brought up to date.
    solve : bias, gains or full; default: bias with --ground, full without.
    knots : Intervals of the bias in time: a number, or auto.
    latitudes LOW,HIGH : Use readings between these only.
    attitude : none; logged (aided by roll, pitch, heading in the log); nadir (one side kept to the
        Earth, attitude from the track).
    temperature ORDER : Polynomials in temperature up to this order.
    matrix_rate --matrix-rate : Let the matrix change linearly with time.
    sources --with NAMES : What disturbs on board: current_A and the like.
    within NT : Leave out readings farther off than this.
    gain_sd : Expected change of the gains since the ground, a share.
    """
    from agonic.calibration.steps import require_calibration
    from agonic.console.finish import finish, is_folder
    from agonic.console.place import find_reference, find_scalar_reference, set_track
    from agonic.console.progress import counting
    from agonic.errors import AgonicError
    from agonic.field.decimal_year import parse_date
    from agonic.files.calibration import load
    from agonic.inflight.fit import fit_inflight, fit_mission
    from agonic.inflight.report.document import describe_inflight
    from agonic.logs.large.mission import is_long, open_mission

    if report is None and out is not None and not is_folder(out):
        report = out.with_suffix(".html")
    if sys.stderr.isatty():
        kept = " and ".join(str(file) for file in (out, report) if file is not None)
        said = f"{kept} will be written" if kept else "-o FOLDER keeps the result; it is shown only"
        print(f"agonic: {said}", file=sys.stderr)
    low_high = "LOW,HIGH in degrees"
    interval = None if latitudes is None else parse_numbers("--latitudes", latitudes, low_high)
    settings: dict[str, Any] = {
        "ground": None if ground is None else require_calibration(load(ground)),
        "solve": solve,
        "drift_knots": parse_count("--knots", knots, "a number of intervals"),
        "latitude_deg": interval,
        "temperature_degree": temperature,
        "matrix_rate": matrix_rate,
        "sources": tuple(name for name in sources.replace(",", " ").split() if name),
        "gain_sd": gain_sd,
        "robust": robust,
    }
    if is_long(logs, MOST_ROWS):
        unfit = [name for name in _IN_MEMORY if name in options.list_typed_options(context)]
        if unfit:
            raise AgonicError(f"a mission is read piece by piece, without {', '.join(unfit)}")
        mission, samples = open_mission(logs, sensor=which.sensor, unit=which.unit, date=date), None
        if scalar is None:
            scalar = next(mission.pieces()).scalar is not None
        with counting(mission.rows) as progress:
            fit = fit_mission(mission, scalar=scalar, progress=progress, **settings)
    else:
        more: dict[str, Any] = {"attitude": attitude, "residual_limit": within}
        samples = open_sensor(logs[0], *which, between)
        if date is not None and samples.epoch is None:
            samples = samples.with_columns(epoch=parse_date(date))
        samples = set_track(samples, altitude, tle)
        reference = find_scalar_reference(samples, scalar)
        reference = reference or find_reference(samples, at, date, None, model)[0]
        fit = fit_inflight(samples, reference, **settings, **more)
    document = describe_inflight(fit, samples, title=logs[0].name)
    return finish(document, out=out, report=report, as_json=as_json)
