"""`write_session`: a folder with session.toml and its tables, as `read_session` reads them."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from agonic.alignment.files.read_session import FILE_NAME
from agonic.alignment.files.star_table import format_stars
from agonic.alignment.files.write_description import (
    magnetometer_keys,
    pier_keys,
    write_instruments,
    write_toml,
)
from agonic.alignment.session import Session
from agonic.atomic import make_folder, write_atomically
from agonic.exports.csv import write_csv


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
    site, star, mounting = session.site, session.star, session.mounting
    return [
        write_atomically(home / "star.csv", format_stars(star)),
        *write_instruments(session, home),
        *_write_remanence(session, home),
        write_toml(
            home / FILE_NAME,
            [
                ("", {"name": session.name, "time_scale": "UTC"}),
                (
                    "site",
                    {
                        "latitude_deg": site.latitude_deg,
                        "longitude_deg": site.longitude_deg,
                        "coordinates": site.coordinates,
                        **site.air._asdict(),
                    },
                ),
                (
                    "star",
                    {
                        "file": "star.csv",
                        "name": star.name,
                        "refraction": star.refraction,
                        "aberration": star.aberration,
                    },
                ),
                ("magnetometer", {**magnetometer_keys(session), "noise_nT": session.noise}),
                (
                    "reference",
                    {
                        "file": "reference.csv",
                        "axes": "NED",
                        "noise_nT": session.reference_noise,
                        "axes_sd_arcsec": session.reference_sd_arcsec,
                    },
                ),
                ("pier", pier_keys(session)),
                (
                    "remanence",
                    None if session.remanence is None else {"file": "remanence.csv"},
                ),
                ("mounting", None if mounting is None else asdict(mounting)),
            ],
        ),
    ]


def _write_remanence(session: Session, home: Path) -> list[Path]:
    """The readings with the platform turned, where there are any."""
    if session.remanence is None:
        return []
    return [write_csv(session.remanence, home / "remanence.csv")]
