"""What a session leaves in its folder: where each sensor stands, and the results once accepted."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from agonic.atomic import make_folder
from agonic.errors import AgonicError
from agonic.exports.csv import write_csv
from agonic.files.names import file_stem
from agonic.health import Finding
from agonic.live.files import save_state
from agonic.live.fit import LiveFit
from agonic.live.state import LiveParams, LiveState
from agonic.live.streams import Source
from agonic.live.web.messages import Outcome
from agonic.live.web.plan import Plan
from agonic.provenance import Input, hash_file
from agonic.recording.calibrated import Calibrated, calibrate_as_named
from agonic.recording.document import Written
from agonic.recording.files import write_folder
from agonic.samples import Samples


class SavedFits:
    """Saves the live fits of a session, and takes them up again after the program was stopped. What
    cannot be gone on with, or is not wanted (`fresh`), is set aside under another name. Without an
    `origin`, of a source that begins again, nothing is saved."""

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
        return bool(self._origin) and time.monotonic() - self._at > 5.0

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


def write_results(
    plan: Plan, source: Source, seen: Mapping[str, tuple[Samples, Sequence[Finding]]]
) -> tuple[list[Calibrated], dict[str, Written], list[Outcome]]:
    """Calibrate each sensor from its readings, and write the folder of the plan; `seen` are the
    readings that count, and what is to be said of those that do not."""
    if not seen:
        raise AgonicError("there are no readings yet; turn the sensor first")
    make_folder(plan.folder)
    results, failures = [], []
    for name, (readings, doubts) in seen.items():
        path = write_csv(readings, plan.folder / f"{file_stem(name)}-readings.csv")
        told = Input(name=path.name, sha256=hash_file(path), count=len(readings))
        try:
            readings = replace(readings, source=told)
            made = calibrate_as_named(readings, plan.reference, **plan.settings)
            results.append(replace(made, fit=made.fit.with_findings(*doubts)))
        except AgonicError as error:
            failures.append(Outcome(name, "refused", str(error), []))
    written = write_folder(results, plan.folder, title=f"Live: {source.name}", stack=source.stack)
    outcomes = [
        Outcome(r.samples.name, r.verdict, r.status, *written[r.samples.name][:2]) for r in results
    ]
    return results, written, outcomes + failures
