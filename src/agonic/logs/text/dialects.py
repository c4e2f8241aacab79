"""The table of dialects: rows of text whose layout their writer documents, and no header tells.

A new dialect is one row of `DIALECTS` and one sample in `tests/logs/test_dialects.py`. Tables with
a header are in `headers.conventions`; what names its own numbers needs no row at all.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple


class Cell(NamedTuple):
    """A cell of a row: its header, the counts of a unit, and its name in rows that name cells."""

    header: str
    counts: float = 1.0
    theirs: str = ""


class Kind(NamedTuple):
    """A kind of rows: its cells in order, and how the writer had corrected them, if it had."""

    cells: tuple[Cell, ...]
    corrected: str = ""


def _kind(cells: str, corrected: str = "") -> Kind:
    """A kind in short: canonical names, `name/n` where a unit is n counts, `theirs=name`.

    >>> _kind("time_s xmag=mag_x_mG/10").cells[1]
    Cell(header='mag_x_mG', counts=10.0, theirs='xmag')
    """
    found = (re.fullmatch(r"(?:(\w+)=)?(\w+)(?:/(\S+))?", cell) for cell in cells.split())
    return Kind(
        tuple(Cell(m[2], float(m[3] or 1), m[1] or "") for m in found if m is not None), corrected
    )


def _vectors(*names: str, counts: int = 1) -> str:
    """The cells of vectors, each `name` or `name_unit`, by their axes.

    >>> _vectors("acc_g", counts=8192)
    'acc_x_g/8192 acc_y_g/8192 acc_z_g/8192'
    """
    split = [name.partition("_") for name in names]
    behind = f"/{counts}" * (counts != 1)
    return " ".join(f"{n}_{axis}{_}{unit}{behind}" for n, _, unit in split for axis in "xyz")


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How the rows of a text are known and what they hold.

    `row` is a row, its groups `kind` and `cells`, and `before` for a cell before the kind. `above`
    must stand in the first lines, and `share` of the rows be such rows. `pair` is a cell with its
    name in rows that name them, `separator` what parts the others (`None`: blanks).
    """

    name: str
    row: re.Pattern[str]
    kinds: Mapping[str, Kind]
    source: str
    above: str = ""
    share: float = 0.5
    separator: str | None = ","
    pair: re.Pattern[str] | None = None


_AUTOPILOT = (
    "the autopilot had corrected these readings; read its own log (.bin, .ulg), or its telemetry "
    "(.tlog) with the parameters in it"
)
_MAVLINK_AXES = " ".join(f"{a}mag=mag_{a}_mG {a}acc=acc_{a}_mg" for a in "xyz")
_MAVLINK_GYRO = " ".join(f"{a}gyro=gyro_{a}_rad_s/1000" for a in "xyz")
_IMU = f"{_MAVLINK_AXES} {_MAVLINK_GYRO}"
MAVLINK = {
    "RAW_IMU": _kind(f"time_usec=time_us {_IMU}", _AUTOPILOT),
    **{f"SCALED_IMU{n}": _kind(f"time_boot_ms=time_ms {_IMU}", _AUTOPILOT) for n in ("", "2", "3")},
    "ATTITUDE": _kind("time_boot_ms=time_ms roll=roll_rad pitch=pitch_rad yaw=yaw_rad"),
    "GLOBAL_POSITION_INT": _kind(
        "time_boot_ms=time_ms lat=latitude_deg/1e7 lon=longitude_deg/1e7 alt=altitude_m/1000"
    ),
}
"""Messages that hold a field or what is used beside it, with the units of common.xml."""


_VECTORNAV = _vectors("mag_G", "acc_m_s2", "gyro_rad_s")
_EULER = "yaw_deg pitch_deg roll_deg"
_BY_DEVICE = "{} holds readings that the device has corrected; have it send $VNIMU"
SENTENCES = {
    "VNIMU": _kind(f"{_VECTORNAV} temperature_C"),
    "PCHRSMAG": _kind(f"{_vectors('mag')} t"),
    "VNMAG": _kind(_vectors("mag_G"), _BY_DEVICE),
    "VNMAR": _kind(_VECTORNAV, _BY_DEVICE),
    "VNYMR": _kind(f"{_EULER} {_VECTORNAV}", _BY_DEVICE),
    "VNQMR": _kind(f"qx qy qz qw {_VECTORNAV}", _BY_DEVICE),
}
"""Sentences with a checksum, which `sentences` takes apart: VectorNav, VN-100 Interface Control
Document, ASCII messages; CH Robotics, UM7 datasheet, $PCHRS."""

