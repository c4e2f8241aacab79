"""`write_coil`: a folder with coil.toml and its tables, as `read_coil` reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from agonic.alignment.files.read_coil import FILE_NAME
from agonic.alignment.files.write_description import (
    magnetometer_keys,
    write_instruments,
    write_toml,
)
from agonic.alignment.session.coil import Attitude, CoilSession
from agonic.atomic import make_folder
from agonic.errors import AgonicError
from agonic.files.calibration import save
from agonic.maths.rotations.attitude import angles_deg
from agonic.maths.rotations.frames import ARCSEC_RAD


def write_coil(session: CoilSession, folder: Path | str) -> list[Path]:
    """Write coil.toml with its tables, as `read_coil` reads them; return their paths.

    Parameters: `session`; `folder`, made where it is not there. The attitude is written as roll,
    pitch and heading of the platform.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.coil import simulate_coil
    >>> with TemporaryDirectory() as folder:
    ...     files = write_coil(simulate_coil(reversals=4).session, folder)
    ...     print(*(file.name for file in files))
    magnetometer.csv reference.csv alignment.json coil.toml
    """
    home = make_folder(folder)
    axis, site, files = session.geometric_axis, session.site, write_instruments(session, home)
    coil = {
        "name": session.coil,
        "axis": None if axis is None else axis.tolist(),
        "frame": session.geometric_frame,
        "settle_s": session.settle_s,
        "current_sd": session.current_sd,
    }
    if session.alignment is not None:
        files.append(save(session.alignment, home / "alignment.json"))
    parts: list[tuple[str, dict[str, Any] | None]] = [
        ("", {"name": session.name}),
        ("coil", coil),
        ("magnetometer", magnetometer_keys(session)),
        ("reference", None if session.reference is None else {"file": "reference.csv"}),
        ("alignment", None if session.alignment is None else {"file": "alignment.json"}),
        ("attitude", None if session.attitude is None else _attitude_keys(session.attitude)),
        (
            "site",
            None
            if site is None
            else {"latitude_deg": site.latitude_deg, "longitude_deg": site.longitude_deg},
        ),
    ]
    return [*files, write_toml(home / FILE_NAME, parts)]


def _attitude_keys(attitude: Attitude) -> dict[str, float]:
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
