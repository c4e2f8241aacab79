"""`Session`: a site, the instruments there, and their readings in many orientations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np
from msgspec import Struct
from numpy.typing import ArrayLike, NDArray

from agonic.arrays import Array, Index
from agonic.calibration.base import Calibration, select_columns
from agonic.errors import AgonicError, LogError, UnitError, check_choice
from agonic.maths.earth.starlight import Air
from agonic.maths.rotations.frames import ARCSEC_RAD, from_323_deg
from agonic.provenance import Input
from agonic.readable import Readable
from agonic.samples import Samples
from agonic.units import RAW

NOT_UNIT = 1e-3
"""How far an attitude may be from a rotation, or a quaternion's length from one."""


Coordinates = Literal["astronomical", "geodetic"]
DEFLECTION = (
    "the site's coordinates are geodetic: north and down may be off by up to 20″, the deflection "
    "of the vertical"
)

PRESENT, REMOVED = "present", "removed"
"""Whether an effect on starlight is still in the star sensor's attitudes."""


@dataclass(frozen=True, kw_only=True)
class Site:
    """Where the piers stand: degrees, longitude positive east. `coordinates` "astronomical" follow
    the plumb line, as the north and down of the reference do; "geodetic" ones are square to the
    ellipsoid and differ by the deflection of the vertical."""

    latitude_deg: float
    longitude_deg: float
    coordinates: Coordinates = "astronomical"
    air: Air = field(default_factory=Air)

    def __post_init__(self) -> None:
        check_choice("coordinates", self.coordinates, ("astronomical", "geodetic"))
        if not (-90 <= self.latitude_deg <= 90 and -180 <= self.longitude_deg <= 360):
            raise AgonicError(
                f"latitude {self.latitude_deg:g}°, longitude {self.longitude_deg:g}° is not a "
                "place; give degrees, longitude positive east"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class StarReadings:
    """Attitudes of a star sensor: inertial (J2000, GCRS) components into its own, c. `time`: (n,)
    UTC seconds since 1970. `orientation`: (n,) whole numbers of the static orientations. `rot_ci`:
    (n, 3, 3); its third row is the boresight. `covariance`: (n, 3, 3) rad² of the small rotation in
    camera axes, third axis the boresight; `None` where the scatter within the orientations is to
    show it. `refraction`, `aberration`: "present" where the sensor does not take them out, else
    "removed"."""

    time: Array
    orientation: NDArray[np.int64]
    rot_ci: Array
    covariance: Array | None = None
    refraction: str = REMOVED
    aberration: str = REMOVED
    name: str = "star sensor"

    def __post_init__(self) -> None:
        for effect in ("refraction", "aberration"):
            check_choice(effect, getattr(self, effect), (PRESENT, REMOVED))

    def __len__(self) -> int:
        return len(self.time)

    def select(self, rows: Index | slice) -> StarReadings:
        """Some of the attitudes."""
        return replace(self, **{name: column[rows] for name, column in self._columns.items()})

    def join(self, before: StarReadings) -> StarReadings:
        """Attitudes after others of the same columns."""
        both = ((name, [getattr(before, name), one]) for name, one in self._columns.items())
        joined: dict[str, Any] = {name: np.concatenate(parts) for name, parts in both}
        return replace(self, **joined)

    @property
    def _columns(self) -> dict[str, Any]:
        return {name: one for name, one in vars(self).items() if isinstance(one, np.ndarray)}

    @property
    def boresight_i(self) -> Array:
        """Where it looks among the stars, (n, 3)."""
        return self.rot_ci[:, 2]


def make_diagonal(across_sd_arcsec: ArrayLike, about_sd_arcsec: ArrayLike) -> Array:
    """Covariances (…, 3, 3), rad², of standard deviations across and about the boresight."""
    variance = np.stack([across_sd_arcsec, across_sd_arcsec, about_sd_arcsec], axis=-1) ** 2
    return np.asarray(variance[..., None] * np.eye(3) * ARCSEC_RAD**2)


@dataclass(frozen=True, kw_only=True, eq=False)
class Pier:
    """The field at the magnetometer's pier less that at the reference's, nT, in its axes. `sd` is
    the standard deviation of each component: 0 where the difference is exact."""

    difference: Array = field(default_factory=lambda: np.zeros(3))
    sd: float | None = None


class Mounting(Struct, frozen=True, kw_only=True):
    """How the magnetometer was meant to sit: 3-2-3 angles from the star sensor to it, degrees."""

    alpha_deg: float
    beta_deg: float
    gamma_deg: float
    sd_deg: float = 2.0

    @property
    def rot_mc(self) -> Array:
        """Star sensor components into magnetometer ones."""
        return from_323_deg(self.alpha_deg, self.beta_deg, self.gamma_deg)


@dataclass(frozen=True, kw_only=True, eq=False)
class Recorded:
    """What every session has: readings of a magnetometer, perhaps of a reference beside it.
    `magnetometer`: its readings in nT. `calibration`: of it, applied before everything else.
    `reference`: the field beside it, north-east-down, which takes out the ambient's changes.
    `pier`: difference of the field between the two. `noise`, `reference_noise`: standard deviation
    of one reading on one axis, nT; `None`: by the scatter within the orientations.
    `reference_sd_arcsec`: how well the reference's axes are known to be north, east and down;
    `None`: exactly, unless they are solved for. `sources`: the files that were read."""

    magnetometer: Samples | None
    reference: Samples | None
    calibration: Calibration | None = None
    pier: Pier = field(default_factory=Pier)
    noise: float | None = None
    reference_noise: float | None = None
    reference_sd_arcsec: float | None = None
    name: str = ""
    sources: tuple[Input, ...] = ()

    def __post_init__(self) -> None:
        if mistakes := list(self._list_mistakes()):
            raise AgonicError("; ".join(mistakes))

    def _list_mistakes(self) -> Iterator[str]:
        """What does not fit together."""
        yield from ()

    @property
    def instruments(self) -> tuple[Samples, Samples]:
        """Magnetometer and reference of a session that has both."""
        assert self.magnetometer is not None, "checked with the session"
        assert self.reference is not None, "checked with the session"
        return self.magnetometer, self.reference

    @property
    def corrected(self) -> Array:
        """The magnetometer's field (n, 3), nT, with its calibration where there is one."""
        assert self.magnetometer is not None, "asked for only with a magnetometer"
        return correct_field(self.magnetometer, self.calibration)


@dataclass(frozen=True, kw_only=True, eq=False)
class Session(Recorded, Readable):
    """Readings of a magnetometer and a star sensor on one platform, and of a reference beside it.

    Parameters
    ----------
    site, star : where, and the attitudes.
    magnetometer : its readings in nT, with `station` the number of the orientation, times since
        `epoch`. reference : the variometer or vector standard, north-east-down.
    mounting : the nominal angles, if known.
    remanence : readings of a magnetometer that stood still while the platform was turned to the
        angles in `heading_deg`, for `fit_remanence`.
    """

    site: Site
    star: StarReadings
    magnetometer: Samples
    reference: Samples
    mounting: Mounting | None = None
    remanence: Samples | None = None

    @property
    def orientations(self) -> NDArray[np.int64]:
        """The numbers of the orientations, in order."""
        return np.unique(self.star.orientation)

    @property
    def middle(self) -> float:
        """The middle of the star sensor's times, UTC seconds since 1970."""
        return float(self.star.time.min() + self.star.time.max()) / 2

    @property
    def date(self) -> str:
        """The day of it."""
        return datetime.fromtimestamp(self.middle, UTC).date().isoformat()


def correct_field(samples: Samples, calibration: Calibration | None) -> Array:
    """The field (n, 3) of samples, with a calibration where there is one."""
    if calibration is None:
        return samples.field
    columns = select_columns(calibration, samples)
    return np.asarray(calibration.correct(samples.field, **columns))


def compute_unix_s(samples: Samples) -> Array:
    """UTC seconds since 1970 of samples whose epoch is known."""
    if samples.time is None or samples.epoch is None:
        raise AgonicError(
            f"{samples.name} has no date; give times as 2026-03-01T20:00:00Z or Unix seconds"
        )
    utc = samples.epoch if samples.epoch.tzinfo else samples.epoch.replace(tzinfo=UTC)
    return np.asarray(samples.time + utc.timestamp())


def put_on_clock(reference: Samples, samples: Samples) -> Array:
    """The times (m,) of a reference, s, on the clock of other samples. Without any dates both count
    from one moment."""
    assert reference.time is not None, "a reference is read with times"
    if reference.epoch is None and samples.epoch is None:
        return reference.time
    assert samples.time is not None, "asked for only with times"
    begins = compute_unix_s(samples)[0] - samples.time[0]
    return np.asarray(compute_unix_s(reference) - begins)


def check_session(session: Session) -> Session:
    """The session, or an error that says what does not fit together and what to do. Raises
    `AgonicError` for times that do not meet, orientations without readings, attitudes that are no
    rotations and covariances that are none; `UnitError` for magnitudes that cannot be those of one
    place."""
    for mistake in _list_session_mistakes(session):
        raise mistake
    return session


def _list_session_mistakes(session: Session) -> Iterator[AgonicError]:
    """The first of them makes the next checks meaningless."""
    star, covariance, station = session.star, session.star.covariance, session.magnetometer.station
    if not len(star):
        yield LogError(f"{star.name} has no readings")
    off = np.abs(star.rot_ci @ np.swapaxes(star.rot_ci, 1, 2) - np.eye(3)).max(axis=(1, 2))
    if off.max() > NOT_UNIT or np.linalg.det(star.rot_ci).min() < 0:
        yield AgonicError(
            f"attitude {int(off.argmax()) + 1} of {star.name} is not a rotation; give "
            "ra, dec, rot in degrees or unit quaternions"
        )
    for what, value in (("noise", session.noise), ("reference noise", session.reference_noise)):
        if value is not None and not value > 0:
            yield AgonicError(f"the {what} is {value:g} nT; it must be above 0")
    least = np.ones(1) if covariance is None else np.linalg.eigvalsh(covariance)[:, 0]
    if not least.min() > 0:  # nor where one is no number
        yield AgonicError(
            f"the covariance of attitude {int(least.argmin()) + 1} of {star.name} is none: "
            "standard deviations must be above 0 and correlations below 1"
        )
    if station is None:
        yield AgonicError(
            "the magnetometer's readings say no orientation; add a column orientation"
        )
    elif without := sorted(set(session.orientations.tolist()) - set(station.astype(int).tolist())):
        yield AgonicError(
            f"orientation {', '.join(map(str, without[:8]))} has star readings but none of the "
            "magnetometer; check the numbers of the orientations in both tables"
        )
    yield from _list_late(session)
    if session.magnetometer.unit == RAW or session.reference.unit == RAW:
        yield UnitError("a session needs fields in nT; name the unit of magnetometer and reference")
    ours = float(np.median(np.linalg.norm(session.corrected, axis=1)))
    theirs = float(np.median(np.linalg.norm(session.reference.field, axis=1)))
    if not 1 / 3 < ours / max(theirs, 1e-9) < 3:  # more is another unit, no calibration
        yield UnitError(
            f"the magnetometer reads {ours:.0f} nT and the reference {theirs:.0f} nT: one of the "
            "units is wrong"
        )


def _list_late(session: Session) -> Iterator[AgonicError]:
    """The three instruments must have read at the same time, the reference throughout."""
    star = session.star.time
    own, beside = (compute_unix_s(one) for one in session.instruments)
    for time, what in ((own, "magnetometer"), (beside, "reference")):
        short = max(float(beside[0] - own.min()), float(own.max() - beside[-1]))
        step = float(np.median(np.diff(beside))) if len(beside) > 1 else np.inf
        if what == "reference" and short > max(2 * step, 1.0):
            yield AgonicError(
                f"the reference does not cover the magnetometer's readings: {_duration(short)} are "
                "missing; check the time scales, or leave those orientations out"
            )
        gap = max(float(time.min() - star.max()), float(star.min() - time.max()))
        if gap > 0:
            yield AgonicError(
                f"the {what} and the star sensor never read at the same time: they are "
                f"{_duration(gap)} apart; check dates, time zones and time_scale"
            )


def _duration(seconds: float) -> str:
    """A length of time in words."""
    if seconds >= 86_400:
        return f"{seconds / 86_400:.1f} days"
    return f"{seconds / 3600:.2f} h" if seconds >= 3600 else f"{seconds:.1f} s"
