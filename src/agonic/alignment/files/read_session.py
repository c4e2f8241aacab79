"""session.toml: what the tables of a session are about.

name = "Niemegk, the night of 12 March"
time_scale = "UTC"              # of all tables: UTC, TAI, GPS or TT

[site]
latitude_deg = 52.0725
longitude_deg = 12.6750         # east positive
coordinates = "astronomical"    # follow the plumb line; or "geodetic"
pressure_hPa = 1005             # temperature_C, humidity (0…1): for refraction

[star]
file = "star.csv"
turns = "ci"                    # quaternions take inertial components into the sensor's; or "ic"
across_sd_arcsec = 3            # of one attitude, where the table does not say
about_sd_arcsec = 20
refraction = "present"          # in the attitudes; "removed" where the sensor takes it out
aberration = "removed"

[magnetometer]
file = "magnetometer.csv"       # with a column orientation
noise_nT = 0.5                  # without: the scatter within the orientations
calibration = "mag.json"

[reference]
file = "reference.csv"          # any log that agonic reads, IAGA-2002 too
axes = "NED"                    # or ENU, NWU
noise_nT = 0.3
axes_sd_arcsec = 10             # how well its axes are known; without: exactly, or solved for

[pier]
difference_nT = [3.2, -1.0, 4.4]   # the field at the magnetometer less that at the reference
sd_nT = 0.2

[mounting]                      # nominal 3-2-3 angles from the star sensor to the magnetometer
alpha_deg = 37
beta_deg = 64
gamma_deg = -112
sd_deg = 2
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from agonic.alignment.files.session_schema import (
    NEEDED,
    SECTIONS,
    Head,
    MagnetometerSection,
    MountingSection,
    PierSection,
    ReferenceSection,
    SiteSection,
    StarSection,
)
from agonic.alignment.files.star_table import diagonal, read_stars
from agonic.alignment.session import Mounting, Pier, Session, Site, StarReadings, check_session
from agonic.alignment.session.session import unix_of
from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.calibration.chain import require_calibration
from agonic.errors import AgonicError, LogError
from agonic.files.calibration import load
from agonic.files.toml_sections import read_toml, section, tried
from agonic.logs.read import open_log
from agonic.maths.earth.earth_rotation import TT_TAI_S, tai_utc_s
from agonic.maths.earth.starlight import Air
from agonic.provenance import Input, sha256_of
from agonic.samples import Samples

FILE_NAME = "session.toml"
GPS_TAI_S = -19.0
AXES = {
    "NED": np.eye(3),
    "XYZ": np.eye(3),
    "ENU": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "NWU": np.diag([1.0, -1.0, -1.0]),
}
"""From the axes of the reference to north, east, down."""


def read_session(path: Path | str) -> Session:
    """The session that a session.toml describes, with its tables.

    Parameters
    ----------
    path : the file, or the folder that it is in.

    Returns a `Session`, its times in UTC and its reference north-east-down. Raises `LogError` that
    names every mistake of the description at once, and `AgonicError` where tables do not belong
    together: times that do not meet, orientations without readings, units that cannot be.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.files.write_session import write_session
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> made = simulate_session(orientations=4, readings=3)
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_session(made.session, folder)
    ...     read_session(folder).orientations.tolist()
    [1, 2, 3, 4]
    """
    given = Path(path)
    file = given / FILE_NAME if given.is_dir() else given
    head, parts = _described(read_toml(file), file)
    home = file.parent
    scale = head.time_scale
    sources: list[Input] = []
    star = _stars(parts["star"], home, scale, sources)
    magnetometer = _in_utc(samples_of(parts["magnetometer"], home, sources), scale)
    reference = _in_utc(samples_of(parts["reference"], home, sources), scale)
    return check_session(
        Session(
            name=head.name,
            site=_site(parts["site"], file),
            star=star,
            magnetometer=_numbered(magnetometer, star),
            reference=north_east_down(reference, parts["reference"].axes),
            pier=pier_of(parts["pier"]),
            mounting=_mounting(parts["mounting"]),
            calibration=calibration_of(parts["magnetometer"], home),
            noise=parts["magnetometer"].noise_nT,
            reference_noise=parts["reference"].noise_nT,
            reference_sd_arcsec=parts["reference"].axes_sd_arcsec,
            sources=tuple(sources),
            notes=(*magnetometer.notes, *reference.notes),
        )
    )


def _described(table: Mapping[str, Any], file: Path) -> tuple[Head, dict[str, Any]]:
    """What the description says, or every mistake in it."""
    mistakes: list[str] = []
    plain = {key: value for key, value in table.items() if key not in SECTIONS}
    head = section(plain, Head, "the file", mistakes, tuple(SECTIONS))
    parts = {
        name: section(table.get(name), kind, f"[{name}]", mistakes)
        for name, kind in SECTIONS.items()
    }
    mistakes += [f"there is no section [{name}]" for name in NEEDED if name not in table]
    for name in ("star", "magnetometer", "reference"):
        part = parts[name]
        if part is not None and not (file.parent / part.file).is_file():
            mistakes.append(f"[{name}]: there is no file {part.file} in {file.parent}")
    mistakes += _numbers_amiss(parts)
    if parts["site"] is not None:
        tried(lambda: _site(parts["site"], file), "[site]", mistakes)
    if mistakes or head is None:
        raise LogError("; ".join(mistakes), path=file)
    return head, parts


def _numbers_amiss(parts: Mapping[str, Any]) -> list[str]:
    """Standard deviations that are not above 0, and halves of a pair."""
    said = []
    for name, part in parts.items():
        for key in () if part is None else part.__struct_fields__:
            value = getattr(part, key)
            if ("sd_" in key or key.startswith("noise")) and value is not None and not value > 0:
                said.append(f"[{name}] {key} is {value:g}; it must be above 0, or left out")
    star = parts["star"]
    if star is not None and (star.across_sd_arcsec is None) != (star.about_sd_arcsec is None):
        said.append("[star] across_sd_arcsec and about_sd_arcsec go together")
    return said


def _site(part: SiteSection, file: Path) -> Site:
    return Site(
        latitude_deg=part.latitude_deg,
        longitude_deg=part.longitude_deg,
        coordinates=part.coordinates,
        air=Air(part.pressure_hPa, part.temperature_C, part.humidity, part.wavelength_um),
    )


def _stars(part: StarSection, home: Path, scale: str, sources: list[Input]) -> StarReadings:
    """The star sensor's readings, in UTC."""
    file = home / part.file
    read = read_stars(file, part.turns)
    sources.append(Input(name=part.file, sha256=sha256_of(file), count=len(read)))
    covariance = read.covariance
    if covariance is None and part.across_sd_arcsec and part.about_sd_arcsec:
        ones = np.ones(len(read))
        covariance = diagonal(part.across_sd_arcsec * ones, part.about_sd_arcsec * ones)
    return replace(
        read,
        time=read.time - _ahead_s(read.time, scale),
        covariance=covariance,
        refraction=part.refraction,
        aberration=part.aberration,
        name=part.name,
    )


