"""What the descriptions of all sessions share when they are written: TOML, and their tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agonic.alignment.session import Session
from agonic.alignment.session.coil import CoilSession
from agonic.alignment.session.north import NorthSession
from agonic.atomic import write_atomically
from agonic.exports.csv import write_csv
from agonic.files.calibration import save
from agonic.files.toml_text import write_value


def write_instruments(session: Session | NorthSession | CoilSession, home: Path) -> list[Path]:
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


def magnetometer_keys(session: Session | NorthSession | CoilSession) -> dict[str, Any]:
    """The section [magnetometer], but for its noise."""
    known = session.calibration is not None
    return {"file": "magnetometer.csv", "calibration": "calibration.json" if known else None}


def pier_keys(session: Session | NorthSession) -> dict[str, Any]:
    """The section [pier]."""
    return {
        "difference_nT": [float(value) for value in session.pier.difference],
        "sd_nT": session.pier.sd,
    }


def write_toml(file: Path, parts: Sequence[tuple[str, Mapping[str, Any] | None]]) -> Path:
    """Write sections of keys one after the other; what is None is left out.

    A section without a name comes first; one in brackets of its own is one of several of its kind.
    """
    lines = []
    for name, keys in parts:
        if keys is None:
            continue
        lines += ["", f"[{name}]"] if name else []
        lines += [
            f"{key} = {write_value(value)}" for key, value in keys.items() if value is not None
        ]
    return write_atomically(file, "\n".join(lines) + "\n")
