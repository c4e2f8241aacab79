"""Reading MAVLink telemetry as ground stations record it, `.tlog`.

What telemetry calls raw is not: ArduPilot sends the readings of its compasses corrected, and so
does PX4 in HIGHRES_IMU. ArduPilot's are taken back with the parameters that went over the same
link; for that its messages are read as those of a dataflash log. Source: ArduPilot,
libraries/GCS_MAVLink/GCS_Common.cpp (send_raw_imu); PX4, src/modules/mavlink/streams/.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from agonic.arrays import Array, Mask
from agonic.errors import LogError
from agonic.logs.ardupilot import mavlink
from agonic.logs.ardupilot.compass import AXES, list_tracks, look_up, remove_correction
from agonic.logs.ardupilot.dataflash import find_firmware
from agonic.logs.ardupilot.dataflash_binary import load
from agonic.logs.log import Facts, Log, Readings, Stream
from agonic.logs.rows.auxiliary import find_misplaced
from agonic.logs.rows.tracks import Table, build_samples
from agonic.provenance import Input
from agonic.samples import Samples
from agonic.units import RAW

Heard = Mapping[str, mavlink.Messages]

ARDUPILOT, PX4, NO_AUTOPILOT = 3, 12, 8
STACKS = {ARDUPILOT: "ardupilot", PX4: "px4"}

SLOTS = {"RAW_IMU": "", "SCALED_IMU": "", "SCALED_IMU2": "2", "SCALED_IMU3": "3"}
"""The number of the compass in ArduPilot's parameters; the first two messages are of the same, and
so is HIGHRES_IMU, which is not read: send_highres_imu multiplies milligauss by 1000."""
WANTED = tuple(dict.fromkeys(("HEARTBEAT", *mavlink.TABLES, *mavlink.CLOCKED)))

_CORRECTED_ARDUPILOT = (
    "still corrected by the autopilot, for the log lacks its parameters (COMPASS_*); "
    "load them in the ground station while it records, or read the vehicle's own log (.bin)"
)
_CORRECTED_PX4 = (
    "still corrected by the autopilot, with its estimate of the bias in flight, which telemetry "
    "does not report; to calibrate the sensor read the vehicle's own log (.ulg)"
)
_MOTORS_LEFT = "the autopilot's compensation for the motors is not in telemetry and was left in"


def accepts(head: bytes) -> bool:
    """Whether a file that starts with these bytes is a telemetry log: two packets end to end."""
    packets = mavlink.find_packets(np.frombuffer(head, np.uint8))
    return bool((packets.start[1:] == packets.end[:-1]).any())


def read(path: Path, source: Input) -> Log:
    """The magnetometers of one vehicle in a telemetry log with all that was beside them."""
    known = mavlink.load_definitions()
    data = load(path)
    packets = mavlink.find_packets(data)
    wanted = {name: packets.select(packets.kind == known[name].id) for name in WANTED}
    heard = {name: mavlink.decode(data, some, known[name]) for name, some in wanted.items()}
    skipped = int(data.size - (packets.end - packets.start).sum())
    spoilt = sum(len(wanted[name]) - len(heard[name]) for name in WANTED)
    damage = []
    if skipped:
        damage.append(f"{skipped} bytes are damaged or cut off and were skipped")
    if spoilt:
        damage.append(f"{spoilt} messages with a wrong checksum were left out")
    vehicle, autopilot, others = _vehicle(heard)
    own = {name: messages.select(messages.sender == vehicle) for name, messages in heard.items()}
    timeline = mavlink.Timeline.of(own)
    tables = mavlink.make_tables(own, timeline)
    sensors = _sensors(tables, timeline.epoch, autopilot, source)
    if not sensors:
        reasons = f" ({'; '.join(damage)})" if damage else ""
        raise LogError(
            f"holds no readings of a magnetometer{reasons}; have the vehicle send RAW_IMU, "
            "SCALED_IMU2 and SCALED_IMU3 and record again",
            path=path,
        )
    names = {message.id: name for name, message in known.items()}
    sent = packets.select(packets.sender == vehicle)
    taken = {sensor.name for sensor in sensors}
    streams = []
    kinds, counts = np.unique(sent.kind, return_counts=True)
    for kind, rows in zip(kinds.tolist(), counts.tolist(), strict=True):
        if (name := names.get(kind, f"message {kind}")) not in taken:
            streams.append(Stream.at(name, rows, sent.received_us[sent.kind == kind] / 1e6))
    facts = Facts(path=path, source=source, format="MAVLink telemetry")
    notes = (*find_firmware(tables), *others, *damage)
    return Log.of(facts, sensors, streams, notes, STACKS.get(autopilot, ""))


def _vehicle(heard: Heard) -> tuple[int, int, tuple[str, ...]]:
    """The sender and the kind of the autopilot with most readings, and a note on the others."""
    beats = heard["HEARTBEAT"]
    beats = beats.select(beats.values["autopilot"] != NO_AUTOPILOT)
    autopilots = dict(zip(beats.sender.tolist(), beats.values["autopilot"].tolist(), strict=True))
    readings = Counter(
        sender for name in mavlink.READINGS for sender in heard[name].sender.tolist()
    )
    if not autopilots:
        unknown = "no heartbeat of an autopilot in the log: readings are taken as they were sent"
        return max(readings, key=readings.__getitem__, default=-1), NO_AUTOPILOT, (unknown,)
    chosen = max(autopilots, key=readings.__getitem__)
    system = chosen // 256
    others = sorted({sender // 256 for sender in autopilots} - {system})
    note = f"vehicle {system} was read; not read: {', '.join(map(str, others))}"
    return chosen, autopilots[chosen], (note,) if others else ()


def _sensors(
    tables: Mapping[str, Table], epoch: datetime, autopilot: int, source: Input
) -> tuple[Samples, ...]:
    """Each magnetometer of a vehicle that measures anything."""
    names = SLOTS if autopilot == ARDUPILOT else mavlink.READINGS
    measured = [name for name in names if name in tables and _find_answered(tables[name]).any()]
    if autopilot == ARDUPILOT and {"RAW_IMU", "SCALED_IMU"} <= set(measured):
        measured.remove("SCALED_IMU")
    motion = "RAW_IMU" if autopilot == ARDUPILOT else "HIGHRES_IMU"
    if motion in tables:
        tables = {**tables, "IMU": tables[motion]}
    return tuple(_samples(name, tables, epoch, autopilot, source) for name in measured)


def _field(mag: Table) -> Array:
    return np.stack([mag.columns[f"Mag{axis}"] for axis in AXES], axis=1)


def _find_answered(mag: Table) -> Mask:
    """Rows with a reading; zeros or NaN stand for a sensor that is not there or not ready."""
    field = _field(mag)
    return np.asarray(np.isfinite(field).all(axis=1) & field.any(axis=1))


def _samples(
    name: str, tables: Mapping[str, Table], epoch: datetime, autopilot: int, source: Input
) -> Samples:
    """One magnetometer, with everything else at its rows."""
    sent = tables[name]
    answered = sent.select(_find_answered(sent))
    wrong = find_misplaced(answered.columns["TimeUS"])
    mag = answered.select(~wrong)
    found = _readings(name, mag, tables.get("PARM"), autopilot)
    tracks = list_tracks(mag, tables)
    if found.frame != "b":  # the motion is in those axes
        tracks = (track for track in tracks if track.values.ndim == 1)
    rejected = {"no reading": len(sent) - len(answered), "time out of sequence": int(wrong.sum())}
    time = mag.time_s
    return build_samples(
        name, found, tracks, time=time, epoch=epoch, source=source, rejected=rejected
    )


def _readings(name: str, mag: Table, parameters: Table | None, autopilot: int) -> Readings:
    """The readings of one sensor, the autopilot's correction taken out where the log tells it."""
    if autopilot != ARDUPILOT:
        corrected = autopilot == PX4 and name == "HIGHRES_IMU"
        unit = RAW if name == "RAW_IMU" else "mG"  # the standard gives this one no unit
        notes = (_CORRECTED_PX4,) if corrected else ()
        frame = "b" if name == "HIGHRES_IMU" else "m"
        field = _field(mag)
        return Readings(field=field, unit=unit, frame=frame, corrected=corrected, notes=notes)
    slot = SLOTS[name]
    if parameters is None or not _is_loaded(parameters, slot):
        return Readings(field=_field(mag), unit="mG", corrected=True, notes=(_CORRECTED_ARDUPILOT,))
    found = remove_correction(mag, parameters, slot)
    motors = look_up(parameters, "COMPASS_MOTCT", mag.position).any()
    return replace(found, notes=(*found.notes, _MOTORS_LEFT)) if motors else found


def _is_loaded(parameters: Table, slot: str) -> bool:
    """Whether all parameters of a compass are there that its firmware has, none lost on the way."""
    names = {name.decode("latin-1") for name in parameters.columns["Name"].tolist()}
    offsets, *others = (
        {f"COMPASS_{part}{slot}_{axis}" for axis in AXES} for part in ("OFS", "DIA", "ODI")
    )
    matrix = {f"COMPASS_SCALE{slot}"}.union(*others)
    complete = len(names) >= parameters.columns["Count"].max()
    return offsets <= names and (complete or matrix <= names)
