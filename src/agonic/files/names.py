"""The names of files that belong to a sensor: readable, and never one name for two sensors."""

from __future__ import annotations

import re
from collections.abc import Iterable
from hashlib import sha256
from pathlib import Path

from agonic.atomic import is_written_by_agonic

_INSTANCE = re.compile(r"(sensor_mag|vehicle_magnetometer)\[(\d+)\]")
_LIKE_MADE = re.compile(r"(sensor_mag|vehicle_magnetometer)_\d+|.*-[0-9a-f]{8}", re.DOTALL)
_RESERVED = re.compile(r"con|prn|aux|nul|com\d|lpt\d", re.IGNORECASE)
"""Names that Windows keeps for devices, whatever their ending."""
_LONGEST = 80


def file_stem(sensor: str) -> str:
    """A sensor's name as part of a file name; distinct names give distinct parts. Letters, digits,
    "-" and "_" stay. Where others had to be replaced, a digest of the name follows, but for the
    numbered topics of PX4."""
    if topic := _INSTANCE.fullmatch(sensor):
        return f"{topic[1]}_{topic[2]}"
    kept = re.sub(r"[^A-Za-z0-9_-]", "_", sensor)
    plain = kept.strip("_") == sensor != "" and len(kept) <= _LONGEST
    if plain and not _LIKE_MADE.fullmatch(kept) and not _RESERVED.fullmatch(kept):
        return kept
    digest = sha256(sensor.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{kept[:_LONGEST].strip('_') or 'sensor'}-{digest}"


def find_stale(folder: Path, written: Iterable[str | Path]) -> list[str]:
    """A sentence on calibrations, their exports and a setup that lie here from an earlier run."""
    here = {Path(path).name for path in written}
    stems = {path.stem for path in folder.glob("*.json")} | {"setup"}
    old = [
        path.name
        for path in sorted(folder.iterdir())
        if path.stem in stems and path.name not in here
        and path.is_file() and is_written_by_agonic(path)
    ]  # fmt: skip
    return [f"{', '.join(old)}: of an earlier run, not of this report; delete them"] if old else []
