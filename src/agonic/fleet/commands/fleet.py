"""`agonic fleet INPUT…`: many logs into one table."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console.options import Json, Place, SensorChoice
from agonic.fleet.engine import LONGEST_S, Dask, Here, Processes

if TYPE_CHECKING:
    from agonic.fleet.engine import Engine
    from agonic.fleet.run import Progress

FAIL_ABOVE = 0.0


def fleet(
    inputs: list[str],
    out: Path,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    method: str = "auto",
    name: str | None = None,
    sensor_column: str | None = None,
    files: bool = False,
    reports: bool = False,
    workers: int | None = None,
    timeout: float = LONGEST_S,
    engine: str | None = None,
    scheduler: str | None = None,
    store: Path | None = None,
    fail_above: float = FAIL_ABOVE,
    as_json: Json = False,
) -> int:
    """Calibrate every magnetometer of many logs into one table, without anyone watching.

    Writes fleet.parquet, a row for each sensor and log, and report.html. A bad log is a row with
    its reason and does not stop the run. Exit status 1 where any is refused.

    Options
    -------
    inputs <INPUT...> : Logs, folders of them, patterns in quotes: 'logs/**/*.ulg'.
    out -o DIR : Folder to write to; a run that was cut off goes on there.
    method : auto (by what each log holds), ellipsoid, levelled, inertial or vector.
    name REGEX : Name of a sensor: a group in the path of its log, '/(SN\\d+)_'.
    sensor_column NAME : Column that names the sensor in a Parquet dataset.
    files --files : Write the calibration file of each sensor and log.
    reports --reports : Write the folder of each log that calibrate writes.
    workers ≥0 : Processes; default: one for each processor.
    timeout SECONDS ≥1.0 : Longest that one log may take in its process; then it is a row that says
        so.
    engine : local (default), or dask: its own cluster of --workers.
    scheduler ADDRESS : A Dask scheduler that runs: tcp://host:8786.
    store STORE : Keep the calibrations in this history as well.
    fail_above SHARE ≥0.0 ≤1.0 : Exit status 1 where more than this share is refused; 0: any.
    """
    from agonic.console.output import print_json, say
    from agonic.console.parse import parse_position
    from agonic.fleet.document import describe_run
    from agonic.fleet.run import run_fleet
    from agonic.fleet.settings import FleetSettings

    settings = FleetSettings(
        unit=which.unit,
        at=parse_position(place.at) if place.at else None,
        date=place.date,
        field_nT=place.field,
        method=method,
        sensor=which.sensor,
        name=name,
        sensor_column=sensor_column,
        files=files,
        reports=reports,
    )
    chosen = _choose_engine(engine, scheduler, workers, timeout)
    with _interruptible() as progress:
        run = run_fleet(
            inputs, out, settings=settings, engine=chosen, store=store, progress=progress
        )
    made = describe_run(run)
    if as_json:
        print_json(made.schema, made.to_record())
    else:
        say(made.to_text())
        say(f"\nTable     {run.table}\nReport    {run.page}")
    failed = int((~run.population.fitted).sum())
    return 1 if failed > fail_above * len(run.population) else 0


def _choose_engine(
    engine: str | None, scheduler: str | None, workers: int | None, longest_s: float
) -> Engine:
    from agonic.errors import AgonicError, check_choice

    check_choice("--engine", engine or "local", ("local", "dask"))
    if scheduler is not None and engine == "local":
        raise AgonicError("--scheduler is for the engine dask, not for local")
    if engine == "dask" or scheduler is not None:
        return Dask(scheduler=scheduler, workers=workers, longest_s=longest_s)
    return Here() if workers == 0 else Processes(workers, longest_s)


@contextmanager
def _interruptible() -> Iterator[Any]:
    """Progress on a terminal; an interruption is told as what it costs, which is nothing. What
    interrupts is noted, for a library may lose the `KeyboardInterrupt` or make another error of
    it."""
    from agonic.console.progress import paced
    from agonic.errors import AgonicError

    interrupted = False

    def interrupt(*_: object) -> None:
        nonlocal interrupted
        interrupted = True
        raise KeyboardInterrupt

    def tell(progress: Progress) -> None:
        if interrupted:
            raise KeyboardInterrupt
        show(progress.done, progress.logs, progress.resumed, progress.stage)

    before = _handle((signal.SIGINT, signal.SIGTERM), interrupt)
    try:
        with paced("Calibrating", "logs") as show:
            yield tell
    except BaseException as error:
        if interrupted or isinstance(error, KeyboardInterrupt):
            raise AgonicError(
                "interrupted; the same command goes on from where it was, with the same -o"
            ) from None
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _handle(
    numbers: Iterable[signal.Signals], handler: Callable[..., None]
) -> dict[signal.Signals, Any]:
    """Handle these signals, but for those that are ignored; returns what handled them before."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    before = {number: signal.getsignal(number) or signal.SIG_DFL for number in numbers}
    before = {number: old for number, old in before.items() if old is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, handler)
    return before
