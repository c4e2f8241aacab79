"""The bibliography: the published sources of every method, by key (`citations.toml`)."""

from __future__ import annotations

import tomllib
from pathlib import Path

from agonic.errors import AgonicError

CITATIONS: dict[str, str] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
"""Full references by the key that `Provenance.method` holds."""


def find_citation(key: str) -> str:
    """The full reference of a method key.

    Raises `AgonicError` for a key that is not in the bibliography.

    >>> find_citation("huber-1981")
    'P. J. Huber: Robust Statistics. Wiley, New York, 1981. doi:10.1002/0471725250'
    """
    if key not in CITATIONS:
        raise AgonicError(f"no citation {key!r}; known keys are {', '.join(CITATIONS)}")
    return CITATIONS[key]
