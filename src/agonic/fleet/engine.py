"""`Engine`: the seam between the work on one log and where it is done."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from agonic.errors import AgonicError

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Lost:
    """A task without a result: each process that worked on it came to an end."""

    sentence: str = (
        "the process that worked on it came to an end, twice: it may need more memory than there is"
    )


class Engine(Protocol):
    """Somewhere to work on many tasks: processes of this machine, or workers of a cluster."""

    def run(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
        """Each task with its result, as they are finished; each once, whatever happens to workers.

        `function` can be pickled; what it raises ends the run. Tasks are taken as there is room,
        so that no more than a few wait. Closing the iterator ends all work.
        """
        ...


@dataclass(frozen=True, slots=True)
class Here:
    """The engine that does everything in this process, one task after the other."""

    def run(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
        """As `Engine.run`.

        >>> list(Here().run(abs, [-1, 2]))
        [(-1, 1), (2, 2)]
        """
        for task in tasks:
            yield task, function(task)


@dataclass(frozen=True, slots=True)
class Answer:
    """What a process sends back: a result, or in words what was raised."""

    result: Any = None
    wrong: str = ""

    @classmethod
    def of(cls, function: Callable[[Any], Any], task: Any) -> Answer:
        """That of a function to a task."""
        try:
            return cls(function(task))
        except AgonicError as error:
            return cls(wrong=str(error))
        except Exception:  # told where the run is ended
            return cls(wrong=f"unexpected:\n{traceback.format_exc()}")

    def value(self) -> Any:
        """The result; raises `AgonicError` with the words."""
        if self.wrong:
            raise AgonicError(self.wrong)
        return self.result
