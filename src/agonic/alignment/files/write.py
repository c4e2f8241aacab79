"""`write_session`, `write_north`, `write_coil`: a folder as its reader reads it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import asdict

from agonic.alignment.direction.result import FieldDirection
from agonic.alignment.files import read_coil, read_north, read_session
from agonic.alignment.files.description import GyroSection, PlatformSection
from agonic.alignment.files.star_table import format_stars, format_table
from agonic.alignment.session import Session, Site
from agonic.alignment.session.laboratory import Attitude, CoilSession, NorthSession
from agonic.arrays import Array
from agonic.atomic import make_folder, write_atomically
from agonic.errors import AgonicError
from agonic.exports.csv import write_csv
from agonic.files.calibration import save
from agonic.files.toml_text import write_value
from agonic.maths.rotations.attitude import angles_deg
from agonic.maths.rotations.frames import ARCSEC_RAD

DIGITS = {"unix_s": 6, "nT": 4, "deg": 7, "arcsec": 3}
"""Decimals of a column, by the unit that its name ends in: a tenth of what can be known."""


def write_direction(found: FieldDirection, file: Path) -> Path:
    """Write a row a reading that has an attitude, its columns those of `FieldDirection.columns`."""
    cells = {
        name: [f"{value:.{digits}f}" for value in values.tolist()]
        for name, values in found.columns().items()
        for unit, digits in DIGITS.items()
        if name.endswith(unit)
    }
    return write_atomically(file, format_table(cells))


Sections = dict[str, Mapping[str, Any] | None]


def write_session(session: Session, folder: Path | str) -> list[Path]:
    """Write a session's description and tables, and return their paths, session.toml last.

    Parameters: `session`; `folder`, made where it is not there. Raises `AgonicError` where a file
    cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> with TemporaryDirectory() as folder:
    ...     files = write_session(simulate_session(orientations=4, readings=3).session, folder)
    ...     print(*(file.name for file in files))
    star.csv magnetometer.csv reference.csv session.toml
    """
    home = make_folder(folder)
    star, turned, sky = session.star, session.remanence, session.site.air._asdict()
    files = [write_atomically(home / "star.csv", format_stars(star)), *_write(session, home)]
    if turned is not None:
        files.append(write_csv(turned, home / "remanence.csv"))
    about = ("name", "refraction", "aberration")
    sections: Sections = {
        "": {"name": session.name, "time_scale": "UTC"},
        "site": _place(session.site) | {"coordinates": session.site.coordinates} | sky,
        "star": {"file": "star.csv", **{key: getattr(star, key) for key in about}},
        **_describe_instruments(session),
        "remanence": None if turned is None else {"file": "remanence.csv"},
        "mounting": None if session.mounting is None else asdict(session.mounting),
    }
    return [*files, _write_toml(home / read_session.FILE_NAME, sections)]


def write_north(session: NorthSession, folder: Path | str) -> list[Path]:
    """Write north.toml and its tables, as `read_north` reads them; return their paths.

    Parameters: `session`; `folder`, made where it is not there.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.north import simulate_north
    >>> with TemporaryDirectory() as folder:
    ...     files = write_north(simulate_north(orientations=0).session, folder)
    ...     print(*(file.name for file in files))
    reversal.csv transit.csv swing.csv north.toml
    """
    home, platform = make_folder(folder), session.platform
    given = {"transit": session.transits, "swing": session.swing, "platform": platform}
    tables: dict[str, dict[str, Array]] = {}
    if session.turning_deg is not None:
        tables["reversal"] = {"reading_deg": session.turning_deg}
    for name, part in given.items():
        if part is not None:
            tables[name] = {key: getattr(part, key) for key in read_north.TABLES[name]}
    files = [
        write_atomically(home / f"{name}.csv", format_table(columns))
        for name, columns in tables.items()
    ]
    sections: Sections = {
        "": {"name": session.name},
        "gyro": {key: getattr(session, key) for key in GyroSection.__struct_fields__},
        **{name: {"file": f"{name}.csv"} for name in tables if name != "platform"},
    }
    sighted = [
        {"name": one.name, "readings_deg": one.reading_deg.tolist(), "mirror": one.mirror}
        for one in session.sightings
    ]
    if platform is not None:
        keys = PlatformSection.__struct_fields__[1:]
        stood = {key: getattr(platform, key) for key in keys}
        sections["platform"] = {"file": "platform.csv", **stood}
    if session.magnetometer is not None:
        sections |= _describe_instruments(session)
    files += _write(session, home)
    return [*files, _write_toml(home / read_north.FILE_NAME, sections, sighted)]


def write_coil(session: CoilSession, folder: Path | str) -> list[Path]:
    """Write coil.toml with its tables, as `read_coil` reads them; return their paths.

    Parameters: `session`; `folder`, made where it is not there. The attitude is written as roll,
    pitch and heading of the platform.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.laboratory import simulate_coil
    >>> with TemporaryDirectory() as folder:
    ...     files = write_coil(simulate_coil(reversals=4).session, folder)
    ...     print(*(file.name for file in files))
    magnetometer.csv reference.csv alignment.json coil.toml
    """
    home = make_folder(folder)
    axis, site, files = session.geometric_axis, session.site, _write(session, home)
    if session.alignment is not None:
        files.append(save(session.alignment, home / "alignment.json"))
    sections: Sections = {
        "": {"name": session.name},
        "coil": {
            "name": session.coil,
            "axis": None if axis is None else axis.tolist(),
            "frame": session.geometric_frame,
            "settle_s": session.settle_s,
            "current_sd": session.current_sd,
        },
        "magnetometer": _describe_magnetometer(session),
        "reference": None if session.reference is None else {"file": "reference.csv"},
        "alignment": None if session.alignment is None else {"file": "alignment.json"},
        "attitude": None if session.attitude is None else _describe_attitude(session.attitude),
        "site": None if site is None else _place(site),
    }
    return [*files, _write_toml(home / read_coil.FILE_NAME, sections)]


def _describe_attitude(attitude: Attitude) -> dict[str, float]:
    if attitude.frame != "b":
        raise AgonicError("an attitude in a star sensor's axes is not written; give ra, dec, rot")
    roll, pitch, heading = (float(a) for a in angles_deg(attitude.rot_pn.T))
    down = attitude.rot_pn[:, 2]
    about = float(down @ attitude.covariance @ down)
    level = (float(np.trace(attitude.covariance)) - about) / 2
    return {
        "roll_deg": roll,
        "pitch_deg": pitch,
        "heading_deg": heading,
        "level_sd_arcsec": float(np.sqrt(max(level, 0.0))) / ARCSEC_RAD,
        "heading_sd_arcsec": float(np.sqrt(about)) / ARCSEC_RAD,
    }


def _place(site: Site) -> dict[str, Any]:
    return {"latitude_deg": site.latitude_deg, "longitude_deg": site.longitude_deg}


def _describe_magnetometer(session: Session | NorthSession | CoilSession) -> dict[str, Any]:
    known = session.calibration is not None
    return {"file": "magnetometer.csv", "calibration": "calibration.json" if known else None}


def _describe_instruments(session: Session | NorthSession) -> Sections:
    """The sections of magnetometer, reference and pier."""
    pier, axes_sd = session.pier, getattr(session, "reference_sd_arcsec", None)
    return {
        "magnetometer": _describe_magnetometer(session) | {"noise_nT": session.noise},
        "reference": {
            "file": "reference.csv",
            "axes": "NED",
            "noise_nT": session.reference_noise,
            "axes_sd_arcsec": axes_sd,
        },
        "pier": {"difference_nT": [float(v) for v in pier.difference], "sd_nT": pier.sd},
    }


def _write(session: Session | NorthSession | CoilSession, home: Path) -> list[Path]:
    """Write the readings of magnetometer and reference, and the calibration: what there is."""
    given = {"magnetometer": session.magnetometer, "reference": session.reference}
    files = [
        write_csv(samples, home / f"{name}.csv")
        for name, samples in given.items()
        if samples is not None
    ]
    if session.calibration is not None:
        files.append(save(session.calibration, home / "calibration.json"))
    return files


def _write_toml(
    file: Path, sections: Sections, sighted: list[dict[str, Any]] | None = None
) -> Path:
    """Write sections of keys one after the other, the one without a name first; what is None is
    left out. The `sighted` stand in sections of one name, after all others."""
    every = [*sections.items(), *(("[sighting]", one) for one in sighted or ())]
    lines = []
    for name, keys in every:
        if keys is None:
            continue
        lines += ["", f"[{name}]"] if name else []
        lines += [
            f"{key} = {write_value(value)}" for key, value in keys.items() if value is not None
        ]
    return write_atomically(file, "\n".join(lines) + "\n")
