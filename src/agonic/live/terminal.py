"""A live calibration in the terminal: guidance in words until the target is reached."""

from __future__ import annotations

import re
import sys
import time
from dataclasses import replace
from typing import TextIO

from msgspec import to_builtins

from agonic.console.boundary import Interrupted
from agonic.console.finish import finish
from agonic.errors import AgonicError
from agonic.live.guidance import tell_error
from agonic.live.web.messages import Status
from agonic.live.web.session import Session
from agonic.recording.document import describe_recording


def run_in_terminal(session: Session, as_json: bool) -> int:
    """Guide in words until the target is reached or the source has ended, then write."""
    session.start()
    stream = sys.stderr if as_json else sys.stdout
    lines = Lines(stream)
    try:
        while True:
            time.sleep(0.25)
            status = session.status
            lines.show(status)
            reached = bool(status.sensors) and all(one.done for one in status.sensors)
            if status.ended or reached:
                lines.show(status, last=True)
                break
    except KeyboardInterrupt:
        session.stop()
        print(f"\n{session.closing_message}", file=stream)
        return Interrupted.status
    finally:
        session.stop()
    if not session.shown:
        raise AgonicError(f"no readings came: {session.status.heard}")
    outcomes = session.accept()
    lines.show(session.status, last=True)  # the slower fits are made by now
    if session.status.trouble:
        raise AgonicError(session.status.trouble)
    failures = [(o.sensor, o.status) for o in outcomes if o.sensor not in session.written]
    document = describe_recording(
        session.results, written=session.written, failures=failures, schema="agonic/live@1"
    )
    names = ("name", "method", "heading_sd_deg", "say", "done", "rose")
    guidance = [
        {name: to_builtins(getattr(one, name)) for name in names} for one in session.status.sensors
    ]
    document = replace(document, values={**(document.values or {}), "guidance": guidance})
    return finish(document, page=session.plan.folder / "report.html", as_json=as_json)


class Lines:
    """The guidance as lines: each sensor's when its words change, at most one a second."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._said: dict[str, str] = {}
        self._at: dict[str, float] = {}

    def show_source(self, status: Status) -> None:
        """Print what is new of the source: what is heard of it, notes, trouble."""
        self._line("", status.heard, status.heard, 0.0)
        for note in [*status.notes, *filter(None, [status.trouble])]:
            self._line(re.sub(r"[\d,]+", "", note), note, note, time.monotonic())

    def show(self, status: Status, last: bool = False) -> None:
        """Print what is new in a status; of the `last` at once."""
        self.show_source(status)
        for one in status.sensors:
            error = tell_error(one.heading_sd_deg)
            wrong = "".join(f"  ! {problem.text}" for problem in one.problems)
            words = f"{one.say}{wrong}"
            told = f"{one.name}: {100 * one.progress:3.0f} % covered{error}  {words}"
            self._line(one.name, words, told, float("inf") if last else time.monotonic())

    def _line(self, who: str, words: str, line: str, now: float) -> None:
        if self._said.get(who) == words or (now - self._at.get(who, -9.0) < 1.0 and who):
            return
        self._said[who], self._at[who] = words, now
        print(line, file=self._stream, flush=True)
