"""`write_session`: a folder with session.toml and its tables, as `read_session` reads them."""

from __future__ import annotations

import json
from pathlib import Path

from agonic.alignment.files.read_session import FILE_NAME
from agonic.alignment.files.star_table import text_of_stars
from agonic.alignment.session import Session
from agonic.atomic import make_folder, write_atomically
from agonic.exports.csv import write_csv
from agonic.files.calibration import save


def write_session(session: Session, folder: Path | str) -> list[Path]:
    """Write a session's description and tables, and return their paths, session.toml last.

    Raises `AgonicError` where a file cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> with TemporaryDirectory() as folder:
    ...     files = write_session(simulate_session(orientations=4, readings=3).session, folder)
    ...     print(*(file.name for file in files))
    star.csv magnetometer.csv reference.csv session.toml
    """
    home = make_folder(folder)
    files = [
        write_atomically(home / "star.csv", text_of_stars(session.star)),
        write_csv(session.magnetometer, home / "magnetometer.csv"),
        write_csv(session.reference, home / "reference.csv"),
    ]
    if session.calibration is not None:
        files.append(save(session.calibration, home / "calibration.json"))
    return [*files, write_atomically(home / FILE_NAME, text_of_session(session))]


def text_of_session(session: Session) -> str:
    """session.toml."""
    site, star, air = session.site, session.star, session.site.air
    sections: dict[str, dict[str, object]] = {
        "": {"name": session.name, "time_scale": "UTC"},
        "site": {
            "latitude_deg": site.latitude_deg,
            "longitude_deg": site.longitude_deg,
            "coordinates": site.coordinates,
            **air._asdict(),
        },
        "star": {
            "file": "star.csv",
            "name": star.name,
            "refraction": star.refraction,
            "aberration": star.aberration,
        },
        "magnetometer": {
            "file": "magnetometer.csv",
            "noise_nT": session.noise,
            "calibration": None if session.calibration is None else "calibration.json",
        },
        "reference": {
            "file": "reference.csv",
            "axes": "NED",
            "noise_nT": session.reference_noise,
            "axes_sd_arcsec": session.reference_sd_arcsec,
        },
        "pier": {
            "difference_nT": [float(value) for value in session.pier.difference],
            "sd_nT": session.pier.sd,
        },
    }
    if (mounting := session.mounting) is not None:
        sections["mounting"] = {
            "alpha_deg": mounting.alpha_deg,
            "beta_deg": mounting.beta_deg,
            "gamma_deg": mounting.gamma_deg,
            "sd_deg": mounting.sd_deg,
        }
    return "\n".join(_text(name, keys) for name, keys in sections.items())


def _text(name: str, keys: dict[str, object]) -> str:
    """A section; what is not known is left out."""
    lines = [f"[{name}]"] if name else []
    lines += [
        f"{key} = {json.dumps(value, ensure_ascii=False)}"
        for key, value in keys.items()
        if value is not None
    ]
    return "\n".join(lines) + "\n"
