"""The server of the live page: loopback by default, and no client can slow another."""

from __future__ import annotations

import asyncio
import hmac
import time
from collections.abc import Callable
from importlib.resources import files
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from agonic.live.web import messages
from agonic.live.web.session import Session
from agonic.live.web.watch import MAX_POINTS
from agonic.maths.equation.coverage import icosphere
from agonic.report.digits import group_digits
from agonic.report.page_file import read_static as of_report

MAX_MESSAGES = 20
"""Messages a second that a page may send, and wrong ones in all, before it is let go."""

LOOPBACK = ("127.0.0.1", "localhost", "::1")

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_TYPES = {"js": "text/javascript", "css": "text/css"}
_FILES: dict[str, Callable[[], str]] = {
    "live.js": lambda: _read_static("live.js"),
    "live.css": lambda: (
        of_report("base.css")
        + of_report("report.css")
        + _read_static("uplot/uPlot.min.css")
        + _read_static("live.css")
    ),
    "strips.js": lambda: _read_static("strips.js"),
    "rose.js": lambda: _read_static("rose.js"),
    "uplot.js": lambda: _read_static("uplot/uPlot.iife.min.js"),
    "canvas.js": lambda: of_report("canvas.js"),
}


def make_app(session: Session, *, token: str | None = None) -> Starlette:
    """The application; with a `token` only for those whose address has `?token=…`."""
    clients: set[WebSocket] = set()

    def allowed(connection: HTTPConnection) -> bool:
        if token is None:
            return _get_host(connection) in LOOPBACK
        return hmac.compare_digest(connection.query_params.get("token", ""), token)

    async def page(request: Request) -> Response:
        if not allowed(request):
            return _refuse()
        return _respond(_read_static("index.html"), "text/html")

    async def resource(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in _FILES:
            return PlainTextResponse("there is no such file", status_code=404)
        return _respond(_FILES[name](), _TYPES[name.rpartition(".")[2]])

    async def report(request: Request) -> Response:
        path = session.plan.folder / "report.html"
        if not allowed(request):
            return _refuse()
        if not path.is_file():
            return PlainTextResponse("there is no report yet: accept first", status_code=404)
        return FileResponse(path, headers={"Cache-Control": "no-store"})

    async def socket(websocket: WebSocket) -> None:
        full = len(clients) >= 64
        if full or not allowed(websocket) or not _has_same_origin(websocket):
            await websocket.close(code=1008)
            return
        await websocket.accept()
        clients.add(websocket)
        try:
            await _serve(websocket, session)
        finally:
            clients.discard(websocket)

    return Starlette(
        routes=[
            Route("/", page),
            Route("/static/{name}", resource),
            Route("/report", report),
            WebSocketRoute("/socket", socket),
        ]
    )


async def _serve(websocket: WebSocket, session: Session) -> None:
    """Talk to one page until it leaves."""
    tasks = [
        asyncio.create_task(_tell(websocket, session)),
        asyncio.create_task(_listen(websocket, session)),
    ]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _tell(websocket: WebSocket, session: Session) -> None:
    """Send what the page has not seen: the latest status, and points since the last ones.

    A page that reads slowly finds fewer points and always the present status; nothing is queued
    for it beyond the message under way.
    """
    await websocket.send_text(messages.encode(make_hello(session)).decode())
    version, seen = -1, list[Any]()
    while True:
        began = time.monotonic()
        if session.version != version:
            version = session.version
            await websocket.send_text(encode_status(session.status).decode())
        for k, shown in enumerate(session.shown):
            if k == len(seen):
                seen.append((shown, 0))
            before, count = seen[k]
            if before is not shown:  # begun anew: no rows, which is to forget the others
                count = 0
                await websocket.send_bytes(
                    messages.encode_points(k, 0, shown.at, np.empty((0, 3), np.float32))
                )
            total = shown.total
            rows = shown.since(max(count, total - MAX_POINTS), MAX_POINTS)[:5000]
            count = max(count, total - MAX_POINTS) + len(rows) if len(rows) else count
            seen[k] = (shown, count)
            if len(rows):
                await websocket.send_bytes(messages.encode_points(k, count, shown.at, rows))
        await asyncio.sleep(max(1 / 30 - (time.monotonic() - began), 0.001))


_last: tuple[messages.Status | None, bytes] = (None, b"")


def encode_status(status: messages.Status) -> bytes:
    """The JSON of a status, made once for all pages."""
    global _last
    if _last[0] is None or _last[0].version != status.version or _last[0] != status:
        _last = (status, messages.encode(status))
    return _last[1]


async def _listen(websocket: WebSocket, session: Session) -> None:
    """Do what the page asks for; one that sends too much or nonsense is let go."""
    wrong, second, lately = 0, 0.0, 0
    while True:
        try:
            message = await websocket.receive()
        except (WebSocketDisconnect, RuntimeError):
            return
        if message["type"] != "websocket.receive":
            return
        now = time.monotonic()
        second, lately = (now, 1) if now - second > 1.0 else (second, lately + 1)
        data = message.get("text") or message.get("bytes") or b""
        what = messages.parse_request(data) if len(data) <= messages.MAX_REQUEST_BYTES else None
        wrong += what is None
        if wrong > MAX_MESSAGES or lately > MAX_MESSAGES:
            await websocket.close(code=1008, reason="too many messages, or not understood")
            return
        if what is not None:
            _do(what, session)


def _do(what: messages.PageRequest, session: Session) -> None:
    """What a page asks for, beside the server where it takes a while."""
    if isinstance(what, messages.Restart):
        session.restart(what.sensor)
    elif isinstance(what, messages.Offer) and not what.sensor:
        session.offer("")  # at once: an offer that is asked for next may not be overtaken
    elif isinstance(what, messages.Accept):
        Thread(target=session.accept, daemon=True).start()
    else:
        work = session.offer if isinstance(what, messages.Offer) else session.write
        Thread(target=work, args=[what.sensor], daemon=True).start()


def make_hello(session: Session) -> messages.Hello:
    """The first message of a session."""
    reference = session.plan.reference
    told = "unknown: bias and shape are still found, the scale is that of the sensor"
    if reference is not None:
        told = f"{group_digits(float(reference.magnitudes(1)[0]))} nT ({reference.source})"
    return messages.Hello(
        source=session.source.name,
        folder=str(session.plan.folder),
        reference=told,
        corners=[float(v) for v in icosphere()[1].round(4).ravel()],
    )


def _read_static(name: str) -> str:
    return (files("agonic.live.web") / "static" / name).read_text(encoding="utf-8")


def _respond(text: str, kind: str) -> Response:
    headers = {
        "Content-Security-Policy": POLICY,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
    }
    return Response(text, media_type=f"{kind}; charset=utf-8", headers=headers)


def _refuse() -> Response:
    return PlainTextResponse(
        "Not allowed: open the address that agonic live printed.\n", status_code=403
    )


def _get_host(connection: HTTPConnection) -> str:
    """The name by which the page was asked for; not ours where a foreign name points here."""
    try:
        return urlsplit(f"//{connection.headers.get('host', '')}").hostname or ""
    except ValueError:
        return ""


def _has_same_origin(websocket: WebSocket) -> bool:
    """Whether a browser's page is one of ours, scheme and all; programs send no origin."""
    origin = websocket.headers.get("origin")
    scheme = "https" if websocket.scope["scheme"] == "wss" else "http"
    return origin is None or origin == f"{scheme}://{websocket.headers.get('host', '')}"
