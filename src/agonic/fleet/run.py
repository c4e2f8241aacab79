"""`calibrate_fleet`: many logs into one table, which goes on where it was cut off."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from agonic.atomic import check_target, make_folder, write_atomically
from agonic.fleet.document import describe_population
from agonic.fleet.engine import Engine
from agonic.fleet.inputs import JOURNAL, PAGE, TABLE, find_inputs
from agonic.fleet.journal import Journal
from agonic.fleet.local import Processes
from agonic.fleet.result import FleetRun
from agonic.fleet.settings import FleetSettings
from agonic.fleet.work import Progress, Work
from agonic.population import (
    Compared,
    History,
    Population,
    compare,
    write_population,
)


def calibrate_fleet(
    inputs: Iterable[Path | str],
    out: Path | str,
    *,
    settings: FleetSettings | None = None,
    engine: Engine | None = None,
    store: Path | str | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Population:
    """Calibrate every magnetometer of many logs; a bad log is a row with its reason.

    Parameters
    ----------
    inputs : files, folders (with all that is in them) and patterns such as "logs/**/*.ulg".
    out : the folder for `fleet.parquet` (the table), `report.html` and `journal.sqlite`. With the
        same folder, finished logs are not calibrated again while their content, the settings and
        the version of agonic stay.
    settings : as for `agonic calibrate`; see `FleetSettings`.
    engine : where the work is done; without, processes of this machine.
    store : a history that the calibrations are kept in as well.
    progress : is told how far it is.

    Returns the table. Raises `AgonicError` where the inputs name no log, or where `out` cannot be
    written.

    Source: an implementation of agonic's own.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from agonic.fleet.engine import Here
    >>> from agonic.exports.csv import write_csv
    >>> from agonic.simulation import simulate
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_csv(simulate("sphere", n=300).samples, folder + "/board-7.csv")
    ...     _ = Path(folder, "board-8.csv").write_text("")
    ...     table = calibrate_fleet([folder], folder + "/out", engine=Here())
    >>> table["sensor"].tolist(), table["verdict"].tolist(), table["status"][1]
    (['board-7', 'board-8'], ['good', 'refused'], 'the file is empty')
    """
    run = run_fleet(inputs, out, settings=settings, engine=engine, store=store, progress=progress)
    return run.population


def run_fleet(
    inputs: Iterable[Path | str],
    out: Path | str,
    *,
    settings: FleetSettings | None = None,
    engine: Engine | None = None,
    store: Path | str | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> FleetRun:
    """As `calibrate_fleet`, with how it came about."""
    begun = time.monotonic()
    if store is not None:
        History.open(store).close()  # what is wrong with it is told before the work
    settings = settings or FleetSettings()
    found = find_inputs(inputs, settings)
    folder = make_folder(out)
    for name in (TABLE, PAGE):  # before the work and not after it
        check_target(folder / name)
    with Journal(folder / JOURNAL, work=settings.work) as journal:
        today = datetime.now(UTC).date().isoformat()
        settings = replace(settings, undated=journal.undated(today))
        work = Work(found, journal, settings, folder, progress or (lambda _: None))
        work.calibrate_logs(engine or Processes())
        work.calibrate_datasets(engine)
        population = Population.joined([Population.of(work.rows()), *work.tables()])
    if store is not None:
        with History.open(store) as history:
            history.add(population)
    compared = compare(population)
    return FleetRun(
        population=compared.population,
        outliers=compared.outliers,
        duplicates=compared.duplicates,
        table=write_population(compared.population, folder / TABLE),
        page=_write_page(compared, folder),
        logs=len(found.logs) - work.skipped,
        datasets=len(found.datasets),
        calibrated=work.calibrated,
        made=work.made,
        resumed=work.resumed,
        repeated=work.repeated,
        skipped=found.skipped + work.skipped,
        seconds=time.monotonic() - begun,
    )


def _write_page(compared: Compared, folder: Path) -> Path:
    """The report of the fleet."""
    title = folder.resolve().name
    page = describe_population(compared.population, title=title, outliers=compared.outliers)
    return write_atomically(folder / PAGE, page.to_html())
