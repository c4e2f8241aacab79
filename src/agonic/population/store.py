"""`History`: calibrations kept over the years, in one file that is safe against interruption."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.population import store_schema as schema
from agonic.population.population import COLUMNS, Population, Row, get_dtype
from agonic.provenance import escape_text
from agonic.readable import Readable, Shown

WAIT_S = 60.0
"""How long to wait while another process writes."""
_CACHE_KB = 64_000
_CURRENT = "FROM calibration WHERE superseded = 0"
_RANKED = f"""
SELECT {", ".join(f"calibration.{name}" for name in COLUMNS)} FROM (
    SELECT id, ROW_NUMBER() OVER (
        PARTITION BY sensor ORDER BY verdict = 'good' DESC, time DESC, id DESC
    ) AS rank {_CURRENT} AND verdict != 'refused'
) AS ranked JOIN calibration USING (id) WHERE rank = ? ORDER BY calibration.sensor
"""


@dataclass(frozen=True, slots=True)
class SensorSummary:
    """A sensor of a history: how many calibrations, the moments of the first and the last, and what
    the last one came to.
    """

    sensor: Annotated[str, Shown()]
    calibrations: Annotated[int, Shown()]
    refused: Annotated[int, Shown()]
    first: Annotated[datetime, Shown()]
    last: Annotated[datetime, Shown()]
    verdict: Annotated[str, Shown()]


class History(Readable):
    """Calibrations of many sensors over time, in one SQLite file.

    `History.open(path)` makes the file where there is none. What `add` was given is there when it
    returns, whole, whatever happens to the process; while it did not return, nothing of it is.
    Several processes may add at once. A calibration that was added before changes nothing; a log
    that was calibrated anew counts once, as calibrated last.

    Source: SQLite, with a rollback journal.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> day = datetime(2026, 5, 1, tzinfo=UTC)
    >>> row = Row(sensor="7", source="a.csv", verdict="good", status="", start=day, bias_x=12.0)
    >>> with TemporaryDirectory() as folder, History.open(folder + "/boards.sqlite") as history:
    ...     print(history.add([row]), history.add([row]), history.of("7").bias[0, 0])
    1 0 12.0
    """

    def __init__(self, database: sqlite3.Connection, path: Path) -> None:
        self._database = database
        self.path = path

    def _say(self) -> list[str]:
        """The file; what it holds is asked for."""
        return [f"History in {self.path.name}"]

    @classmethod
    def open(cls, path: Path | str, *, new: bool = True) -> Self:
        """The history in a file; one that is not there is made, unless `new` is False.

        Raises `LogError` where the file is missing, is no history, or was made by a later version.
        """
        path = Path(path)
        if not path.exists() and not new:
            raise LogError(
                "there is no such history; agonic calibrate --store makes one", path=path
            )
        if not path.absolute().parent.is_dir():
            raise LogError(f"there is no folder {path.absolute().parent}; create it", path=path)
        mode = "rwc" if new else "rw"
        try:
            database = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode={mode}",
                uri=True,
                timeout=WAIT_S,
                isolation_level=None,
            )
        except sqlite3.Error as error:
            raise LogError(f"cannot be opened as a history: {error}", path=path) from None
        history = cls(database, path)
        try:
            with _explain_errors(path):
                history._prepare()
        except BaseException:
            database.close()
            raise
        return history

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        self._database.close()

    def add(self, rows: Iterable[Row], *, now: datetime | None = None) -> int:
        """Keep calibrations; returns how many were not there yet.

        Parameters: rows, such as a `Population`; `now` dates those whose log knows no date.

        All of them or, where it fails, none. Raises `LogError` where the file cannot be written.
        """
        moment = now or datetime.now(UTC)
        entries = (schema.make_entry(row, moment) for row in rows)
        added = 0
        with self._writing() as database:
            last = database.execute("SELECT COALESCE(MAX(id), 0) FROM calibration").fetchone()[0]
            while chunk := list(islice(entries, 10_000)):
                for entry in chunk:
                    if schema.UNDATED.name in entry[3 + schema.FINDINGS]:
                        self._as_dated_before(entry)
                added += database.executemany(schema.INSERT, chunk).rowcount
            database.execute(schema.SUPERSEDE, (last,))
        return added

    def _as_dated_before(self, entry: list[Any]) -> None:
        """A log without a date keeps the moment at which it was first added."""
        of_log = [entry[3 + place] for place in (schema.SENSOR, schema.CHANNEL, schema.SHA256)]
        found = self._database.execute(schema.DATED, of_log).fetchone()
        if found and of_log[2]:
            entry[1], entry[3 + schema.START] = found

    def sensors(self) -> list[SensorSummary]:
        """The sensors by name, each with how much is known of it."""
        rows = self._read(
            "SELECT sensor, COUNT(*), SUM(verdict = 'refused'), MIN(time), MAX(time), "
            "(SELECT verdict FROM calibration AS last WHERE last.sensor = calibration.sensor "
            "AND superseded = 0 ORDER BY time DESC, id DESC LIMIT 1) "
            f"{_CURRENT} GROUP BY sensor ORDER BY sensor"
        )
        with _check_values(self.path):
            return [
                SensorSummary(sensor, n, refused, _make_date(first), _make_date(last), verdict)
                for sensor, n, refused, first, last, verdict in rows
            ]

    def of(self, sensor: str) -> Population:
        """The calibrations of a sensor in order of time, refused ones among them.

        Each log counts once. Where a log knew no date, `start` is the moment of adding, and the
        findings of the row say so. Raises `LogError` for a sensor that is not there.
        """
        rows = self._read(
            f"SELECT {', '.join(COLUMNS)} {_CURRENT} AND sensor = ? ORDER BY time, id",
            (escape_text(sensor),),
        )
        if not rows:
            raise LogError(
                f"there is no sensor {sensor!r}; agonic history lists them", path=self.path
            )
        return self._population(rows)

    def latest(self, before: int = 0) -> Population:
        """The last good calibration of each sensor (of one without any, the last to be checked).

        Parameters: before, how many calibrations earlier; sensors that have fewer are left out.
        """
        return self._population(self._read(_RANKED, (before + 1,)))

    def columns(self, *names: str) -> dict[str, NDArray[Any]]:
        """Some columns of all calibrations that are not refused, by sensor and time.

        Parameters: names of a population's columns, or "time" (seconds since 1970).
        """
        known = [name for name in names if name in COLUMNS or name == "time"]
        rows = self._read(
            f"SELECT {', '.join(known)} {_CURRENT} AND verdict != 'refused' "
            "ORDER BY sensor, time, id"
        )
        columns = list(zip(*rows, strict=True)) or [()] * len(known)
        with _check_values(self.path):
            return {
                name: np.array(values, dtype=np.float64 if name == "time" else get_dtype(name))
                for name, values in zip(known, columns, strict=True)
            }

    def _population(self, rows: list[Any]) -> Population:
        with _check_values(self.path):
            return schema.make_population(rows)

    def _read(self, query: str, values: tuple[Any, ...] = ()) -> list[Any]:
        with _explain_errors(self.path):
            return self._database.execute(query, values).fetchall()

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """One transaction: all or nothing."""
        with _explain_errors(self.path):
            self._database.execute("BEGIN IMMEDIATE")
            try:
                yield self._database
                self._database.execute("COMMIT")
            except BaseException:
                if self._database.in_transaction:
                    self._database.execute("ROLLBACK")
                raise

    def _prepare(self) -> None:
        """Make the tables, or see that they are ours."""
        self._database.execute("PRAGMA synchronous = FULL")
        self._database.execute(f"PRAGMA cache_size = {-_CACHE_KB}")
        if self._known():
            return
        with self._writing() as database:
            if self._known():  # another process was first
                return
            if database.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0]:
                raise LogError("an SQLite file, but no history of agonic", path=self.path)
            for statement in filter(str.strip, schema.CREATE.split(";")):
                database.execute(statement)
            database.execute(f"PRAGMA application_id = {schema.APPLICATION}")
            database.execute(f"PRAGMA user_version = {schema.VERSION}")

    def _known(self) -> bool:
        """Whether the file is a history that this version reads."""
        number = self._database.execute("PRAGMA application_id").fetchone()[0]
        version = self._database.execute("PRAGMA user_version").fetchone()[0]
        if number != schema.APPLICATION:
            return False
        if version > schema.VERSION:
            raise LogError(
                f"made by a later agonic (tables {version}, this one reads {schema.VERSION}): "
                "upgrade agonic",
                path=self.path,
            )
        return True


@contextmanager
def _explain_errors(path: Path) -> Iterator[None]:
    """Errors of the database as `LogError`, in words."""
    try:
        yield
    except sqlite3.Error as error:
        said = str(error)
        if "not a database" in said:
            said = "not a history: the file is no SQLite database"
        elif "locked" in said:
            said = f"another process has been writing for {WAIT_S:.0f} s; try again"
        raise LogError(said, path=path) from None
    except UnicodeDecodeError:  # of names in the database's own tables
        raise LogError("the database is damaged; restore a copy", path=path) from None


@contextmanager
def _check_values(path: Path) -> Iterator[None]:
    """Values that no calibration has, as `LogError`."""
    try:
        yield
    except (ValueError, TypeError, OverflowError, OSError) as error:
        raise LogError(
            f"damaged, a row holds what no calibration has: {error}", path=path
        ) from None


def _make_date(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)
