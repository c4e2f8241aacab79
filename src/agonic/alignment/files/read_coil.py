"""coil.toml: a coil whose current is reversed before a magnetometer, and how its axes are known.

Its keys are those of the sections in `description`; docs/jobs/find-true-north.md shows it.
"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from agonic.alignment.files.description import (
    COIL,
    AttitudeSection,
    CoilSection,
    Description,
    Head,
    read_description,
)
from agonic.alignment.session import Site, load_earth_rotation
from agonic.alignment.session.laboratory import Attitude, CoilSession
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.errors import AgonicError
from agonic.files.calibration import load
from agonic.maths.rotations.attitude import rot_nb
from agonic.maths.rotations.frames import ARCSEC_RAD, rot_ci, rot_en

FILE_NAME = "coil.toml"


LEVELLED = ("roll_deg", "pitch_deg", "heading_deg")
STELLAR = ("ra_deg", "dec_deg", "rot_deg", "utc")


def read_coil(path: Path | str) -> CoilSession:
    """The session that a coil.toml describes, with its tables.

    Parameters
    ----------
    path : the file, or the folder that it is in.

    Returns a `CoilSession`. Raises `LogError` that names every mistake of the description at once,
    and `AgonicError` where its parts do not belong together.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.files.write import write_coil
    >>> from agonic.alignment.simulation.laboratory import simulate_coil
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_coil(simulate_coil(reversals=4).session, folder)
    ...     read_coil(folder).geometric_axis.tolist()
    [0.0, 0.0, 1.0]
    """
    description = read_description(path, FILE_NAME, Head, COIL, needed=("magnetometer",))
    parts = description.parts
    _check_attitude_and_axis(description)
    description.require()
    coil, site = parts["coil"] or CoilSection(), description.make_site()
    magnetometer = description.read_samples(parts["magnetometer"])
    alignment, before = _load_alignment(description)
    return CoilSession(
        name=description.head.name,
        coil=coil.name,
        magnetometer=magnetometer,
        reference=description.read_reference(),
        calibration=description.load_calibration() or before,
        geometric_axis=None if coil.axis is None else np.array(coil.axis),
        geometric_frame=coil.frame,
        settle_s=coil.settle_s,
        current_sd=coil.current_sd,
        alignment=alignment,
        attitude=_attitude(parts["attitude"], site),
        site=site,
        sources=tuple(description.sources),
    )


def _check_attitude_and_axis(description: Description) -> None:
    """Note angles that are missing, and an axis without length."""
    attitude, coil = description.parts["attitude"], description.parts["coil"]
    if attitude is not None:
        description.mistakes.extend(
            _attitude_amiss(attitude, description.parts["site"] is not None)
        )
    if coil is not None and coil.axis is not None and not np.any(coil.axis):
        description.mistakes.append("[coil] axis has no length")


def _attitude_amiss(part: AttitudeSection, site: bool) -> list[str]:
    """Angles that are missing, or of both kinds."""
    levelled = [name for name in LEVELLED if getattr(part, name) is not None]
    stellar = [name for name in STELLAR if getattr(part, name) is not None]
    wanted = f"{', '.join(LEVELLED)}, or {', '.join(STELLAR)}"
    if bool(levelled) == bool(stellar):
        return [f"[attitude] needs {wanted}, one of the two"]
    missing = sorted(set(LEVELLED if levelled else STELLAR) - {*levelled, *stellar})
    said = [f"[attitude] needs {', '.join(missing)} too"] if missing else []
    if stellar and not site:
        said.append("[attitude] of a star sensor needs a [site]")
    if part.utc is not None and _moment(part.utc) is None:
        said.append(f"[attitude] utc {part.utc!r} is no time such as 2024-03-12T21:00:00Z")
    return said


def _moment(text: str) -> float | None:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _attitude(part: AttitudeSection | None, site: Site | None) -> Attitude | None:
    """North-east-down into the platform's axes: by levels and azimuth, or by the stars."""
    if part is None:
        return None
    if part.utc is None:
        level, turn = part.level_sd_arcsec, part.heading_sd_arcsec
        # small errors: levels about the platform's own axes, the azimuth about down
        rotation = rot_nb(part.roll_deg or 0.0, part.pitch_deg or 0.0, part.heading_deg or 0.0).T
        down = rotation[:, 2]
        flat = np.eye(3) - np.outer(down, down)
        covariance = (level**2 * flat + turn**2 * np.outer(down, down)) * ARCSEC_RAD**2
        return Attitude(rot_pn=rotation, covariance=covariance, frame="b")
    unix = _moment(part.utc)
    assert site is not None, "checked with the description"
    assert unix is not None, "checked with the description"
    rot_ei = load_earth_rotation().rot_ei([unix])[0]
    sd = np.array([part.across_sd_arcsec, part.across_sd_arcsec, part.about_sd_arcsec])
    star = rot_ci(part.ra_deg or 0.0, part.dec_deg or 0.0, part.rot_deg or 0.0)
    return Attitude(
        rot_pn=star @ rot_ei.T @ rot_en(site.latitude_deg, site.longitude_deg),
        covariance=np.diag(sd**2) * ARCSEC_RAD**2,
        frame="c",
    )


def _load_alignment(description: Description) -> tuple[Alignment | None, Calibration | None]:
    """The alignment, and what corrects the readings before it where both are one chain."""
    part = description.parts["alignment"]
    if part is None:
        return None, None
    file = description.home / part.file
    found = load(file)
    description.add_source(part.file, 1)
    if isinstance(found, Alignment):
        return found, None
    if isinstance(found, Chain) and isinstance(found.steps[-1], Alignment):
        before = found.steps[:-1]
        return found.steps[-1], before[0] if len(before) == 1 else Chain(steps=before)
    raise AgonicError(f"{file} is a {found.kind}, no alignment; fit one, or leave [alignment] out")
