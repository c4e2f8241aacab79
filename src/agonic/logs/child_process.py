"""Work that may crash, never end or take all memory is done by a child process, within limits.

Nothing else can stop a library in C: it holds the interpreter. A child does one thing after the
other; it is started when it is first needed, and ends with the process that started it.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import traceback
import weakref
from collections.abc import Callable, Iterator
from contextlib import suppress
from threading import Event, Lock, Timer
from typing import Any

from agonic.errors import AgonicError, LogError

LONGEST_S = 60.0
"""Longest that a file may take to be read."""
MOST_MEMORY = 4_000_000_000
"""Bytes of memory that a child process may take: of a text, some twenty times its own length."""
_START = """
import pickle, sys
sys.path[:], most_memory = pickle.load(sys.stdin.buffer)
from agonic.logs.child_process import serve
serve(most_memory)
"""
_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Small matrices lose far more to threads than they gain."""


class Child:
    """A process that does one thing after the other, and is replaced where that ends it."""

    def __init__(self, most_memory: int = MOST_MEMORY) -> None:
        self._most_memory = most_memory
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0
        self._closed = False

    def ask(self, function: Callable[[Any], Any], given: object, longest_s: float) -> Any:
        """What a function of a module makes of what is given."""
        request = pickle.dumps((function, given), protocol=5)
        process = self._start()
        assert process.stdin is not None
        assert process.stdout is not None
        late = Event()

        def stop() -> None:
            late.set()
            process.kill()

        timer = Timer(longest_s, stop)
        timer.start()
        try:
            pickle.dump(request, process.stdin)
            process.stdin.flush()
            head, sizes = pickle.load(process.stdout)
            buffers = list(map(bytearray, sizes))  # of arrays
            for buffer in buffers:
                if process.stdout.readinto(buffer) < len(buffer):  # type: ignore[attr-defined]
                    raise EOFError
            failed, answer = pickle.loads(head, buffers=buffers)
        except (EOFError, OSError, pickle.UnpicklingError):
            self.end()
            raise (TimeoutError if late.is_set() else ChildProcessError) from None
        except BaseException:  # Ctrl-C: its answer must not be taken for the next one
            self.end()
            raise
        finally:
            timer.cancel()
        if failed:
            raise answer
        return answer

    def end(self) -> None:
        """Stop the process, whatever it does."""
        with self._lock:
            if self._process is not None and self._owner == os.getpid():
                self._finalizer()
            self._process = None

    def close(self) -> None:
        """Stop the process, and start no other."""
        self._closed = True
        self.end()

    def _start(self) -> subprocess.Popen[bytes]:
        """The process, which is told where modules are found; that before a fork is another's."""
        with self._lock:
            if self._closed:
                raise ChildProcessError
            if self._process is None or self._owner != os.getpid():
                self._owner = os.getpid()
                self._process = subprocess.Popen(
                    [sys.executable, "-c", _START],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    env={**os.environ, **_ENVIRONMENT},
                )
                self._finalizer = weakref.finalize(self, _kill, self._process, self._owner)
                assert self._process.stdin is not None
                with suppress(OSError):  # seen when it is asked
                    pickle.dump((sys.path, self._most_memory), self._process.stdin)
            return self._process


def _kill(process: subprocess.Popen[bytes], owner: int) -> None:
    if owner != os.getpid():
        return
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        with suppress(OSError):
            if stream is not None:
                stream.close()


_lock = Lock()
_child = Child()
_in_child = False


def call(function: Callable[[Any], Any], given: object) -> Any:
    """What a function of a module makes of what is given, in a child process. In a child process,
    and where none can be started, it is done in this one. Raises `LogError` where that takes longer
    than `LONGEST_S` or ends the child, and what the function raises."""
    if _in_child or not sys.executable or getattr(sys, "frozen", False):
        return function(given)
    with _lock:
        try:
            return _child.ask(function, given, LONGEST_S)
        except TimeoutError:
            raise LogError(
                f"reading it did not end within {LONGEST_S:g} s: damaged, or far too long; fetch "
                "it again, or cut it"
            ) from None
        except ChildProcessError:
            raise LogError(
                f"its library crashes, or takes more than {MOST_MEMORY / 1e9:g} GB of memory: "
                "damaged, or too long; fetch it again, or cut it"
            ) from None


def serve(most_memory: int) -> None:
    """What a child does until nobody asks any more: the terminal's interruption is its parent's."""
    global _in_child
    _in_child = True
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(ImportError, ValueError, OSError):  # where the system can hold it to that
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (most_memory, hard))
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with suppress(EOFError):
        while True:
            for part in _answer(pickle.load(sys.stdin.buffer)):
                answers.write(part)
            answers.flush()


def _answer(request: bytes) -> Iterator[Any]:
    """Whether it failed, and with what or the result, as bytes: a head, then its arrays."""
    buffers: list[pickle.PickleBuffer] = []
    failed: BaseException | None = None
    try:
        function, given = pickle.loads(request)
        answer = False, function(given)
        head = pickle.dumps(answer, protocol=5, buffer_callback=buffers.append)
    except (AgonicError, MemoryError) as error:
        failed = error
    except BaseException as error:
        failed = RuntimeError(f"{type(error).__name__}: {error}")
        failed.add_note(traceback.format_exc())
    if failed is not None:
        buffers.clear()
        head = pickle.dumps((True, failed), protocol=5)
    parts = [buffer.raw() for buffer in buffers]
    yield pickle.dumps((head, [part.nbytes for part in parts]))
    yield from parts
