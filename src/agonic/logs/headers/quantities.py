"""The quantities that a table of readings can hold, and the names and units loggers give them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from agonic.units import STANDARD_GRAVITY_M_S2

DEGREES_PER_RADIAN = math.degrees(1.0)

Linear = tuple[float, float]
"""Ours = factor × theirs + offset."""


def _spell(spellings: Mapping[float, str], offset: float = 0.0) -> dict[str, Linear]:
    """The factor, and the offset, of each spelling of a unit."""
    return {word: (factor, offset) for factor, words in spellings.items() for word in words.split()}


_ANGLE = _spell({1.0: "deg degrees", DEGREES_PER_RADIAN: "rad radians"})
_RATE = _spell(
    {
        1.0: "rads radps radsec radpers radpersec radianss radianssec radianspersecond rad radians",
        1 / DEGREES_PER_RADIAN: "degs degps degsec degpers degpersec dps degreess degreessec "
        "degreespersecond deg degrees",
        1e-3 / DEGREES_PER_RADIAN: "mdps",
        1e-3: "mrads mradsec",
    }
)
_ACCELERATION = _spell(
    {
        1.0: "ms2 mss mpers2 mps2 meterspersecondsquared raw counts",  # counts: known by gravity
        STANDARD_GRAVITY_M_S2: "g",
        1e-3 * STANDARD_GRAVITY_M_S2: "mg",
    }
)
TIMES = _spell(
    {
        1.0: "s sec secs seconds",
        60.0: "min",
        1e-3: "ms msec millis milliseconds",
        1e-6: "us usec micros microseconds",
        1e-9: "ns nsec nsecs nanosec nanos nanoseconds",
        1e-4: "1e-4s",  # ticks of 10 kHz, documented, never written
    }
)
_TEMPERATURE = {
    **_spell({1.0: "c degc celsius deg"}),
    **_spell({1.0: "k"}, -273.15),
    **_spell({1 / 1.8: "f degf"}, -32 / 1.8),
}
_POSITION = {**_ANGLE, **_spell({1e-7: "e7 dege7"})}
_HEIGHT = _spell({1.0: "m", 1e-3: "mm", 1e3: "km", 0.3048: "ft"})
_CURRENT = _spell({1.0: "a amps", 1e-3: "ma"})
# fmt: off
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
        "sampletimefine loggingtime stamp tsreal hhmmss hhmmssms mjd jd juliandate "
        "modifiedjuliandate",
        weak="chiptime elapsed elapsedtime timeelapsed secondselapsed trel relativetime uptime "
        "elapsedrealtime timestampsample epoch offsettime clockoffsettime tsmono tsmonotonic",
        preferred="headerstamp epoc timestampunix timestampsyncunix",
    ),
    Quantity(column="date", name="date", aliases="day utcdate", weak="rtcdate"),
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
