"""Serving the live page until it is interrupted."""

from __future__ import annotations

import asyncio
import ipaddress
import secrets
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from agonic.errors import AgonicError
from agonic.live.web.app import make_app
from agonic.live.web.messages import MAX_REQUEST_BYTES
from agonic.live.web.session import Session


class _Server(uvicorn.Server):
    """Tells when it can be reached."""

    ready: Callable[[], None] = staticmethod(lambda: None)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if not self.should_exit:
            self.ready()


def serve(session: Session, *, listen: str | None, port: int, ready: Callable[[str], None]) -> None:
    """Serve the page of a session, and read its source, until interrupted. `listen` is an address
    of this machine to listen on instead of loopback; then the page's address holds a secret.
    `ready` is told the address of the page."""
    token = None if listen is None else secrets.token_urlsafe(16)
    host = listen or "127.0.0.1"
    bound = _bind(host, port)
    address = _make_address(host, bound.getsockname()[1], token)
    config = uvicorn.Config(
        make_app(session, token=token),
        log_level="critical",
        access_log=False,
        lifespan="off",
        http=Requests,
        ws="websockets-sansio",
        ws_max_size=MAX_REQUEST_BYTES,
        ws_max_queue=4,
        ws_per_message_deflate=False,
        ws_ping_interval=10.0,
        ws_ping_timeout=10.0,
        timeout_graceful_shutdown=1,
        limit_concurrency=256,
        h11_max_incomplete_event_size=16_384,
    )
    server = _Server(config)
    server.ready = lambda: ready(address)
    session.start()
    try:
        with suppress(KeyboardInterrupt):
            server.run(sockets=[bound])
    finally:
        session.stop()
        bound.close()


def _bind(host: str, port: int) -> socket.socket:
    """A socket at the address; `AgonicError` where it is taken or not ours."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
    except OSError as error:
        bound.close()
        raise AgonicError(
            f"cannot listen on {host}:{port}: {error.strerror or error}; give another --port"
        ) from None
    return bound


def _make_address(host: str, port: int, token: str | None) -> str:
    """The address of the page, for this machine where it listens on all."""
    with suppress(ValueError):
        if ipaddress.ip_address(host).is_unspecified:
            host = socket.gethostname()
    host = f"[{host}]" if ":" in host else host
    return f"http://{host}:{port}/" + (f"?token={token}" if token else "")


REQUEST_S = 10.0
"""A request must be whole after so long."""


class Requests(H11Protocol):
    """Lets connections go whose requests are never finished, so that they lock nobody out."""

    _limit: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait, and drop who has waited longest where too many wait."""
        super().connection_made(transport)
        self._limit = self.loop.call_later(REQUEST_S, self._drop)
        others = (one for one in self.connections if isinstance(one, Requests))
        waiting = [one for one in others if one._limit is not None]
        if len(waiting) > 64:
            min(waiting, key=lambda one: one._limit.when() if one._limit else 0.0)._drop()

    def data_received(self, data: bytes) -> None:
        """Take bytes; what is not whole after them has its time."""
        super().data_received(data)
        cycle: Any = self.cycle
        answering = cycle is not None and not cycle.more_body
        if self.transport.get_protocol() is not self or answering:
            self._forget()
        elif self._limit is None:
            self._limit = self.loop.call_later(REQUEST_S, self._drop)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nothing is waited for any more."""
        self._forget()
        super().connection_lost(exc)

    def _forget(self) -> None:
        if self._limit is not None:
            self._limit.cancel()
            self._limit = None

    def _drop(self) -> None:
        self._forget()
        self.transport.abort()
