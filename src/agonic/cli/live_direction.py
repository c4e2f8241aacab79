"""`agonic direction ALIGNMENT --live SOURCE`: a line of JSON for each reading, as it comes in."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from queue import Empty, Queue
from threading import Event as Flag
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from agonic.alignment.direction.follow import Follower
from agonic.alignment.direction.result import FieldDirection
from agonic.alignment.files.tables import QUATERNION, SDS, TIMES, Table, parse_stars
from agonic.alignment.session.session import StarReadings
from agonic.errors import AgonicError
from agonic.live.streams import Chunk, Notice, Source, Words
from agonic.samples import Samples

if TYPE_CHECKING:
    from agonic.live.streams.events import Event

MARK = "star,"
"""Begins the lines of attitudes in a stream that has readings too."""
_HEADER = ["unix_s", *QUATERNION, *SDS]
"""Columns of attitudes that come without a header."""


class StarLines:
    """Lines of a star sensor's table, its header first; without one the columns are `_HEADER`. What
    is `stated` of the table is what `parse_stars` takes."""

    def __init__(self, stated: Mapping[str, Any]) -> None:
        self._stated = stated
        self._headers: dict[str, list[str]] = {}

    def read(self, words: Words) -> Iterator[StarReadings | str]:
        """The attitudes in lines, or what is wrong with one of them."""
        for line in words.lines:
            cells = [cell.strip() for cell in line.split(",")]
            if set(cells) & set(TIMES):
                self._headers[words.origin] = cells
                continue
            header = self._headers.get(words.origin, _HEADER)
            try:
                if len(cells) != len(header):
                    raise AgonicError(f"{len(cells)} cells under {', '.join(header)}")
                columns = {name: [cell] for name, cell in zip(header, cells, strict=True)}
                table = Table(columns, Path("attitudes"))
                yield parse_stars(table, **self._stated)
            except AgonicError as error:
                yield f"an attitude was left out: {error}"


def follow_live(
    follower: Follower,
    sources: list[Source],
    stars: StarLines,
    sensor: str | None = None,
) -> int:
    """Write the direction at every reading until the sources have ended; the exit status. What is
    heard of the sources and what was left out goes to standard error."""
    stop, heard = Flag(), Queue["Event | None"]()
    for one in sources:
        Thread(target=_listen, args=(one, heard, stop), daemon=True).start()
    shown = 0
    try:
        for batch in _gather(heard, len(sources)):
            for event in batch:
                if isinstance(event, Chunk):  # of several magnetometers the first that is heard
                    sensor = sensor or _name(event)
                _take(follower, event, stars, sensor)
            shown += _show(follower.take())
    except KeyboardInterrupt:
        pass
    finally:
        stop.set()
    shown += _show(follower.finish())
    _say(f"{shown} readings with a direction, {follower.left_out} without attitude")
    return 0 if shown else 1


def _listen(source: Source, heard: Queue[Event | None], stop: Flag) -> None:
    """Pass on what a source tells, `None` at its end; an error of it is its end, said."""
    try:
        for event in source.events(stop):
            heard.put(event)
    except AgonicError as error:
        heard.put(Notice(False, str(error), ended=True))
    heard.put(None)


def _gather(heard: Queue[Event | None], sources: int) -> Iterator[list[Event]]:
    """Events that came within a moment, until every source has ended."""
    while sources:
        batch, until = [heard.get()], time.monotonic() + 0.002
        while (rest := until - time.monotonic()) > 0:
            if isinstance(batch[-1], Words):  # an attitude, for which readings wait
                break
            with suppress(Empty):
                batch.append(heard.get(timeout=rest))
        sources -= batch.count(None)
        yield [event for event in batch if event is not None]


def _take(follower: Follower, event: Event, stars: StarLines, sensor: str | None) -> None:
    """Add what an event holds to what waits."""
    if isinstance(event, Notice):
        _say(event.text)
    elif isinstance(event, Words):
        for one in stars.read(event):
            if isinstance(one, str):
                _say(one)
            else:
                follower.add(one)
    elif sensor in (event.sensor, _name(event)):
        follower.add(_make_samples(event))


def _name(chunk: Chunk) -> str:
    """The sensor, whichever of several senders told of it."""
    return chunk.sensor.partition(" from ")[0]


def _make_samples(chunk: Chunk) -> Samples:
    """Readings at their own moments where the device tells the date, else at their arrival."""
    moments = chunk.time + (time.time() - time.monotonic())
    if chunk.own is not None:
        # clocks count from 1970, as in tables of attitudes
        moments = np.where(chunk.own > 1e8, chunk.own, moments)
    order = np.argsort(moments, kind="stable")
    first = float(np.floor(moments[order[0]]))
    return Samples(
        time=moments[order] - first,
        field=chunk.field[order],
        unit=chunk.unit,
        epoch=datetime.fromtimestamp(first, UTC),
        name=chunk.sensor,
        frame=chunk.frame,
    )


def _show(found: FieldDirection | None) -> int:
    """Write readings that are ready, a line each, and how many they were."""
    if found is None:
        return 0
    lines = [json.dumps(record, allow_nan=False) for record in found.records()]
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()
    return len(lines)


def _say(text: str) -> None:
    print(f"agonic: {text}", file=sys.stderr, flush=True)
