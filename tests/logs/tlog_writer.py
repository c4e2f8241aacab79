"""Telemetry logs made of packets that pymavlink packs."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

START_S = 1_700_000_000.0
"""When the vehicle was started, by the clock of the ground station."""

Sent = tuple[float, str, dict[str, Any]]
"""Seconds after the start at which a message arrives, its name, its fields."""


def tlog(messages: Iterable[Sent], start_s: float = START_S, **sender: Any) -> bytes:
    """The bytes of a log with these messages in their order."""
    return b"".join(
        stamped(start_s + seconds, packet(name, fields, **sender))
        for seconds, name, fields in messages
    )


def stamped(seconds: float, packed: bytes) -> bytes:
    return struct.pack(">Q", round(seconds * 1e6)) + packed


def packet(
    name: str,
    fields: dict[str, Any],
    *,
    system: int = 1,
    component: int = 1,
    version: int = 2,
    signed: bool = False,
) -> bytes:
    """A packet of MAVLink 1 or 2; fields that are not given are zero."""
    kind = getattr(mavlink, f"MAVLink_{name.lower()}_message")
    values = []
    for field in kind.fieldnames:
        place = kind.ordered_fieldnames.index(field)
        size, letter = kind.array_lengths[place], chr(kind.native_format[1 + place])
        zero = b"" if letter == "c" else [0] * size if size else 0
        values.append(fields.get(field, zero))
    link = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    link.signing.sign_outgoing = signed
    link.signing.secret_key = bytes(32)
    return bytes(kind(*values).pack(link, force_mavlink1=version == 1))


def heartbeat(autopilot: int) -> tuple[str, dict[str, Any]]:
    return "HEARTBEAT", {"autopilot": autopilot, "type": 2}


def parameters(values: dict[str, float], count: int | None = None) -> list[Sent]:
    """What a vehicle answers, before its start by this clock, when asked for its parameters."""
    return [
        (
            -1.0 + 1e-3 * k,
            "PARAM_VALUE",
            {"param_id": name.encode(), "param_value": value, "param_count": count or len(values)},
        )
        for k, (name, value) in enumerate(values.items())
    ]
