"""`Requests`: the HTTP protocol of the live page, which waits for no request for ever."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_S = 10.0
"""A request must be whole after so long."""

MOST_UNFINISHED = 64
"""Connections without a whole request; the oldest makes room for another."""


class Requests(H11Protocol):
    """Lets connections go whose requests are never finished, so that they lock nobody out."""

    _limit: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait, and drop who has waited longest where too many wait."""
        super().connection_made(transport)
        self._limit = self.loop.call_later(REQUEST_S, self._drop)
        others = (one for one in self.connections if isinstance(one, Requests))
        waiting = [one for one in others if one._limit is not None]
        if len(waiting) > MOST_UNFINISHED:
            min(waiting, key=lambda one: one._limit.when() if one._limit else 0.0)._drop()

    def data_received(self, data: bytes) -> None:
        """Take bytes; what is not whole after them has its time."""
        super().data_received(data)
        if self.transport.get_protocol() is not self or self._is_answering():
            self._forget()
        elif self._limit is None:
            self._limit = self.loop.call_later(REQUEST_S, self._drop)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nothing is waited for any more."""
        self._forget()
        super().connection_lost(exc)

    def _is_answering(self) -> bool:
        cycle: Any = self.cycle
        return cycle is not None and not cycle.more_body

    def _forget(self) -> None:
        if self._limit is not None:
            self._limit.cancel()
            self._limit = None

    def _drop(self) -> None:
        self._forget()
        self.transport.abort()
