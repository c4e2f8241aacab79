"""Sessions that were not finished: where each sensor stands, in a file beside the results to be."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from agonic.atomic import make_folder
from agonic.errors import AgonicError
from agonic.files.names import file_stem
from agonic.live.files import save_state
from agonic.live.fit import LiveFit
from agonic.live.state import LiveParams, LiveState

SAVE_S = 5.0
"""Between two times that the files are written."""


class SavedFits:
    """Saves the live fits of a session, and takes them up again after the program was stopped.

    What cannot be gone on with, or is not wanted (`fresh`), is set aside under another name.
    Without an `origin`, of a source that begins again, nothing is saved.
    """

    def __init__(self, folder: Path, origin: str, *, fresh: bool = False) -> None:
        self._folder, self._origin, self._fresh = folder, origin, fresh
        self._saved: dict[str, int] = {}
        self._finished: set[str] = set()
        self._at = time.monotonic()

    def path(self, sensor: str) -> Path:
        """The file of a sensor."""
        return self._folder / f"{file_stem(sensor)}.live"

    def resume(self, params: LiveParams) -> tuple[LiveFit | None, str]:
        """The live fit of a sensor as it was left, `None` where there is none, and what to say."""
        path = self.path(params.name)
        if not (self._origin and path.is_file()):
            return None, ""
        if self._fresh:
            return None, f"started again; the earlier readings are kept as {_set_aside(path).name}"
        try:
            live = LiveFit.resume(path, params, origin=self._origin)
        except AgonicError as error:
            return None, f"started again: {error}; it is kept as {_set_aside(path).name}"
        self._saved[params.name] = live.n
        left = datetime.fromtimestamp(path.stat().st_mtime).strftime("%Y-%m-%d %H:%M")
        return live, f"{params.name}: continued from {live.n:,} readings, saved {left}"

    def due(self) -> bool:
        """Whether it is time to save."""
        return bool(self._origin) and time.monotonic() - self._at > SAVE_S

    def save(self, stands: Mapping[str, tuple[LiveParams, LiveState]]) -> str:
        """Write where sensors stand, those with something new; what went wrong, in words."""
        self._at = time.monotonic()
        if not self._origin:
            return ""
        for name, (params, state) in stands.items():
            if name in self._finished or state.n in (0, self._saved.get(name, 0)):
                continue
            try:
                make_folder(self._folder)
                save_state(params, state, self.path(name), self._origin)
            except AgonicError as error:
                return f"the readings are not saved: {error}"
            self._saved[name] = state.n
        return ""

    def closing_message(self, *, accepted: bool) -> str:
        """What is left when the program stops, in words."""
        if self._saved:
            total = f"{sum(self._saved.values()):,} readings"
            return f"Stopped; {total} saved in {self._folder}: the same command goes on from there"
        return f"Stopped; the results are in {self._folder}" if accepted else "Stopped"

    def finish(self, sensor: str) -> None:
        """The result of a sensor is written: there is nothing to go on with."""
        self._finished.add(sensor)
        self._forget(sensor)

    def begin(self, sensor: str) -> None:
        """The readings of a sensor were thrown away, and new ones are taken."""
        self._finished.discard(sensor)
        self._forget(sensor)

    def leave(self, sensor: str) -> str:
        """Set the saved readings of a sensor aside, and say so."""
        self._saved.pop(sensor, None)
        path = self.path(sensor)
        with suppress(AgonicError):
            if self._origin and path.is_file():
                return f"; the earlier readings are kept as {_set_aside(path).name}"
        return ""

    def _forget(self, sensor: str) -> None:
        self._saved.pop(sensor, None)
        if not self._origin:
            return
        with suppress(OSError):
            self.path(sensor).unlink(missing_ok=True)


def _set_aside(path: Path) -> Path:
    """A file under the next name that is free."""
    number = 1
    while (aside := path.with_name(f"{path.stem}-{number}{path.suffix}")).exists():
        number += 1
    try:
        os.rename(path, aside)
    except OSError as error:
        raise AgonicError(f"cannot set {path} aside: {error.strerror or error}") from error
    return aside
