"""Units, clocks and quaternions that a format fixes in its documents, where its headers do not.

A format is known by marks among its headers; nothing is taken from the size of the numbers. A unit
that is given goes before a documented one, since drivers do not always keep to the documents.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from agonic.errors import LogError
from agonic.logs.headers.columns import Identified
from agonic.logs.headers.header import Column, identify_column
from agonic.logs.headers.quantities import BY_COLUMN
from agonic.logs.headers.words import FALLBACK

_OTHERS = (
    r"^(gravity|orientation|linear[ _-]?acc|gamerotation|rotation[ _-]?vector|location|velocity)"
)
"""Files of phones with x, y and z of something else."""
_SI = {"acceleration": "ms2", "rotation_rate": "rads", "quaternion": "enu"}
"""What `sensor_msgs` documents, with the axes of REP-103 and REP-145."""


@dataclass(frozen=True, kw_only=True)
class Convention:
    """A format: its name, what all of `marks` must find among the headers, and what it documents.

    `file` is what the name of the file must hold, if anything; `units` those of the quantities,
    for a quaternion the axes that it turns into; `only` restricts it to headers that match.
    `columns` are canonical names of headers that say nothing alone, or not without a title `above`
    the table.
    """

    name: str
    marks: tuple[str, ...]
    units: Mapping[str, str]
    columns: Mapping[str, str] = field(default_factory=dict)
    above: str = ""
    file: str = ""
    only: str = ""
    source: str = field(default="", compare=False)

    def fits(self, headers: Iterable[str], stem: str, title: str = "") -> bool:
        """Whether a table with these headers, in a file of that name, is of the format."""
        text = "\n".join(headers)
        return (
            self.above in title
            and bool(re.search(self.file, stem, re.IGNORECASE))
            and all(re.search(mark, text, re.MULTILINE) for mark in self.marks)
        )


CORRECTED = "MAG of ArduPilot, already corrected by the autopilot; read its own log (.bin)"
_OFFSETS = {"MagX", "OfsX", "MOX"}
"""Columns of the message MAG: its field has had the offsets added, and the motor term."""

_CORRECTED = re.compile(
    r"^Shimmer_\w+_CAL\b|^(?:motionMagneticField|locationHeading)[XYZ]\b|IMU\d?\.[xyz]mag$"
)
"""Fields that a device has corrected: Shimmer, iOS (Core Motion, Core Location), MAVLink."""
OF_DEVICE = (
    "the device had corrected these readings ({}); record uncorrected ones, if it gives them"
)

CONVENTIONS = (
    Convention(
        name="ArduPilot MAG",
        marks=(r"^MagX$", r"^OfsX$"),
        units={"field": "mG"},
        only=r"^Mag[XYZ]$",
        source="ArduPilot/ardupilot: libraries/AP_Compass/LogStructure.h",
    ),
    Convention(
        name="MAVLink",
        marks=(r"IMU\d?\.xmag$",),
        units={"field": "mG", "acceleration": "mg", "rotation_rate": "mrads"},
        only=r"IMU\d?\.[xyz](mag|acc|gyro)$",
        source="mavlink/mavlink: common.xml; columns of ArduPilot/pymavlink: tools/mavlogdump.py",
    ),
    Convention(
        name="ROS sensor_msgs/Imu",
        marks=(r"\blinear_acceleration[/._]x\b|_linear_acceleration[/._]x$",
               r"angular_velocity[/._]x$"),
        units=_SI,
        only=r"linear_acceleration[/._][xyz]$|angular_velocity[/._][xyz]$|orientation[/._][wxyz]$",
        source="ros/common_msgs: sensor_msgs/msg/Imu.msg; REP-103, REP-145",
    ),
    Convention(
        name="ROS sensor_msgs/MagneticField",
        marks=(r"magnetic_field[/._]x$",
               r"linear_acceleration[/._]x$|header[/._](stamp|frame_id|seq)|^__time$"
               r"|magnetic_field_covariance"),
        units={"field": "T"},
        only=r"magnetic_field[/._][xyz]$",
        source="ros/common_msgs: sensor_msgs/msg/MagneticField.msg",
    ),
    Convention(
        name="PX4 sensor_mag",
        marks=(r"^timestamp$", r"^device_id$", r"^[xyz]$"),
        units={"field": "G", "time": "us"},
        file=r"sensor_mag(_|$)",
        source="PX4/PX4-Autopilot: msg/SensorMag.msg; PX4/pyulog: ulog2csv",
    ),
    Convention(
        name="PX4",
        marks=(r"^timestamp$", r"^(timestamp_sample|device_id|magnetometer_ga\[0\])$"),
        units={"time": "us"},
        source="PX4/PX4-Autopilot: msg/; PX4/pyulog: ulog2csv",
    ),
    Convention(
        name="Blackbox",
        marks=(r"^loopIteration$",),
        units={"time": "us"},
        source="betaflight/blackbox-tools: main frames, time in µs",
    ),
    Convention(
        name="VectorNav",
        marks=(r"TimeStartup|(?i:uncompmag)",),
        units={"field": "G", "acceleration": "ms2", "rotation_rate": "rads", "temperature": "c",
               "roll_deg": "deg", "pitch_deg": "deg", "heading_deg": "deg", "time": "ns",
               "gps_tow": "ns"},
        source="VectorNav, VN-100 Interface Control Document: groups Time and IMU",
    ),
    Convention(
        name="Xsens DOT",
        marks=(r"^PacketCounter$", r"^SampleTimeFine$", r"^(Euler_X|Quat_W)$"),
        units={"time": "us", "acceleration": "ms2", "rotation_rate": "degs", "field": "raw"},
        source="Movella, Xsens DOT User Manual: data units; a field of 1 is that of the maker",
    ),
    Convention(
        name="Xsens MT",
        marks=(r"^PacketCounter$", r"^(Acc|Gyr|Mag)_X$"),
        units={"time": "1e-4s", "acceleration": "ms2", "rotation_rate": "rads", "field": "raw",
               "roll_deg": "deg", "pitch_deg": "deg", "heading_deg": "deg"},
        source="Movella, MT Low Level Communication Protocol: SampleTimeFine counts 10 kHz",
    ),
    Convention(
        name="MicroStrain",
        marks=(r"^X Mag \[x8006\]",),
        units={"field": "G", "acceleration": "g", "rotation_rate": "rads"},
        source="LORD MicroStrain, Data Communications Protocol: 0x8004, 0x8005, 0x8006",
    ),
    Convention(
        name="Technosmart",
        marks=(r"^compX$", r"^X$"),
        units={},
        columns={
            **{axis: f"acc_{axis.lower()}_g" for axis in "XYZ"},
            **{f"comp{axis}": f"mag_{axis.lower()}" for axis in "XYZ"},
        },
        source="Technosmart, Axy-Trek and AGM tags: X, Y, Z in g; of comp… no unit is published",
    ),
    Convention(
        name="ActiGraph",
        marks=(r"^Magnetometer X$", r"^Gyroscope X$"),
        above="ActiGraph",
        units={},
        columns={
            f"{theirs} {axis}": ours.format(axis.lower())
            for theirs, ours in (("Magnetometer", "mag_{}_uT"), ("Gyroscope", "gyro_{}_deg_s"),
                                 ("Accelerometer", "acc_{}_g"))
            for axis in "XYZ"
        },
        source="paulhibbing/AGread: data documentation, GT9X Link IMU files of ActiLife",
    ),
    Convention(
        name="OpenLog Artemis",
        marks=(r"^aX$|^mX$", r"^(rtcDate|rtcTime|imu_degC|output_Hz)$"),
        units={"field": "uT", "acceleration": "mg", "rotation_rate": "degs"},
        source="sparkfun/OpenLog_Artemis: SENSOR_UNITS.md",
    ),
    Convention(
        name="MagArrow",
        marks=(r"^MagValid$", r"^Compass ?X$"),
        units={"field": "nT"},
        source="Geometrics, MagArrow User Manual: data format of Survey Manager",
    ),
    Convention(
        name="DatCon",
        marks=(r"^IMU_ATTI\(0\):gyro:?X$",),
        units={"rotation_rate": "degs"},
        source="DatCon 3.6, columns of V3 .CSV files: gyro in degrees per second",
    ),
    Convention(
        name="Android GnssLogger",
        marks=(r"^Uncal(Mag|Accel|Gyro)_?X|^elapsedRealtimeNanos$",),
        units={"field": "uT", "acceleration": "ms2", "rotation_rate": "rads", "time": "millis"},
        source="google/gps-measurement-tools; Android SensorEvent",
    ),
    Convention(
        name="Sensor Logger",
        marks=(r"^seconds_elapsed$", r"^[xyz]$"),
        units={"field": "uT"},
        file="^magnetometer",
        source="tszheichoi/awesome-sensor-logger: units of the sensors",
    ),
    Convention(
        name="Sensor Logger",
        marks=(r"^seconds_elapsed$", r"^magnetometer(uncalibrated)?_[xyz]$"),
        units={"field": "uT", "rotation_rate": "rads"},
        only=r"^(magnetometer|gyroscope)(uncalibrated)?_[xyz]$",
        source="tszheichoi/awesome-sensor-logger: units of the sensors",
    ),
    Convention(
        name="Sensor Logger",
        marks=(r"^seconds_elapsed$", r"(?i:\bgyro\w*) [xyz]$"),
        units={"rotation_rate": "rads"},
        source="tszheichoi/awesome-sensor-logger: units of the sensors",
    ),
)  # fmt: skip


def apply_conventions(
    found: Identified, headers: Iterable[str], stem: str
) -> tuple[Identified, tuple[str, ...]]:
    """The columns, with the units that the format of the table documents; and notes.

    `stem` is the name of the file without its ending, which tells what bare x, y and z are.

    Raises `LogError` where it says that they are of another sensor.
    """
    headers = list(headers)
    _refuse_other_sensor(found, stem)
    units: dict[str, list[tuple[Convention, str]]] = {}
    for convention in CONVENTIONS:
        if convention.fits(headers, stem):
            for quantity, unit in convention.units.items():
                units.setdefault(quantity, []).append((convention, unit))
    if not units:
        return found, ()
    used: dict[str, list[str]] = {}
    told = {
        quantity: {
            sensor: {
                axis: _tell(column, units.get(quantity, ()), used) for axis, column in a.items()
            }
            for sensor, a in groups.items()
        }
        for quantity, groups in found.items()
    }
    return told, tuple(
        f"{', '.join(dict.fromkeys(names))}: units as {format} documents"
        for format, names in used.items()
    )


def name_documented(headers: Sequence[str], title: str = "") -> list[str]:
    """The headers, those by canonical names that only the format of the table tells, or the lines
    above it.

    >>> name_documented(["X", "Y", "Z", "compX"])[::3]
    ['acc_x_g', 'mag_x']
    """
    known: dict[str, str] = {}
    for convention in CONVENTIONS:
        if convention.columns and convention.fits(headers, "", title):
            known |= convention.columns
    return [known.get(header, header) for header in headers]


def find_correction(headers: Iterable[str]) -> tuple[str, ...]:
    """`CORRECTED` where the format of the table holds readings that are, else nothing.

    >>> find_correction(["TimeUS", "MagX", "MagY", "MagZ"])
    ()
    """
    return (CORRECTED,) if _OFFSETS.issubset(headers) else ()


def is_corrected(axes: Mapping[str, Column]) -> bool:
    """Whether the columns of a field are of those that a device writes after its own correction.

    >>> from agonic.logs.headers.columns import identify_columns
    >>> found = identify_columns([f"motionMagneticField{axis}(µT)" for axis in "XYZ"])
    >>> is_corrected(found["field"]["motion"])
    True
    """
    return any(_CORRECTED.search(column.header) for column in axes.values())


def _tell(
    column: Column, documented: Iterable[tuple[Convention, str]], used: dict[str, list[str]]
) -> Column:
    """A column with the first unit that its format documents, if it names none itself."""
    if column.unit is not None:
        return column
    for convention, unit in documented:
        if re.search(convention.only, column.header):
            used.setdefault(convention.name, []).append(column.quantity.name)
            return replace(column, unit=unit, documented=convention.name)
    return column


def _refuse_other_sensor(found: Identified, stem: str) -> None:
    """Raise `LogError` where bare axes stand in a file that is named for another sensor."""
    axes = found.get("field", {}).get("", {})
    if not axes or any(len(column.header) > 1 for column in axes.values()):
        return
    if re.search(_OTHERS, stem, re.IGNORECASE):
        raise LogError(
            f"its x, y and z are of no magnetometer, by the name of the file ({stem[:40]}); name "
            "the file of the magnetometer, or the folder of both"
        )
    other = find_named_quantity(stem)
    if other in ("acceleration", "rotation_rate"):
        name = BY_COLUMN[other].name
        raise LogError(
            f"its x, y and z are of the {name} that the file is named for, and no magnetometer; "
            "name the file of the magnetometer, or the folder of both"
        )


def find_named_quantity(name: str) -> str:
    """The vector quantity that a file, a table or a row is named for; "" where it is none.

    >>> find_named_quantity("mpu6050_accelerometer"), find_named_quantity("TotalAcceleration")
    ('acceleration', 'acceleration')
    >>> find_named_quantity("Magnetometer"), find_named_quantity("Gravity")
    ('field', '')
    """
    words = re.split(r"[\W_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name))
    for text in (name, *words):
        column = identify_column(f"{text} x") if len(text) > 2 else None
        if column is not None and column.axis == "x" and column.rank != FALLBACK:
            return column.quantity.column
    return ""