def _ahead_s(time: Array, scale: str) -> Array:
    """How far a time scale is ahead of UTC, s."""
    if scale == "UTC":
        return np.zeros_like(time)
    leap = tai_utc_s(time)
    leap = tai_utc_s(time - leap)
    return np.asarray(leap + {"TAI": 0.0, "GPS": GPS_TAI_S, "TT": TT_TAI_S}[scale])


def samples_of(
    part: MagnetometerSection | ReferenceSection, home: Path, sources: list[Input]
) -> Samples:
    """The readings of a magnetometer, whatever the kind of its file."""
    file = home / part.file
    log = open_log(file, unit=part.unit)
    if len(log.sensors) > 1:
        names = ", ".join(sensor.name for sensor in log.sensors)
        raise LogError(f"holds {names}; a session needs a file for each", path=file)
    samples = log.sensors[0]
    sources.append(Input(name=part.file, sha256=sha256_of(file), count=len(samples)))
    return replace(samples, name=part.name, rejected={})


def _in_utc(samples: Samples, scale: str) -> Samples:
    """Samples whose epoch is in a time scale, in UTC."""
    ahead = float(_ahead_s(unix_of(samples)[:1], scale)[0])
    assert samples.epoch is not None, "unix_of refuses samples without"
    return samples.with_columns(epoch=samples.epoch - timedelta(seconds=ahead))


def _numbered(samples: Samples, star: StarReadings) -> Samples:
    """With the numbers of the orientations, by the star sensor's times where the table has none.

    Readings while the platform was turned belong to none and are left out.
    """
    if samples.station is not None:
        wanted = np.isin(samples.station, star.orientation)
        if not wanted.any():
            raise AgonicError(
                "no orientation of the magnetometer's table is in the star sensor's; number them "
                "alike in both"
            )
        return samples if wanted.all() else samples.select(np.flatnonzero(wanted))
    time = unix_of(samples)
    number = np.zeros(len(time))
    for orientation in np.unique(star.orientation):
        own = star.time[star.orientation == orientation]
        number[(time >= own.min() - 0.5) & (time <= own.max() + 0.5)] = orientation
    inside = np.flatnonzero(np.isin(number, star.orientation) & (number != 0))
    if not len(inside):
        raise AgonicError(
            "no reading of the magnetometer falls into an orientation of the star sensor; check "
            "dates, time zones and time_scale, or add a column orientation"
        )
    return samples.with_columns(station=number).select(inside)


def north_east_down(samples: Samples, axes: str) -> Samples:
    """The readings in north, east, down, from the axes that the session names."""
    return samples.with_columns(field=samples.field @ AXES[axes].T)


def pier_of(part: PierSection | None) -> Pier:
    """What the field differs by between the instrument's pier and the reference's."""
    if part is None:
        return Pier()
    return Pier(difference=np.array(part.difference_nT), sd=part.sd_nT)


def _mounting(part: MountingSection | None) -> Mounting | None:
    if part is None:
        return None
    return Mounting(
        alpha_deg=part.alpha_deg,
        beta_deg=part.beta_deg,
        gamma_deg=part.gamma_deg,
        sd_deg=part.sd_deg,
    )


def calibration_of(part: MagnetometerSection, home: Path) -> Calibration | None:
    """The calibration of the magnetometer, where the session names one."""
    return None if not part.calibration else require_calibration(load(home / part.calibration))
