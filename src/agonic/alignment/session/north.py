"""`NorthSession`: readings of a gyrotheodolite, what was sighted, a platform beside it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from agonic.alignment.session.session import Pier, correct_field
from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.errors import AgonicError
from agonic.provenance import Input
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class DiSheet:
    """Readings of a DI-flux measurement, angles in degrees.

    Parameters
    ----------
    mark_deg : (m,) readings of the circle to the azimuth mark, both faces. mark_azimuth_deg : where
        that is, clockwise from true north, if known.
    horizontal_deg, zenith_deg, reading : (n,) of both circles and of the fluxgate.
    setting : (n,) the number of the setting of each reading: repeats share one.
    time : UTC seconds since 1970, (n,). magnitude : of the field at the pillar, nT, if known.
    """

    mark_deg: Array
    horizontal_deg: Array
    zenith_deg: Array
    reading: Array
    setting: NDArray[np.int64]
    time: Array
    mark_azimuth_deg: float | None = None
    magnitude: float | None = None
    pillar: str = ""
    theodolite: str = ""
    sensor: str = ""
    name: str = ""
    sources: tuple[Input, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Transits:
    """Passages of the spin axis past a setting of the theodolite, (n,) each.

    `setting_deg` N′ on the circle; `east_s`, `west_s` how long it stays on either side;
    `amplitude_east`, `amplitude_west` in any unit, if the same.
    """

    setting_deg: Array
    east_s: Array
    west_s: Array
    amplitude_east: Array
    amplitude_west: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class SwingRecord:
    """The circle's readings (n,), degrees, that follow the spin axis, at times (n,), s."""

    time_s: Array
    reading_deg: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighting:
    """Readings (n,) of the circle to a mark or an instrument, degrees, in one face or both.

    With `mirror` the theodolite looks into a mirror on it, whose normal points back.
    """

    name: str
    reading_deg: Array
    mirror: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Platform:
    """Static orientations of a platform: circle readings to its forward axis, and its tilt, (k,).

    Axes forward, right, down. `circle_sd_arcsec` and `level_sd_arcsec` are those of one sighting
    and of roll and pitch.
    """

    orientation: NDArray[np.int64]
    reading_deg: Array
    roll_deg: Array
    pitch_deg: Array
    circle_sd_arcsec: float = 2.0
    level_sd_arcsec: float = 2.0
    mirror: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class NorthSession:
    """What was read to find true north, and what north is carried to.

    Parameters
    ----------
    turning_deg : (n,) readings at the turning points, in order. transits, swing : the same gyro by
        transits, or followed all the time. Any of the three, on one circle.
    reading_sd_arcsec, time_sd_s : of one reading of the circle and of one time; `None`: from the
        spread.
    transit_constant, transit_constant_sd : c of the gyro, degrees per (unit of amplitude · s),
        where it is known.
    constant_arcsec, constant_sd_arcsec : true north less the gyro's, the instrument's constant.
    sightings : marks and instruments that get an azimuth.
    platform, magnetometer, reference : for the alignment of a magnetometer: orientations, readings
        with `station` the number of the orientation, and the field north-east-down beside it.
    noise, reference_noise : of one reading on one axis, nT; `None`: from the scatter.
    """

    turning_deg: Array | None = None
    transits: Transits | None = None
    swing: SwingRecord | None = None
    reading_sd_arcsec: float | None = None
    time_sd_s: float | None = None
    transit_constant: float | None = None
    transit_constant_sd: float = 0.0
    constant_arcsec: float = 0.0
    constant_sd_arcsec: float = 0.0
    sightings: tuple[Sighting, ...] = ()
    platform: Platform | None = None
    magnetometer: Samples | None = None
    reference: Samples | None = None
    pier: Pier = field(default_factory=Pier)
    calibration: Calibration | None = None
    noise: float | None = None
    reference_noise: float | None = None
    name: str = ""
    sources: tuple[Input, ...] = ()

    @property
    def corrected(self) -> Array:
        """The magnetometer's field (n, 3), nT, with its calibration where there is one."""
        assert self.magnetometer is not None, "asked for only with a platform"
        return correct_field(self.magnetometer, self.calibration)

    def __post_init__(self) -> None:
        if mistakes := _amiss(self):
            raise AgonicError("; ".join(mistakes))


def _amiss(session: NorthSession) -> list[str]:
    """What does not fit together."""
    said = []
    if session.turning_deg is None and session.transits is None and session.swing is None:
        said.append("there are no readings of the gyro; give reversal, transit or swing")
    if session.turning_deg is not None and len(session.turning_deg) < 3:
        said.append(f"{len(session.turning_deg)} turning points are too few; a mean takes three")
    swing = session.swing
    if swing is not None and len(swing.time_s) < 12:
        said.append(f"{len(swing.time_s)} readings of the swing are too few; take twelve at least")
    if swing is not None and len(swing.time_s) > 1 and not (np.diff(swing.time_s) > 0).all():
        said.append("the times of the swing do not increase")
    transits, constant = session.transits, session.transit_constant
    if transits is not None and constant is None and np.ptp(transits.setting_deg) == 0:
        said.append("transits at one setting need the gyro's constant c; take a second setting")
    three = (session.platform, session.magnetometer, session.reference)
    if any(part is not None for part in three) and any(part is None for part in three):
        said.append("an alignment needs platform, magnetometer and reference, all three")
    known, magnetometer, reference = session.calibration, session.magnetometer, session.reference
    if magnetometer is not None and known is None and magnetometer.unit != "nT":
        said.append("the magnetometer's readings need a unit")
    if reference is not None and reference.unit != "nT":
        said.append("the reference's readings need a unit")
    return said
