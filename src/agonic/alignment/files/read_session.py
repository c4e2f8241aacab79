"""session.toml: what the tables of a session are about.

Its keys are those of the sections in `description`; docs/jobs/align-with-a-star-sensor.md shows it.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np

from agonic.alignment.files.description import (
    NEEDED,
    SESSION,
    Description,
    SessionHead,
    StarSection,
    read_description,
)
from agonic.alignment.files.star_table import make_diagonal, read_stars
from agonic.alignment.session import Session, StarReadings, check_session
from agonic.alignment.session.session import compute_unix_s
from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.files.toml_sections import try_to_make
from agonic.maths.earth.earth_rotation import TT_TAI_S, tai_utc_s
from agonic.samples import Samples

FILE_NAME = "session.toml"
GPS_TAI_S = -19.0


def read_session(path: Path | str) -> Session:
    """The session that a session.toml describes, with its tables.

    Parameters
    ----------
    path : the file, or the folder that it is in.

    Returns a `Session`, its times in UTC and its reference north-east-down. Raises `LogError` that
    names every mistake of the description at once, and `AgonicError` where tables do not belong
    together: times that do not meet, orientations without readings, units that cannot be.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.files.write import write_session
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> made = simulate_session(orientations=4, readings=3)
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_session(made.session, folder)
    ...     read_session(folder).orientations.tolist()
    [1, 2, 3, 4]
    """
    description = read_description(path, FILE_NAME, SessionHead, SESSION, needed=NEEDED, zero=False)
    parts = description.parts
    _check_stars_and_site(description)
    description.require()
    scale = description.head.time_scale
    star = _read_stars(description, scale)
    magnetometer = _turn_into_utc(description.read_samples(parts["magnetometer"]), scale)
    reference, site = description.read_reference(), description.make_site()
    assert reference is not None, "required above"
    assert site is not None, "required above"
    reference = _turn_into_utc(reference, scale)
    turned = parts["remanence"]
    return check_session(
        Session(
            name=description.head.name,
            site=site,
            star=star,
            magnetometer=_number_orientations(magnetometer, star),
            reference=reference,
            pier=description.make_pier(),
            mounting=parts["mounting"],
            calibration=description.load_calibration(),
            noise=parts["magnetometer"].noise_nT,
            reference_noise=parts["reference"].noise_nT,
            reference_sd_arcsec=parts["reference"].axes_sd_arcsec,
            remanence=None if turned is None else description.read_samples(turned),
            sources=tuple(description.sources),
            notes=(*magnetometer.notes, *reference.notes),
        )
    )


def _check_stars_and_site(description: Description) -> None:
    """Note half of a pair of standard deviations, and a place that cannot be."""
    star, site = description.parts["star"], description.parts["site"]
    if star is not None and (star.across_sd_arcsec is None) != (star.about_sd_arcsec is None):
        description.mistakes.append("[star] across_sd_arcsec and about_sd_arcsec go together")
    if site is not None:
        try_to_make(description.make_site, "[site]", description.mistakes)


def _read_stars(description: Description, scale: str) -> StarReadings:
    """The star sensor's readings, in UTC."""
    part: StarSection = description.parts["star"]
    read = read_stars(description.home / part.file, part.turns)
    description.add_source(part.file, len(read))
    covariance = read.covariance
    if covariance is None and part.across_sd_arcsec and part.about_sd_arcsec:
        ones = np.ones(len(read))
        covariance = make_diagonal(part.across_sd_arcsec * ones, part.about_sd_arcsec * ones)
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


def _turn_into_utc(samples: Samples, scale: str) -> Samples:
    """Samples whose epoch is in a time scale, in UTC."""
    ahead = float(_ahead_s(compute_unix_s(samples)[:1], scale)[0])
    assert samples.epoch is not None, "unix_of refuses samples without"
    return samples.with_columns(epoch=samples.epoch - timedelta(seconds=ahead))


def _number_orientations(samples: Samples, star: StarReadings) -> Samples:
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
    time = compute_unix_s(samples)
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
