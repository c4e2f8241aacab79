"""`calibrate_fleet`: many logs into one table, which goes on where it was cut off."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np

from agonic.atomic import check_target, make_folder, write_atomically
from agonic.errors import LogError
from agonic.fleet.dataset import calibrate_dataset
from agonic.fleet.document import describe_population
from agonic.fleet.engine import Engine, Lost, Processes
from agonic.fleet.inputs import JOURNAL, PAGE, TABLE, Inputs, find_inputs, name_sensors
from agonic.fleet.journal import Journal, State
from agonic.fleet.one_log import Done, calibrate_log, explain, report_unread
from agonic.fleet.settings import FleetRun, FleetSettings, digest
from agonic.logs.remote import Remote, is_remote, locate
from agonic.population import (
    History,
    Population,
    Row,
    compare,
    write_population,
)
from agonic.provenance import hash_file


@dataclass(frozen=True, slots=True)
class Progress:
    """How many of the logs are done, and how many of these were found done. `stage` says what is
    done with the sensors of a dataset, where that is under way."""

    done: int
    resumed: int
    logs: int
    stage: str = ""


@dataclass(slots=True)
class Work:
    """What is to be done and what is, log by log."""

    found: Inputs
    journal: Journal
    settings: FleetSettings
    folder: Path
    progress: Callable[[Progress], None]
    calibrated: int = 0
    made: int = 0
    resumed: int = 0
    repeated: int = 0
    skipped: int = 0
    of_datasets: list[tuple[str, str]] = field(default_factory=list)
    under_way: dict[str, tuple[str, State | None, str | None]] = field(default_factory=dict)
    fresh: set[str] = field(default_factory=set)
    unkept: dict[str, tuple[Row, ...]] = field(default_factory=dict)
    """Rows that are not kept for the next run, by path or content."""

    def calibrate_logs(self, engine: Engine) -> None:
        """Work on all logs that are not finished."""
        function = partial(calibrate_log, settings=self.settings, folder=str(self.folder.resolve()))
        for task, result in engine.run(function, self._find_unfinished()):
            if isinstance(result, Lost):
                result = report_unread(task, result.sentence, self.settings)
            self._finish(task, result)
            self._tell()
        self._tell()
        self.journal.commit()

    def calibrate_datasets(self, engine: Engine | None) -> None:
        """Calibrate the sensors of datasets, each dataset at once."""
        for dataset in self.found.datasets:
            path = str(dataset.path)
            content = digest(dataset.sha256, dataset.sensor)
            if self.journal.table(content) is not None:
                self.resumed += 1
            else:
                try:
                    table = calibrate_dataset(
                        dataset, self.settings, engine=engine, progress=self._tell_stage
                    )
                except Exception as error:  # whatever is wrong with a dataset becomes its row
                    self.unkept[path] = report_unread(
                        path, explain(error, path), self.settings
                    ).rows
                else:
                    self.journal.add_table(content, table)
                    self.made += len(table)
                self.calibrated += 1
            self.of_datasets.append((path, content))
            self._tell()

    def rows(self) -> Iterator[Row]:
        """The rows of all logs, with the sensor and the path that each is known by."""
        for path in self.found.logs:
            rows = self._rows_of(path)
            if not self._is_no_log(path, rows):
                yield from name_sensors(path, rows, self.settings.name)

    def tables(self) -> Iterator[Population]:
        """The rows of all datasets, with the path that each is known by."""
        for path, content in self.of_datasets:
            table = self.journal.table(content)
            if table is None:
                yield Population.of(self.unkept[path])
            else:
                source = np.where(table["sensor"] == "", table["source"], path)
                yield Population({**table.columns, "source": source})

    def _rows_of(self, path: str) -> tuple[Row, ...]:
        if path in self.unkept:
            return self.unkept[path]
        content = self.journal.content(path) or ""
        found = self.unkept.get(content) or self.journal.rows(content)
        return (
            found or report_unread(path, "the file changed while it was read", self.settings).rows
        )

    def _find_unfinished(self) -> Iterator[str]:
        """The logs to work on; of those with the same content, the first."""
        states = map(State.of, self.found.logs)
        sizes = Counter(state.size for state in states if state)
        known = self.journal.sizes()
        for path in self.found.logs:
            state = State.of(path)
            content = self.journal.content(path, state) if state else None
            if state and content is None and (sizes[state.size] > 1 or state.size in known):
                content = _hash_file(path)
                if content is not None:
                    self.journal.note(path, state, content)
            if content is None or self._is_new(content, path):
                task = (
                    path if is_remote(path) else os.path.abspath(path)
                )  # wherever the process that works on it stands
                self.under_way[task] = path, state, content
                yield task

    def _is_no_log(self, path: str, rows: Sequence[Row]) -> bool:
        """Whether a file turned out to be no log, and nobody said that it was."""
        return path in self.found.perhaps and not rows[0].channel

    def _is_new(self, content: str, path: str) -> bool:
        """Whether a content is neither finished nor under way."""
        if content in self.fresh:
            self.repeated += 1
            return False
        finished = self.journal.rows(content)
        if finished and all(map(self._complete, finished)):
            if self._is_no_log(path, finished):
                self.skipped += 1
            else:
                self.resumed += 1
            if self.resumed % 1000 == 0:
                self._tell()
            return False
        self.fresh.add(content)
        return True

    def _complete(self, row: Row) -> bool:
        """Whether what was written for a row is still there."""
        files = (row.calibration, row.report)
        return all((self.folder / file).is_file() for file in files if file)

    def _finish(self, task: str, done: Done) -> None:
        path, state, content = self.under_way.pop(task)
        if self._is_no_log(path, done.rows):
            self.skipped += 1
        else:
            self.calibrated += 1
        if not done.sha256 or state is None:
            self.unkept[path] = done.rows
            if content is not None:
                self.unkept[content] = done.rows
            return
        self.made += len(done.rows)
        self.fresh.add(done.sha256)
        self.journal.note(path, state, done.sha256)
        if done.final:
            self.journal.add(done.sha256, done.rows)
        else:
            self.unkept[done.sha256] = done.rows

    def _tell(self, stage: str = "") -> None:
        done = self.calibrated + self.resumed + self.repeated + self.skipped
        self.progress(Progress(done, self.resumed, len(self.found), stage))

    def _tell_stage(self, stage: str, done: int, total: int) -> None:
        self._tell(f"{stage} {done} of {total} sensors" if done else stage)


def _hash_file(path: str) -> str | None:
    try:
        file = locate(path)
        return file.hash() if isinstance(file, Remote) else hash_file(file)
    except (OSError, LogError):
        return None


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
    title = folder.resolve().name
    page = describe_population(compared.population, title=title, outliers=compared.outliers)
    return FleetRun(
        population=compared.population,
        outliers=compared.outliers,
        duplicates=compared.duplicates,
        table=write_population(compared.population, folder / TABLE),
        page=write_atomically(folder / PAGE, page.to_html()),
        logs=len(found.logs) - work.skipped,
        datasets=len(found.datasets),
        calibrated=work.calibrated,
        made=work.made,
        resumed=work.resumed,
        repeated=work.repeated,
        skipped=found.skipped + work.skipped,
        seconds=time.monotonic() - begun,
    )
