"""Two works that take turns, by processor time: what else the machine does counts little."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from typing import Any, NamedTuple

SLOW_S = 2.0
"""What takes longer at first is not run again."""
SHORT_S = 0.02
"""What takes less is run several times in a round."""


class Pair(NamedTuple):
    """A job of agonic beside what somebody else does for it."""

    name: str
    ours: Callable[[], Any]
    rival: str
    theirs: Callable[[], Any]


class Spent(NamedTuple):
    """The least processor time of each, s."""

    ours: float
    theirs: float

    @property
    def ratio(self) -> float:
        """Ours over theirs."""
        return self.ours / self.theirs


def measure(pair: Pair, rounds: int) -> Spent:
    """Both by turns, after a first time that loads and compiles."""
    works = (pair.ours, pair.theirs)
    first = [spend(work) for work in works]
    often = [max(1, min(50, int(SHORT_S / max(taken, 1e-6)))) for taken in first]
    best = list(first)
    for _ in range(rounds):
        for k, work in enumerate(works):
            if first[k] < SLOW_S:
                best[k] = min(best[k], spend(work, often[k]))
    return Spent(*best)


def spend(work: Callable[[], Any], times: int = 1) -> float:
    """Processor time of one run, s, of this process with its threads."""
    gc.collect()
    begun = time.process_time()
    for _ in range(times):
        work()
    return (time.process_time() - begun) / times
