"""`Setup`: everything between the readings of a vehicle's magnetometers and its true heading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, ClassVar, Literal, get_args

from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration, Valued
from agonic.calibration.deviation import Deviation
from agonic.errors import AgonicError, FrameError, UnitError, check_choice
from agonic.maths.rotations.tilt import Order
from agonic.provenance import Provenance
from agonic.units import ACCELERATION

LATENCY_SD_S = 0.01
"""Of the delay of a magnetometer beside attitude or gyro, where the log does not tell it."""

Tilt = Literal["auto", "log", "accelerometer", "gyro", "level"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Compass(Valued):
    """One magnetometer as a compass.

    Parameters
    ----------
    calibration : from readings to the field in body axes (forward, right, down), nT.
    deviation : from what this compass reads to the magnetic heading, or `None` for no deviation.
    latency_s : how late its readings are beside the attitude; default: what the calibration says.
    latency_sd_s : standard error of that; default: what the calibration says of its own latency,
        `None` where it is not known, which counts as `LATENCY_SD_S`.

    Examples
    --------
    >>> from agonic.calibration.affine import Affine
    >>> Compass(calibration=Affine(bias=[0, 0, 0], matrix=[[1, 0, 0], [0, 1, 0], [0, 0, 1]])).sensor
    'mag'
    """

    calibration: Calibration
    deviation: Deviation | None = None
    latency_s: float = None  # type: ignore[assignment]  # a number once it is made
    latency_sd_s: float | None = None

    def __post_init__(self) -> None:
        own = getattr(self.calibration, "latency_s", 0.0)
        if self.latency_s is None:
            object.__setattr__(self, "latency_s", own)
        if self.latency_sd_s is None and self.latency_s == own:
            known = getattr(self.calibration, "latency_sd_s", None)
            object.__setattr__(self, "latency_sd_s", known)
        if self.calibration.frame_out not in "mb":
            raise FrameError(
                "a compass needs its field in body axes",
                left=self.calibration.frame_out,
                right="b",
            )
        if self.calibration.unit_out == ACCELERATION:
            raise UnitError(
                f"the calibration of {self.sensor} is one of an accelerometer; in a setup it "
                "belongs to the tilt"
            )
        _check_number("latency_s", self.latency_s, lowest=-10.0, highest=10.0)
        _check_number("latency_sd_s", self.latency_sd_s, lowest=0.0, highest=10.0)

    @property
    def sensor(self) -> str:
        """The sensor whose readings it takes."""
        return self.calibration.sensor


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup(Valued):
    """The compasses of a vehicle, where its tilt comes from, and the declination.

    Parameters
    ----------
    compasses : at least one; the first whose readings can be trusted is used.
    tilt : where roll and pitch come from: "log" (recorded), "accelerometer" (at rest), "gyro"
        (accelerometer and gyro through a filter), "level" (none: a two-axis compass), or "auto".
    accelerometer : from the accelerometer's readings to the specific force in body axes, m/s², as
        `fit_pair` makes it, or `None` where it is taken as it reads.
    tilt_order : what roll and pitch mean: "roll-pitch" is aerospace yaw-pitch-roll; "pitch-roll"
        the inclinometer's order.
    tilt_sd_deg : standard deviation of recorded roll and pitch, of an accelerometer at rest (what
        motion does to it is added), or of a vehicle taken to be level; `None` for 0.5°, less where
        the dip of the field shows it, and for a level one what the log tells, else 3°. Where the
        dip scatters by more than is stated, the tilt counts for as much; 0 of recorded ones is
        taken as exact.
    settling_s : how long the filter of "gyro" takes to follow the accelerometer: longer where
        turns and accelerations last longer, shorter where the gyro drifts.
    declination_deg, declination_sd_deg : east positive; `None` takes them from the world model at
        the place and date of the readings.
    horizontal, vertical : intensities to expect, nT, or `None` for those of the world model.
    magnitude_limit, dip_limit_deg : how far from what is expected the magnitude (a share of it)
        and the dip may be before readings count as disturbed.
    disagreement_limit_deg : two sensors that differ by more, and by three of their standard
        deviations, do not agree.
    tilt_limit_deg : a vehicle whose own down is further from down than this has no heading.

    Examples
    --------
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[0, 0, 0], matrix=[[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> Setup(compasses=(Compass(calibration=mag),), declination_deg=2.7).tilt
    'auto'
    """

    kind: ClassVar[str] = "setup"

    compasses: tuple[Compass, ...]
    tilt: Tilt = "auto"
    accelerometer: Affine | None = None
    tilt_order: Order = "roll-pitch"
    tilt_sd_deg: float | None = None
    settling_s: float = 10.0
    declination_deg: float | None = None
    declination_sd_deg: float | None = None
    horizontal: float | None = None
    vertical: float | None = None
    magnitude_limit: float = 0.1
    dip_limit_deg: float = 10.0
    tilt_limit_deg: float = 80.0
    disagreement_limit_deg: float = 10.0
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        object.__setattr__(self, "compasses", tuple(self.compasses))
        wrong = find_mistakes({name: getattr(self, name) for name in _VALUES})
        if not self.compasses:
            wrong.insert(0, "a setup needs at least one compass")
        own = self.accelerometer
        if own is not None and own.unit_out != ACCELERATION:
            wrong.append(f"the accelerometer's calibration gives {own.unit_out} and not m/s²")
        names = [compass.sensor for compass in self.compasses]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            wrong.append(f"a setup has one compass for a sensor; two are for {', '.join(twice)}")
        if wrong:
            raise AgonicError("; ".join(wrong))


def find_mistakes(values: Mapping[str, Any]) -> list[str]:
    """What is wrong with the values of a setup's attributes, in sentences, all at once."""
    wrong = []
    for name, value in values.items():
        try:
            if name in _CHOICES:
                check_choice(name, value, _CHOICES[name])
            else:
                lowest, highest = _RANGES[name]
                _check_number(name, value, lowest=lowest, highest=highest)
        except AgonicError as error:
            wrong.append(str(error))
    if (values.get("horizontal") is None) != (values.get("vertical") is None):
        wrong.append("horizontal and vertical intensity go together; give both or neither")
    return wrong


_CHOICES = {"tilt": get_args(Tilt), "tilt_order": get_args(Order)}
_RANGES = {
    "tilt_sd_deg": (0.0, 90.0),
    "settling_s": (1e-3, 3600.0),
    "declination_deg": (-180.0, 180.0),
    "declination_sd_deg": (0.0, 180.0),
    "horizontal": (0.0, 1e6),
    "vertical": (-1e6, 1e6),
    "magnitude_limit": (0.0, 10.0),
    "dip_limit_deg": (0.0, 180.0),
    "tilt_limit_deg": (0.0, 180.0),
    "disagreement_limit_deg": (0.0, 180.0),
}
_VALUES = (*_CHOICES, *_RANGES)


def _check_number(name: str, value: float | None, *, lowest: float, highest: float) -> None:
    if value is None:
        return
    number = isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    if not (number and lowest <= value <= highest):
        raise AgonicError(f"{name} is {value!r}; it needs a number from {lowest:g} to {highest:g}")