DIALECTS = (
    Dialect(
        name="MotionCal text",
        row=re.compile(r"Raw:(?P<cells>.*)"),  # among lines of other kinds (Uni:, Ori:, Cal1:)
        share=0.25,
        kinds={
            "": _kind(
                f"{_vectors('acc_g', counts=8192)} {_vectors('gyro_deg_s', counts=16)} "
                f"{_vectors('mag_mG')}"
            )
        },
        source="PaulStoffregen/MotionCal: imuread.h, where a magnetic count is 0.1 µT",
    ),
    Dialect(
        name="MAVLink as text",
        row=re.compile(r"\d{4}-\d\d-\d\d [\d:.]+: (?P<kind>[A-Z]\w+) \{(?P<cells>.*)\}"),
        pair=re.compile(r"(\w+) : ([-+.\deE]+)"),
        kinds=MAVLINK,
        source="ArduPilot/pymavlink: tools/mavlogdump.py; mavlink/mavlink: common.xml",
    ),
    Dialect(
        name="MAVLink telemetry of Mission Planner",
        row=re.compile(r"\d{4}-\d\d-\d\dT[^,]*,F[DE],.*?,mavlink_(?P<kind>\w+)_t,(?P<cells>.*)"),
        pair=re.compile(r"([a-z]\w*),([-+.\deE]+)"),
        kinds=MAVLINK,
        source="ArduPilot/MissionPlanner: Log/MavlinkLog.cs, telemetry to CSV; common.xml",
    ),
    Dialect(
        name="Paparazzi messages",
        row=re.compile(
            r"(?P<before>\d+\.\d+) \d+ (?P<kind>[A-Z]\w*)(?: \d+)? (?P<cells>\S+ \S+ \S+)$"
        ),
        separator=None,
        kinds={
            "IMU_MAG_RAW": _kind(f"time_s {_vectors('mag')}"),
            "IMU_ACCEL_RAW": _kind(f"time_s {_vectors('acc_raw')}"),
            "IMU_ACCEL_SCALED": _kind(f"time_s {_vectors('acc_m_s2', counts=1024)}"),
            "IMU_GYRO_SCALED": _kind(
                "time_s gyro_x_rad_s/4096 gyro_y_rad_s/4096 gyro_z_rad_s/4096"
            ),
            "IMU_ACCEL": _kind(f"time_s {_vectors('acc_m_s2')}"),
            "IMU_GYRO": _kind(f"time_s {_vectors('gyro_rad_s')}"),
        },
        source="paparazzi/pprzlink: message_definitions/v1.0/messages.xml; before 6.0 without id",
    ),
    Dialect(
        name="TopoDroid calibration",
        above="created by TopoDroid",
        row=re.compile(r"\d+, (?P<cells>(?:-?\d+, ){6})-?(?P<before>\d+),"),
        kinds={"": _kind(f"target {_vectors('acc_g', counts=24000)} {_vectors('mag_raw')}")},
        source="marcocorvi/topodroid: export of calibrations, TDUtil.FV = 24000 counts of gravity; "
        "shots of a group are along one line",
    ),
)


def find_dialect(head: Sequence[str], rows: Sequence[str]) -> Dialect | None:
    """The dialect of a text by its first lines, and by those of them that hold values."""
    return next((dialect for dialect in DIALECTS if _fits(dialect, head, rows)), None)


def _fits(dialect: Dialect, head: Sequence[str], rows: Sequence[str]) -> bool:
    if dialect.above and not any(dialect.above in line for line in head):
        return False
    found = [match for row in rows if (match := dialect.row.match(row))]
    kinds = {name_kind(match.groupdict().get("kind", ""), dialect) for match in found}
    known = [dialect.kinds[kind] for kind in kinds & dialect.kinds.keys()]
    field = any(cell.header.startswith("mag_x") for kind in known for cell in kind.cells)
    return field and len(found) > dialect.share * len(rows)


def name_kind(written: str, dialect: Dialect) -> str:
    """The kind of a row, as the dialect names it."""
    kind = written.strip()
    return kind if kind in dialect.kinds else kind.upper()
