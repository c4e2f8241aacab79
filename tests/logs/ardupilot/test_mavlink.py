"""Taking telemetry logs apart: every packet and every field as pymavlink finds them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agonic.logs.ardupilot.dataflash_binary import load
from agonic.logs.ardupilot.mavlink import decode, find_packets, load_definitions
from agonic.logs.ardupilot.tlog import WANTED
from tests.logs.tlog_writer import tlog


@pytest.mark.parametrize("form", [{"version": 1}, {"version": 2}, {"signed": True}])
def test_every_field_as_pymavlink_packs_it(tmp_path: Path, form: dict[str, Any]) -> None:
    rng = np.random.default_rng(5)
    path = tmp_path / "fields.tlog"
    known = load_definitions()
    sent = [(0.0, name, filled(known[name], rng)) for name in WANTED for _ in range(5)]
    path.write_bytes(tlog(sent, **form))
    assert compare_with_pymavlink(path) == set(WANTED)


def filled(message: Any, rng: np.random.Generator) -> dict[str, Any]:
    """Numbers of chance, and zeros from some field on: those MAVLink 2 does not send."""
    described = zip(
        message.ordered_fieldnames, message.native_format[1:], message.array_lengths, strict=True
    )
    first_zero = rng.integers(1, len(message.ordered_fieldnames) + 1)
    fields: dict[str, Any] = {}
    for name, letter, n in list(described)[:first_zero]:
        numbers = rng.integers(0, 100, n or 1).tolist()
        fields[name] = b"text" if chr(letter) == "c" else numbers if n else numbers[0]
    return fields


@pytest.mark.recordings
def test_a_recording_as_pymavlink_reads_it(recordings: Path) -> None:
    seen = compare_with_pymavlink(recordings / "vehicle/ardusub/small.tlog")
    assert set(WANTED) - seen == {"HIGHRES_IMU", "SCALED_IMU", "SCALED_IMU3"}


def compare_with_pymavlink(path: Path) -> set[str]:
    """Decode a whole log twice; the names of the wanted messages in it."""
    link, theirs = mavlink.MAVLink(None), dict[str, list[Any]]()
    data = load(path)
    packets = find_packets(data)
    assert (packets.end[:-1] == packets.start[1:]).all()
    assert (packets.start[0], packets.end[-1]) == (0, len(data))
    for start, end in zip(packets.start.tolist(), packets.end.tolist(), strict=True):
        try:
            message = link.decode(bytearray(data[start + 8 : end]))
        except mavlink.MAVError:  # of kinds that are not wanted
            continue
        theirs.setdefault(message.get_type(), []).append(message)
    for name, message in load_definitions().items():
        if name in WANTED and name in theirs:
            ours = decode(data, packets.select(packets.kind == message.id), message)
            sent_by = [m.get_srcSystem() * 256 + m.get_srcComponent() for m in theirs[name]]
            assert ours.sender.tolist() == sent_by
            for field in ours.names:
                values = ours.values[field].tolist()
                plain = [v.decode("latin-1") if isinstance(v, bytes) else v for v in values]
                np.testing.assert_array_equal(plain, [getattr(m, field) for m in theirs[name]])
    return theirs.keys() & set(WANTED)
