"""`open_source`: the source that a word on the command line names."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any
from urllib.parse import SplitResult, parse_qsl, urlsplit

from agonic.errors import AgonicError
from agonic.live.streams.connection import Connection, LineDecoder
from agonic.live.streams.links import Link, SerialLink, StandardInput, TcpLink, UdpLink
from agonic.live.streams.replay import Replay, make_simulated, replay_log
from agonic.units import RAW, find_unit

FORMS = (
    "serial:/dev/ttyUSB0[:115200], udp://[HOST]:PORT, tcp://HOST:PORT, mavlink+udp://[HOST]:PORT, "
    "mavlink+tcp://HOST:PORT, mavlink+serial:/dev/ttyACM0[:115200], a log, or sim"
)
_PORT = re.compile(r"(/dev/(?:tty|cu\.|serial/)[^:]*|COM\d+)(:\d+)?", re.IGNORECASE)
"""A serial port by its own name, and a speed."""
_SETTINGS = {"kind": str, "rate": float, "sensors": int, "seed": int, "minutes": float}


Source = Connection | Replay
"""Where readings come from: `events` yields until `stop` is set or there are no more; `lasting`
where a source that is opened again goes on, rather than begins again."""


def open_source(
    text: str, *, unit: str | None = None, speed: float = 1.0, mark: str | None = None
) -> Source:
    """The source of live readings that a text names."""
    find_unit(unit or RAW)
    if not 0 <= speed < math.inf:
        raise AgonicError(f"speed {speed:g} is not possible: 1 is as recorded, 0 the fastest")
    mavlink = text.startswith("mavlink+")
    named = text.removeprefix("mavlink+")
    wire, _, rest = (
        f"serial:{named}".partition(":") if _PORT.fullmatch(named) else named.partition(":")
    )
    if wire in ("serial", "udp", "tcp") and rest:
        link = (
            _parse_serial(rest) if wire == "serial" else _parse_network(text, urlsplit(text), wire)
        )
        if not mavlink:
            return Connection(link, LineDecoder(unit or RAW, mark))
        from agonic.live.streams.vehicle import Vehicle

        return Connection(link, Vehicle())
    if text == "-":
        return Connection(StandardInput(), LineDecoder(unit or RAW, mark))
    if text == "sim" or text.startswith("sim?"):
        return make_simulated(speed=speed, **_parse_settings(text.partition("?")[2]))
    if mavlink or "://" in text:
        raise AgonicError(f"{text!r} names no source; use {FORMS}")
    return replay_log(Path(text), speed, unit)


def _parse_serial(rest: str) -> SerialLink:
    device, _, baud = rest.removeprefix("//").rpartition(":")
    if device and baud.isdecimal():
        return SerialLink(device, int(baud))
    return SerialLink(rest.removeprefix("//"), 115_200)


def _parse_network(text: str, parts: SplitResult, wire: str) -> Link:
    try:
        host, port = parts.hostname or "", parts.port
    except ValueError:
        host, port = "", None
    if not port or (wire == "tcp" and not host):
        raise AgonicError(f"{text!r} needs {'HOST:' if wire == 'tcp' else ''}PORT; use {FORMS}")
    return TcpLink(host, port) if wire == "tcp" else UdpLink(host or "127.0.0.1", port)


def _parse_settings(query: str) -> dict[str, Any]:
    """The settings in `kind=tumble&rate=100`."""
    given: dict[str, Any] = {}
    for name, value in parse_qsl(query, keep_blank_values=True):
        if name not in _SETTINGS:
            raise AgonicError(f"sim has no setting {name!r}; it takes {', '.join(_SETTINGS)}")
        try:
            given[name] = _SETTINGS[name](value)
        except ValueError:
            raise AgonicError(f"{name}={value} is not a number") from None
        if name not in ("kind", "seed") and not given[name] > 0:
            raise AgonicError(f"{name}={value}: it must be above zero")
    if "rate" in given:
        given["rate_Hz"] = given.pop("rate")
    return given
