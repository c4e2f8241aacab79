"""Files whose library may crash or never end are read by a child process, within a time limit.

Nothing else can stop a library in C: it holds the interpreter. The child is started once and ends
with the process that started it.
"""

from __future__ import annotations

import atexit
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as TooLate
from contextlib import suppress
from threading import Lock
from typing import Any

from agonic.errors import LogError

LONGEST_S = 60.0
"""Longest that a file may take to be read."""

_WORK = """
import os, pickle, sys
from importlib import import_module
sys.path[:] = pickle.load(sys.stdin.buffer)
answers = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)
while True:
    try:
        module, name, given = pickle.load(sys.stdin.buffer)
    except (EOFError, KeyboardInterrupt):
        break
    try:
        answer = "", getattr(import_module(module), name)(given)
    except KeyboardInterrupt:
        break
    except BaseException as error:
        answer = type(error).__name__, str(error)
    pickle.dump(answer, answers, protocol=5)
    answers.flush()
"""


class _Child:
    """A process that does one thing after the other."""

    def __init__(self) -> None:
        self.owner = os.getpid()
        self._process = subprocess.Popen(
            [sys.executable, "-c", _WORK],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
        self._send(sys.path)

    def _send(self, what: object) -> None:
        assert self._process.stdin is not None
        pickle.dump(what, self._process.stdin)
        self._process.stdin.flush()

    def ask(self, request: tuple[str, str, object]) -> tuple[str, Any]:
        """The class of the error or "", and its text or the answer."""
        assert self._process.stdout is not None
        self._send(request)
        with ThreadPoolExecutor(1) as waiting:
            answer = waiting.submit(pickle.load, self._process.stdout)
            try:
                found: tuple[str, Any] = answer.result(LONGEST_S)
            except TooLate:
                self._process.kill()
                raise
        return found

    def end(self) -> None:
        """Let it end; by force where it does not."""
        if self.owner != os.getpid():
            return
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                if stream is not None:
                    stream.close()


_lock = Lock()
_child: _Child | None = None


def call(function: Callable[[Any], Any], given: object) -> Any:
    """What a function of a module makes of what is given, both in a child process.

    Raises `LogError` where that takes longer than `LONGEST_S` or ends the child, `LogError` with
    the text of one that the function raises, and `RuntimeError` with that of any other.

    >>> call(len, "abc")
    3
    """
    global _child
    if not sys.executable or getattr(sys, "frozen", False):
        return function(given)
    with _lock:
        if _child is None or _child.owner != os.getpid():
            _child = _Child()
            atexit.register(_child.end)
        try:
            failed, found = _child.ask((function.__module__, function.__name__, given))
        except TooLate:
            _end()
            raise LogError(
                f"reading it did not end within {LONGEST_S:g} s: damaged, or far too long; fetch "
                "it again, or cut it"
            ) from None
        except (EOFError, OSError, pickle.UnpicklingError):
            _end()
            raise LogError("damaged so that its library crashes; fetch it again") from None
        except BaseException:  # Ctrl-C: its answer must not be taken for the next one
            _end()
            raise
    if failed == "LogError":
        raise LogError(found)
    if failed:
        raise RuntimeError(f"{failed}: {found}")
    return found


def _end() -> None:
    """End the child; the next call starts another."""
    global _child
    if _child is not None:
        atexit.unregister(_child.end)
        _child.end()
        _child = None
