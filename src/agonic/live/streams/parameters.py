"""Parameters of a vehicle, asked for by name and, where it stays silent, as the whole list."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from agonic.logs.ardupilot.dataflash_binary import Table
from agonic.logs.ardupilot.parameters import AXES

ASK_AGAIN_S = 0.5
ROUNDS = 6
"""Rounds of asking by name before the whole list is asked for."""

LIST_S = 10.0
"""So long after the last parameter of a list no more will come."""


def list_wanted(slot: str) -> tuple[str, ...]:
    """The parameters that correct the compass of a slot: "" the first, then "2" and "3".

    >>> list_wanted("2")[0], len(list_wanted(""))
    ('COMPASS_OFS2_X', 12)
    """
    vectors = [f"COMPASS_{part}{slot}_{axis}" for part in ("OFS", "DIA", "ODI") for axis in AXES]
    return (*vectors, f"COMPASS_SCALE{slot}", f"COMPASS_DEV_ID{slot}", "COMPASS_MOTCT")


class Parameters:
    """What a vehicle has told; `ask` and `ask_all` send the requests."""

    def __init__(self, ask: Callable[[str], None], ask_all: Callable[[], None]) -> None:
        self.values: dict[str, float] = {}
        self._ask, self._ask_all = ask, ask_all
        self._rounds: dict[str, int] = {}
        self._asked_at: dict[str, float] = {}
        self._listed: set[int] = set()
        self._count = 0
        self._list_at: float | None = None

    def take(self, message: Any, now: float) -> None:
        """A PARAM_VALUE that came; one that is no number counts as not told."""
        value = float(message.param_value)
        if np.isfinite(value):
            self.values[str(message.param_id)] = value
        if self._list_at is not None and message.param_index < 65_535:
            self._listed.add(int(message.param_index))
            self._count, self._list_at = int(message.param_count), now

    def missing(self, slot: str) -> list[str]:
        """The parameters of a slot that are not known, nor known to be absent."""
        if self._count and len(self._listed) >= self._count:
            return [n for n in list_wanted(slot)[:3] if n not in self.values]
        return [name for name in list_wanted(slot) if name not in self.values]

    def pursue(self, slot: str, now: float) -> str:
        """Ask for what is missing when it is time to; a sentence where the vehicle stays silent."""
        missing = self.missing(slot)
        if not missing or now - self._asked_at.get(slot, -np.inf) < ASK_AGAIN_S:
            return ""
        self._asked_at[slot] = now
        self._rounds[slot] = self._rounds.get(slot, 0) + 1
        if self._rounds[slot] <= ROUNDS:
            for name in missing:
                self._ask(name)
        elif self._list_at is None:
            self._list_at = now
            self._ask_all()
        elif now - self._list_at > LIST_S:
            self._list_at, self._rounds[slot] = None, 0
            return f"the vehicle does not send {', '.join(missing[:3])}"
        return ""

    @property
    def table(self) -> Table:
        """The parameters as a log has them."""
        return Table(
            np.zeros(len(self.values), np.int64),
            {
                "Name": np.array([name.encode() for name in self.values], dtype="S16"),
                "Value": np.array(list(self.values.values())),
            },
        )
