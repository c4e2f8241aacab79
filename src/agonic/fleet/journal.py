"""`Journal`: what is finished, kept so that a run goes on where another was cut off."""

from __future__ import annotations

import sqlite3
import stat
import time
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import msgspec

from agonic.errors import AgonicError, LogError
from agonic.fleet.settings import digest
from agonic.logs.remote import Remote, locate
from agonic.population import Population, Row
from agonic.population.table import from_bytes, to_bytes
from agonic.provenance import escape_text

COMMIT_S = 1.0
"""How much work a cut may cost."""

_TABLES = """
create table if not exists contents(
    path text primary key, size integer, mtime_ns integer, sha256 text) without rowid;
create index if not exists sizes on contents(size);
create table if not exists rows(work text, place integer, row blob, primary key(work, place));
create table if not exists datasets(work text primary key, content blob);
create table if not exists given(work text primary key, undated text) without rowid;
"""
_UNUSABLE = "delete it, and all logs are calibrated again"
_NONE = f"is damaged, or no journal of a fleet ({{}}); {_UNUSABLE}"
_CANNOT = "cannot be written ({})"
_WRONG = {
    sqlite3.SQLITE_BUSY: "is in use ({}): another run writes to this folder",
    sqlite3.SQLITE_FULL: "{}; make room, and the same command goes on from there",
    sqlite3.SQLITE_CANTOPEN: _CANNOT,
    sqlite3.SQLITE_READONLY: _CANNOT,
    sqlite3.SQLITE_IOERR: _CANNOT,
}


class State(NamedTuple):
    """A file's size and time of change: while they stay, so does its content."""

    size: int
    mtime_ns: int

    @classmethod
    def of(cls, path: str) -> State | None:
        """Those of a file; None where there is none, or what is no file, as a pipe."""
        file = locate(path)
        try:
            if isinstance(file, Remote):
                return cls(*file.measure())
            found = file.stat()
        except (OSError, LogError):
            return None
        if not stat.S_ISREG(found.st_mode):
            return None
        return cls(found.st_size, found.st_mtime_ns)


class Journal:
    """Finished rows by the content of their log and the work asked for, in an SQLite file. One
    process writes. It commits about once a second; what was committed outlives a kill at any
    moment, and what was not is done again. Rows of other settings or another version stay."""

    def __init__(self, path: Path | str, *, work: str) -> None:
        self._work = work
        self._path = path
        self._committed = time.monotonic()
        try:
            self._db = sqlite3.connect(path, isolation_level=None, timeout=0.0)
            self._db.execute("pragma locking_mode = exclusive")
            self._db.execute("begin exclusive")
            for statement in _TABLES.split(";"):
                self._db.execute(statement)
        except sqlite3.Error as error:
            raise self._explain(error) from None
        except UnicodeDecodeError as error:
            raise AgonicError(f"{self._path}: is damaged ({error}); {_UNUSABLE}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        with closing(self._db):
            try:
                if self._db.in_transaction and not isinstance(error, sqlite3.Error):
                    self._db.execute("commit")
            except sqlite3.Error as failed:
                error = failed
        if isinstance(error, sqlite3.Error):
            raise self._explain(error) from None

    def _explain(self, error: sqlite3.Error) -> AgonicError:
        """What is wrong with the file, and what helps."""
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        return AgonicError(f"{self._path}: {_WRONG.get(code, _NONE).format(error)}")

    def content(self, path: str, state: State | None = None) -> str | None:
        """The digest of a file's content as it was last read, where `state` is still the same."""
        found = self._db.execute(
            "select size, mtime_ns, sha256 from contents where path = ?", (escape_text(path),)
        ).fetchone()
        return found[2] if found and (state is None or state == found[:2]) else None

    def sizes(self) -> set[int]:
        """The sizes of files that were read."""
        return {size for (size,) in self._db.execute("select distinct size from contents")}

    def note(self, path: str, state: State, sha256: str) -> None:
        """Keep the digest of a file's content."""
        self._db.execute(
            "insert or replace into contents values (?, ?, ?, ?)",
            (escape_text(path), *state, sha256),
        )

    def rows(self, sha256: str) -> tuple[Row, ...]:
        """The finished rows of a content, in its order; none where it is not finished."""
        found = self._db.execute(
            "select row from rows where work = ? order by place", (self._key(sha256),)
        )
        try:
            return tuple(_DECODER.decode(row) for (row,) in found)
        except (msgspec.MsgspecError, sqlite3.DatabaseError, ValueError, TypeError) as error:
            raise AgonicError(f"{self._path}: is damaged ({error}); {_UNUSABLE}") from None

    def add(self, sha256: str, rows: Iterable[Row]) -> None:
        """Keep the rows of a content, all of its channels or none."""
        key = self._key(sha256)
        self._db.execute("delete from rows where work = ?", (key,))
        self._db.executemany(
            "insert into rows values (?, ?, ?)",
            [(key, place, _ENCODER.encode(row)) for place, row in enumerate(rows)],
        )
        if time.monotonic() - self._committed > COMMIT_S:
            self.commit()

    def table(self, sha256: str) -> Population | None:
        """The finished rows of a dataset; None where it is not finished."""
        found = self._db.execute(
            "select content from datasets where work = ?", (self._key(sha256),)
        ).fetchone()
        try:
            return from_bytes(found[0]) if found else None
        except (AgonicError, TypeError) as error:
            raise AgonicError(f"{self._path}: is damaged ({error}); {_UNUSABLE}") from None

    def add_table(self, sha256: str, population: Population) -> None:
        """Keep the rows of a dataset."""
        self._db.execute(
            "insert or replace into datasets values (?, ?)",
            (self._key(sha256), to_bytes(population)),
        )
        self.commit()

    def undated(self, today: str) -> str:
        """The date of logs that know none: that of the first run which asked for this work."""
        self._db.execute("insert or ignore into given values (?, ?)", (self._work, today))
        found = self._db.execute("select undated from given where work = ?", (self._work,))
        return str(found.fetchone()[0])

    def commit(self) -> None:
        """Make what was kept outlive a kill."""
        self._db.execute("commit")
        self._db.execute("begin exclusive")
        self._committed = time.monotonic()

    def _key(self, sha256: str) -> str:
        return digest(sha256, self._work)


_ENCODER = msgspec.msgpack.Encoder()
_DECODER = msgspec.msgpack.Decoder(Row)
