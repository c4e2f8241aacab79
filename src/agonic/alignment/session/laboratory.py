"""Sessions without a star sensor: a gyrotheodolite, a fluxgate theodolite's sheet, a coil."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agonic.alignment.session.session import Recorded, Site
from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.provenance import Input
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class Attitude:
    """How the platform stands: north-east-down into its axes, (3, 3), with covariance (3, 3), rad².
    `frame` is the letter of its axes: "b" (forward, right, down) or "c" (star sensor)."""

    rot_pn: Array
    covariance: Array
    frame: str = "b"


@dataclass(frozen=True, kw_only=True, eq=False)
class CoilSession(Recorded):
    """Readings of a magnetometer while a coil's current is reversed. `magnetometer`: readings in nT
    with times and `current_A`. `geometric_axis`: (3,) of the coil as drawn, in axes of the letter
    `geometric_frame`. `alignment`: magnetometer axes into those of the platform. `attitude`: of the
    platform. `site`: needed for Earth-fixed and inertial axes. `settle_s`: readings so soon after a
    change of current are left out. `current_sd`: relative standard deviation of the current's
    scale."""

    magnetometer: Samples
    reference: Samples | None = None
    geometric_axis: Array | None = None
    geometric_frame: str = "m"
    alignment: Alignment | None = None
    attitude: Attitude | None = None
    site: Site | None = None
    settle_s: float = 0.0
    current_sd: float = 0.0
    coil: str = "coil"

    @property
    def rot_pm(self) -> Array:
        """Magnetometer axes into the platform's."""
        return np.eye(3) if self.alignment is None else self.alignment.rotation.as_matrix()

    def _list_mistakes(self) -> Iterator[str]:
        samples = self.magnetometer
        if samples.current_A is None:
            yield "the magnetometer's table has no current of the coil; add a column current_A"
        elif not np.ptp(samples.current_A) > 0:
            yield "the current never changes; reverse it"
        if samples.time is None:
            yield "the magnetometer's table has no times"
        known = self.calibration
        if (samples.unit if known is None else known.unit_out) != "nT":
            yield "the magnetometer's readings need a unit"
        frames = {"m"}
        if self.alignment is not None:
            frames.add(self.alignment.frame_out)
        if self.attitude is not None:
            if self.attitude.frame not in frames:
                yield (
                    f"the attitude is that of {self.attitude.frame} axes and no alignment leads "
                    "there from the magnetometer's"
                )
            frames.add("n")
        if self.geometric_axis is not None and self.geometric_frame not in frames:
            yield (
                f"the geometric axis is in {self.geometric_frame} axes and no rotation to them is "
                f"known (known axes: {', '.join(sorted(frames))})"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class DiSheet:
    """Readings of a DI-flux measurement, angles in degrees. `mark_deg`: (m,) readings of the circle
    to the azimuth mark, both faces. `mark_azimuth_deg`: where that is, clockwise from true north,
    if known. `horizontal_deg`, `zenith_deg`, `reading`: (n,) of both circles and of the fluxgate.
    `setting`: (n,) the number of the setting of each reading: repeats share one. `time`: UTC
    seconds since 1970, (n,). `magnitude`: of the field at the pillar, nT, if known."""

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
    """Passages of the spin axis past a setting of the theodolite, (n,) each. `setting_deg` N′ on
    the circle; `east_s`, `west_s` how long it stays on either side; `amplitude_east`,
    `amplitude_west` in any unit, if the same."""

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
    """Readings (n,) of the circle to a mark or an instrument, degrees, in one face or both. With
    `mirror` the theodolite looks into a mirror on it, whose normal points back."""

    name: str
    reading_deg: Array
    mirror: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Platform:
    """Static orientations of a platform: circle readings to its forward axis, and its tilt, (k,).
    Axes forward, right, down. `circle_sd_arcsec` and `level_sd_arcsec` are those of one sighting
    and of roll and pitch."""

    orientation: NDArray[np.int64]
    reading_deg: Array
    roll_deg: Array
    pitch_deg: Array
    circle_sd_arcsec: float = 2.0
    level_sd_arcsec: float = 2.0
    mirror: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class NorthSession(Recorded):
    """What was read to find true north, and what north is carried to. `turning_deg`: (n,) readings
    at the turning points, in order. `transits`, `swing`: the same gyro by transits, or followed all
    the time. Any of the three, on one circle. `reading_sd_arcsec`, `time_sd_s`: of one reading of
    the circle and of one time; `None`: from the spread. `transit_constant`, `transit_constant_sd`:
    c of the gyro, degrees per (unit of amplitude · s), where it is known. `constant_arcsec`,
    `constant_sd_arcsec`: true north less the gyro's, the instrument's constant. `sightings`: marks
    and instruments that get an azimuth. `platform`, `magnetometer`, `reference`: for the alignment
    of a magnetometer: orientations, readings with `station` the number of the orientation, and the
    field north-east-down beside it."""

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

    def _list_mistakes(self) -> Iterator[str]:
        if self.turning_deg is None and self.transits is None and self.swing is None:
            yield "there are no readings of the gyro; give reversal, transit or swing"
        if self.turning_deg is not None and len(self.turning_deg) < 3:
            yield f"{len(self.turning_deg)} turning points are too few; a mean takes three"
        swing = self.swing
        if swing is not None and len(swing.time_s) < 12:
            yield f"{len(swing.time_s)} readings of the swing are too few; take twelve at least"
        if swing is not None and len(swing.time_s) > 1 and not (np.diff(swing.time_s) > 0).all():
            yield "the times of the swing do not increase"
        transits, constant = self.transits, self.transit_constant
        if transits is not None and constant is None and np.ptp(transits.setting_deg) == 0:
            yield "transits at one setting need the gyro's constant c; take a second setting"
        three = (self.platform, self.magnetometer, self.reference)
        if any(part is not None for part in three) and any(part is None for part in three):
            yield "an alignment needs platform, magnetometer and reference, all three"
        known, magnetometer, reference = self.calibration, self.magnetometer, self.reference
        if magnetometer is not None and known is None and magnetometer.unit != "nT":
            yield "the magnetometer's readings need a unit"
        if reference is not None and reference.unit != "nT":
            yield "the reference's readings need a unit"
