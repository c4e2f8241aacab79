"""The quantities that a table of readings can hold, and the names and units loggers give them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from agonic.units import STANDARD_GRAVITY_M_S2

DEGREES_PER_RADIAN = math.degrees(1.0)

Linear = tuple[float, float]
"""Ours = factor × theirs + offset."""

_ANGLE: dict[str, Linear] = {
    "deg": (1, 0), "degrees": (1, 0), "rad": (DEGREES_PER_RADIAN, 0),
    "radians": (DEGREES_PER_RADIAN, 0),
}  # fmt: skip
_RATE: dict[str, Linear] = {
    spelling: (factor, 0)
    for factor, spellings in {
        1.0: (
            "rads",
            "radsec",
            "radpers",
            "radpersec",
            "radianss",
            "radianssec",
            "radianspersecond",
            "rad",
            "radians",
        ),
        1 / DEGREES_PER_RADIAN: (
            "degs",
            "degsec",
            "degpers",
            "degpersec",
            "dps",
            "degreess",
            "degreessec",
            "degreespersecond",
            "deg",
            "degrees",
        ),
        1e-3 / DEGREES_PER_RADIAN: ("mdps",),
    }.items()
    for spelling in spellings
}
# fmt: off
_ACCELERATION: dict[str, Linear] = {
    "ms2": (1, 0), "mss": (1, 0), "mpers2": (1, 0), "mps2": (1, 0),
    "meterspersecondsquared": (1, 0),
    "g": (STANDARD_GRAVITY_M_S2, 0), "mg": (1e-3 * STANDARD_GRAVITY_M_S2, 0),
    "raw": (1, 0), "counts": (1, 0),  # whose unit is known by gravity
}
TIMES: dict[str, Linear] = {
    "s": (1, 0), "sec": (1, 0), "secs": (1, 0), "seconds": (1, 0), "min": (60, 0),
    "ms": (1e-3, 0), "msec": (1e-3, 0), "millis": (1e-3, 0), "milliseconds": (1e-3, 0),
    "us": (1e-6, 0), "usec": (1e-6, 0), "micros": (1e-6, 0), "microseconds": (1e-6, 0),
    "ns": (1e-9, 0), "nsec": (1e-9, 0), "nsecs": (1e-9, 0), "nanosec": (1e-9, 0),
    "nanos": (1e-9, 0), "nanoseconds": (1e-9, 0),
    "1e-4s": (1e-4, 0),  # ticks of 10 kHz, documented, never written
}
_TEMPERATURE: dict[str, Linear] = {
    "c": (1, 0), "degc": (1, 0), "celsius": (1, 0), "k": (1, -273.15),
    "f": (1 / 1.8, -32 / 1.8), "degf": (1 / 1.8, -32 / 1.8), "deg": (1, 0),
}
_POSITION: dict[str, Linear] = {**_ANGLE, "e7": (1e-7, 0), "dege7": (1e-7, 0)}
_HEIGHT: dict[str, Linear] = {"m": (1, 0), "mm": (1e-3, 0), "km": (1e3, 0), "ft": (0.3048, 0)}
_CURRENT: dict[str, Linear] = {"a": (1, 0), "ma": (1e-3, 0), "amps": (1, 0)}
FIELD_UNITS = (
    "nt", "nanotesla", "gamma", "ut", "microtesla", "mt", "millitesla", "t", "tesla", "g", "gs",
    "gauss", "ga", "microt", "utesla", "au", "mg", "mgauss", "milligauss", "mga", "mgs",
    "raw", "counts", "count", "lsb",
)
# fmt: on


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What a column can hold: the `Samples` column, its canonical name, aliases and units.

    `weak` aliases are taken only where no other column is named for the quantity, `preferred` ones
    before all others, and `last` ones, which may stand for anything, after all and as they are.
    `axes` are those of a vector, or of a quaternion.
    """

    column: str
    name: str
    unit: str = ""
    aliases: str = ""
    weak: str = ""
    last: str = ""
    preferred: str = ""
    units: Mapping[str, Linear] = field(default_factory=dict)
    axes: str = ""

    @property
    def vector(self) -> bool:
        """Whether it has components."""
        return bool(self.axes)


# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity(
        column="time", name="time", unit="s", units=TIMES,
        aliases="t ts timestamp timestamps datetime utc utctime timeutc unixtime timeunix unix "
        "tunix timeboot timesinceboot timesincestart systemtime localtime timestartup "
        "sampletimefine loggingtime stamp hhmmss hhmmssms mjd jd juliandate modifiedjuliandate",
        weak="chiptime elapsed elapsedtime timeelapsed secondselapsed trel relativetime uptime "
        "elapsedrealtime timestampsample epoch offsettime clockoffsettime",
        preferred="headerstamp epoc timestampunix timestampsyncunix",
    ),
    Quantity(column="date", name="date", aliases="day utcdate"),
    Quantity(column="year", name="year"),
    Quantity(column="month", name="month"),
    Quantity(column="day_of_month", name="day_of_month"),
    Quantity(column="day_of_year", name="day_of_year"),
    Quantity(column="hour", name="hour"),
    Quantity(column="minute", name="minute"),
    Quantity(column="second_of_minute", name="second_of_minute", aliases="second"),
    Quantity(column="millisecond", name="millisecond"),
    Quantity(column="epoch", name="epoch_unix", unit="s", units={"s": (1, 0)}),
    Quantity(
        column="gps_week", name="gps_week",
        aliases="week weekno weeknumber gpsweekno gpsweeknumber gpswk gwk timegpsweek",
    ),
    Quantity(
        column="gps_tow", name="gps_tow", unit="s", units=TIMES,
        aliases="tow itow sow gms timeofweek secondsofweek gpssow gpsseconds gpstime gpstimeofweek "
        "timegpstow gpsms gpsweekms weekms",
    ),
    Quantity(
        column="field", name="mag", axes="x y z",
        aliases="m b mf magn magneto magnetometer magnetic magneticfield magfield magneticflux "
        "magneticfluxdensity magneticinduction geomagnetic field bfield compass comp",
    ),
    Quantity(
        column="temperature", name="temperature", unit="C", units=_TEMPERATURE,
        aliases="temp magtemp magtemperature magnetometertemp magnetometertemperature",
    ),
    Quantity(column="roll_deg", name="roll", unit="deg", units=_ANGLE, aliases="rollangle"),
    Quantity(column="pitch_deg", name="pitch", unit="deg", units=_ANGLE, aliases="pitchangle"),
    Quantity(
        column="heading_deg", name="heading", unit="deg", units=_ANGLE,
        aliases="yaw yawangle trueheading headingtrue gpsheading gnssheading gpsyaw headinggps "
        "headinggnss dualantennaheading",
    ),
    Quantity(
        column="heading_sd_deg", name="heading_sd", unit="deg", units=_ANGLE,
        aliases="headingaccuracy headingstd headingsigma yawsd yawstd yawaccuracy",
    ),
    Quantity(
        column="acceleration", name="acc", unit="m_s2", units=_ACCELERATION, axes="x y z",
        aliases="a acce accl accel accelerometer acceleration specificforce totalacceleration "
        "totalaccel",
        weak="linearacceleration useracceleration",
        preferred="gforce gf",  # beside an ax without gravity
    ),
    Quantity(
        column="rotation_rate", name="gyro", unit="rad_s", units=_RATE, axes="x y z",
        aliases="g w gyr as gyroscope angularvelocity angularspeed gyrorotation angularrate "
        "rotationrate turnrate omega",
    ),
    Quantity(
        column="quaternion", name="quat", axes="w x y z",
        aliases="q quaternion orientation attitude rotation",
        units={"enu": (1, 0)},
    ),
    Quantity(
        column="current_A", name="current", unit="A", units=_CURRENT,
        aliases="curr batterycurrent currentbattery motorcurrent amperage amperagelatest",
    ),
    Quantity(
        column="throttle", name="throttle", aliases="thr", units={"percent": (0.01, 0)}
    ),
    Quantity(
        column="latitude_deg", name="latitude", unit="deg", units=_POSITION,
        aliases="lat gpslat gpslatitude locationlatitude",
    ),
    Quantity(
        column="longitude_deg", name="longitude", unit="deg", units=_POSITION,
        aliases="lon lng long gpslon gpslng gpslongitude locationlongitude",
    ),
    Quantity(
        column="altitude_m", name="altitude", unit="m", units=_HEIGHT,
        aliases="alt height elevation gpsalt gpsaltitude locationaltitude",
    ),
    Quantity(
        column="second", name="second", unit="nT", axes="x y z",
        units={"nt": (1, 0), "ut": (1e3, 0), "raw": (1, 0), "counts": (1, 0)},
        aliases="secondmag secondfield",
    ),
    Quantity(column="station", name="station", aliases="stationid pose orientation"),
    Quantity(column="target", name="target", aliases="targetid sighted", weak="run"),
    Quantity(
        column="scalar", name="scalar", unit="nT",
        units={"nt": (1, 0), "ut": (1e3, 0), "mt": (1e6, 0), "t": (1e9, 0), "g": (1e5, 0),
               "mg": (100, 0)},
        aliases="scalarfield scalarmag scalarmagnetometer fscalar",
    ),
    Quantity(
        column="flagged", name="flagged",
        aliases="excluded torquers torquerson mtq mtqon magnetorquers magnetorquerson",
    ),
    Quantity(
        column="sensor", name="sensor", aliases="sensorid sensorname magid",
        weak="device deviceid devicename deviceaddress macaddress",  # where it is more than one
        last="id node nodeid imu imuid",
    ),
    Quantity(column="frame", name="frame"),
    Quantity(column="unit", name="unit", aliases="units fieldunit fieldunits magunit magunits"),
)
# fmt: on

# fmt: off
DISTURBER = Quantity(
    column="disturber", name="disturber",
    units={"A": (1, 0), "mA": (1e-3, 0), "W": (1, 0), "mW": (1e-3, 0), "Am2": (1, 0),
           "duty": (1, 0), "percent": (0.01, 0), "pwm_us": (1e-3, -1.0)},
)
# fmt: on
"""Whatever may disturb: any name with one of these units behind it, in these letters."""
DISTURBER_UNITS = {"mA": "A", "mW": "W", "percent": "duty", "pwm_us": "duty"}
"""The unit in which a disturber is kept that was recorded in another: duty is 0…1, of 1…2 ms."""

BY_COLUMN = {quantity.column: quantity for quantity in QUANTITIES}


def canonical_header(column: str, axis: str = "", unit: str | None = None) -> str:
    """The name that `write_csv` gives to a column; the field's carries the unit of the samples.

    >>> canonical_header("field", "x", "nT"), canonical_header("acceleration", "z")
    ('mag_x_nT', 'acc_z_m_s2')
    """
    quantity = BY_COLUMN[column]
    written = unit or "" if column in ("field", "second") else quantity.unit
    return "_".join(part for part in (quantity.name, axis, written) if part)
