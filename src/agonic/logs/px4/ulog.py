"""Reading PX4 logs, `.ulg`, with pyulog.

The magnetometers come out as their sensors measured them, in the sensors' own axes; what the
vehicle corrects them with is kept as `logged`. Attitude and position are those of the autopilot.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import explain_damage
from agonic.logs.log import Facts, Log, Readings, Stream
from agonic.logs.px4.topics import BESIDE, find_utc_of_boot, list_headings, list_tracks
from agonic.logs.rows.auxiliary import find_misplaced
from agonic.logs.rows.tracks import Table, Tables, Track, build_samples
from agonic.maths.equation.affine import correct
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.provenance import Input
from agonic.samples import Logged, Samples
from agonic.units import NANOTESLA_PER

Parameters = Mapping[str, Any]

SLOTS = tuple(f"CAL_MAG{n}" for n in range(4))
PRIMARY = "CAL_MAG_PRIME"
_LETTERS = "XYZ"


def remove_correction(
    field: Array, parameters: Parameters, *, in_body: bool, device_id: int | None, external: bool
) -> Readings:
    """Take out of the readings (n, 3) of one sensor, nT, what the vehicle had done to them.
    `in_body` tells a corrected topic, in body axes, from `sensor_mag`; `device_id` names the
    sensor, `None` the primary one; `external` is true for a sensor that is not on the board."""
    wanted = int(read_number(parameters, PRIMARY)) if device_id is None else device_id
    ids = {slot: int(read_number(parameters, f"{slot}_ID")) for slot in SLOTS if wanted}
    # parameters are signed, device ids in topics are not
    slot = next((slot for slot, own in ids.items() if (own - wanted) % 2**32 == 0), None)
    logged = read_correction(parameters, slot) if slot else None
    rotation_bm = read_mounting(parameters, slot, external)
    notes: tuple[str, ...] = ()
    if in_body and (logged is None or rotation_bm is None):
        notes = ("already corrected by the autopilot, in a way that the log does not state",)
        return Readings(field=field, rotation_bm=Rotation.identity(), notes=notes, corrected=True)
    if in_body and rotation_bm is not None:
        field = rotation_bm.apply(field, inverse=True)
        if read_number(parameters, "CAL_MAG_COMP_TYP"):
            notes = (*notes, "the vehicle's compensation for power is still in the readings")
    if logged is not None and (in_body or is_corrected_by_driver(parameters)):
        inverse: Array = np.linalg.inv(logged.matrix).astype(np.float64)
        field = correct(field, np.zeros(3), inverse) + logged.bias
    return Readings(field=field, frame="m", rotation_bm=rotation_bm, logged=logged, notes=notes)


def read_correction(parameters: Parameters, slot: str) -> Logged | None:
    """OFF and S of a slot, or `None` where its numbers cannot be a calibration."""
    bias = np.array([read_number(parameters, f"{slot}_{axis}OFF") for axis in _LETTERS])
    diagonal = [read_number(parameters, f"{slot}_{axis}SCALE", 1.0) for axis in _LETTERS]
    matrix = unpack_symmetric(
        [*diagonal, *(read_number(parameters, f"{slot}_{axis}ODIAG") for axis in _LETTERS)]
    )
    if max(np.abs(matrix).max(), np.abs(bias).max()) > 100 or abs(np.linalg.det(matrix)) < 1e-3:
        return None
    return Logged(
        bias=bias * NANOTESLA_PER["G"], matrix=matrix, source=f"{slot}_* parameters in the log"
    )


def is_corrected_by_driver(parameters: Parameters) -> bool:
    """Whether `sensor_mag` carries the correction already. Up to v1.11 the drivers applied it
    (src/lib/drivers/magnetometer/PX4Magnetometer.cpp there). Such logs name a primary magnetometer
    and know no off-diagonals; later ones the reverse."""
    off_diagonal = any(f"{slot}_XODIAG" in parameters for slot in SLOTS)
    return PRIMARY in parameters and not off_diagonal


def read_mounting(parameters: Parameters, slot: str | None, external: bool) -> Rotation | None:
    """The rotation from sensor to body axes where it is no more than the levelling of the board.
    Larger turns are in the log as a mere number; they give `None`."""
    own = read_number(parameters, f"{slot}_ROT", -1.0) if slot else 0.0 if external else -1.0
    if (read_number(parameters, "SENS_BOARD_ROT") if own < 0 else own) != 0:
        return None
    roll, pitch, yaw = (read_number(parameters, f"SENS_BOARD_{axis}_OFF") for axis in _LETTERS)
    return Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True)


def read_number(parameters: Parameters, name: str, missing: float = 0.0) -> float:
    """A parameter as a number; `missing` where it is absent or damaged."""
    value = parameters.get(name)
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else missing


RAW, CORRECTED, COMBINED = "sensor_mag", "vehicle_magnetometer", "sensor_combined"
_GAUSS = [f"magnetometer_ga[{k}]" for k, _ in enumerate("xyz")]
AXES = {RAW: ["x", "y", "z"], CORRECTED: _GAUSS, COMBINED: _GAUSS}
"""The topics with a field, best first, and the columns that hold it, gauss."""


def read(path: Path, source: Input) -> Log:
    """The magnetometers of a PX4 log with all that was recorded beside them. Topics that have no
    bearing on a magnetometer are neither decoded nor listed."""
    ulog = _parse(path)
    topics = {
        f"{d.name}[{d.multi_id}]": Table(np.arange(len(d.data["timestamp"])), d.data)
        for d in ulog.data_list
        if "timestamp" in d.data
    }
    names = _find_magnetometers(topics)
    sensors, left_out = [], []
    for name in names:
        try:
            sensors.append(_read_samples(name, topics, ulog.initial_parameters, source))
        except LogError as error:
            left_out.append(f"{name} was left out: {error}")
    if not sensors:
        reasons = f" ({'; '.join(left_out)})" if left_out else ""
        raise LogError(
            f"holds no readings of {RAW}, {CORRECTED} or {COMBINED}.magnetometer_ga{reasons}; "
            "log sensor_mag and record again",
            path=path,
        )
    others = {name: topics[name] for name in sorted(topics) if name not in names}
    streams = [Stream.at(name, len(topic), topic.time_s) for name, topic in others.items()]
    facts = Facts(path=path, source=source, format="PX4 ULog")
    return Log.of(facts, sensors, streams, (*_notes(ulog), *left_out), "px4")


def _parse(path: Path) -> Any:
    """The log as pyulog understands it, without what it prints on the way."""
    from pyulog import ULog

    with (
        _Forward(path.open("rb", buffering=0)) as stream,
        redirect_stdout(io.StringIO()),
        explain_damage("cannot be read as a PX4 log"),
    ):
        return ULog(stream, (RAW, CORRECTED, *BESIDE))


class _Forward(io.BufferedReader):
    """A file in which pyulog cannot go round in circles.

    Where a file ends among its definitions, pyulog steps back by the length that the last message
    claims, not by what is left of it, and meets the same bytes for ever (1.3.0, core.py,
    `_read_file_definitions`). Here a step to before that message ends one byte after its start.
    Definitions end with a step to the start of a whole message; data are then read as they are.
    """

    _since_header = 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self._since_header = len(data) + (0 if size == 3 else self._since_header)  # length and type
        return data

    def seek(self, target: int, whence: int = io.SEEK_SET, /) -> int:
        if whence == io.SEEK_CUR and -target > self._since_header:
            target = 1 - self._since_header
        elif whence == io.SEEK_CUR and -target == self._since_header:
            self.read, self.seek = super().read, super().seek  # type: ignore[method-assign]
        return super().seek(target, whence)


def _find_magnetometers(topics: Tables) -> list[str]:
    """The raw topics, or what there is instead; before them a corrected one of more than five times
    the rows: it is what was meant to be recorded."""
    kinds = []
    for kind, columns in AXES.items():
        names = [
            n for n in topics if n.startswith(f"{kind}[") and {*columns} <= {*topics[n].columns}
        ]
        if names:
            kinds.append(sorted(names))
    if not kinds:
        return []
    rows = [max(len(topics[name]) for name in names) for names in kinds]
    longest = rows.index(max(rows))
    return [*(kinds[longest] if 5 * rows[0] < rows[longest] else []), *kinds[0]]


@np.errstate(all="ignore")  # damaged numbers overflow; Samples leaves out what is not finite
def _read_samples(name: str, topics: Tables, parameters: Parameters, source: Input) -> Samples:
    """One magnetometer, with everything else at its rows."""
    topic, time, wrong = _select_readings(topics[name])
    gauss = topic.stack(*AXES[name.split("[")[0]])
    if gauss is None or not len(time):
        raise LogError("it has no new readings")
    device, external = topic.get("device_id"), topic.get("is_external")
    device_id = None if device is None else int(device[0])
    found = remove_correction(
        gauss.astype(np.float64) * NANOTESLA_PER["G"],
        parameters,
        in_body=not name.startswith(RAW),
        device_id=device_id,
        external=external is not None and bool(external[0]),
    )
    tracks = [*list_tracks(topics, time, found.rotation_bm)]
    temperature = topic.columns.get("temperature", np.zeros(0))
    if np.nan_to_num(temperature).any():  # zero throughout means that it has none
        tracks.append(Track("temperature", time, temperature, time))
    return build_samples(
        name,
        replace(found, device_id=device_id),
        tracks,
        time=time,
        epoch=find_utc_of_boot(topics),
        source=source,
        rejected={"time out of sequence": wrong},
        headings=list_headings(topics),
    )


def _select_readings(topic: Table) -> tuple[Table, Array, int]:
    """The new readings of one device, their times in seconds, and how many times made no sense. An
    instance may change hands between devices: the one with most readings is taken."""
    time, rows = topic.time_s, np.arange(len(topic))
    assert time is not None
    if (device := topic.get("device_id")) is not None:
        devices, counts = np.unique(device, return_counts=True)
        rows = np.flatnonzero(device == devices[counts.argmax()])
    if (behind := topic.get("magnetometer_timestamp_relative")) is not None:
        time = time + behind / 1e6
        rows = np.flatnonzero(behind != 0x7FFFFFFF)  # which stands for no new reading
        # readings that are repeated keep their time, but for some microseconds
        rows = rows[np.diff(time[rows], prepend=-np.inf) > 5e-4]
    wrong = find_misplaced(time[rows])
    rows = rows[~wrong]
    return topic.select(rows), time[rows], int(wrong.sum())


def _notes(ulog: Any) -> tuple[str, ...]:
    """Firmware, damage, gaps, and a correction that changed on the way."""
    notes = []
    if isinstance(version := ulog.msg_info_dict.get("ver_sw_release"), int):
        notes.append("firmware PX4 v" + ".".join(str(version >> s & 255) for s in (24, 16, 8)))
    if ulog.file_corruption:
        notes.append("the file is damaged; what could be read was read")
    if ulog.dropouts:
        lost = sum(dropout.duration for dropout in ulog.dropouts)
        notes.append(f"the logger dropped out {len(ulog.dropouts)} times, for {lost} ms in all")
    changed = sorted({name for _, name, _ in ulog.changed_parameters if name.startswith("CAL_MAG")})
    if changed:
        notes.append(f"{', '.join(changed)} changed on the way; the first values were used")
    return tuple(notes)
