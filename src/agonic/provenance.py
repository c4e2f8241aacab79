"""Where a result came from: inputs by hash, settings, software, method, parents."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from agonic.atomic import mark_input
from agonic.version import __version__


@dataclass(frozen=True, kw_only=True)
class Input:
    """One thing that went in: its name, the SHA-256 of its bytes, and how many rows were used."""

    name: str
    sha256: str
    count: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", escape_text(self.name))

    @classmethod
    def of_array(cls, name: str, array: np.ndarray[Any, Any]) -> Input:
        """The input that an array is, hashed as little-endian float64."""
        data = np.ascontiguousarray(array, dtype="<f8")
        return cls(name=name, sha256=hashlib.sha256(data.data).hexdigest(), count=len(data))


def escape_text(name: str) -> str:
    r"""A name that can be written: bytes of a file's name that are no UTF-8 stand as escapes."""
    return name.encode("utf-8", "backslashreplace").decode()


def hash_file(path: Path) -> str:
    """The SHA-256 of a file, read in pieces; nothing is written over it from now on."""
    mark_input(path)
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Inputs, settings, software, method citations (keys of `agonic cite`) and parent hashes."""

    inputs: tuple[Input, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    method: tuple[str, ...] = ()
    parents: tuple[str, ...] = ()
    software: str = f"agonic {__version__}"
    created: str = field(default_factory=_now)
