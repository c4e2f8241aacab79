"""The bibliography: the published sources of every method, by key (`citations.toml`)."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path

from agonic.errors import AgonicError

CITATIONS: dict[str, str] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
"""Full references by the key that `Provenance.method` holds."""


WORLD_MODELS = {
    "IGRF-14": "iaga-2024",
    "WMM2025": "ncei-wmm2025-2024",
    "WMMHR2025": "ncei-wmmhr2025-2024",
}
"""What gave a reference, and where it was published."""


def find_citation(key: str) -> str:
    """The full reference of a method key.

    Raises `AgonicError` for a key that is not in the bibliography.
    """
    if key not in CITATIONS:
        raise AgonicError(f"no citation {key!r}; known keys are {', '.join(CITATIONS)}")
    return CITATIONS[key]


def list_cited(method: Iterable[str], settings: Mapping[str, object]) -> list[str]:
    """The keys of what a result is made by: its methods, and a world model
    that its settings name."""
    named = " ".join(map(str, settings.values()))
    return [*method, *(key for model, key in WORLD_MODELS.items() if model in named)]
