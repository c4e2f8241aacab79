"""What the attitude-aided fits have in common to choose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

from agonic.errors import AgonicError, check_choice

Model = Literal["sphere", "diagonal", "full"]
Gauge = Literal["auto", "symmetric", "free"]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a fit; see `fit_levelled`."""

    model: Model = "full"
    gauge: Gauge = "auto"
    sources: tuple[str, ...] = ()
    robust: bool = True
    soft_iron_sd: float | None = 0.1
    turn_sd_deg: float | None = 2.0
    inclination_deg: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        check_choice("model", self.model, get_args(Model))
        check_choice("gauge", self.gauge, get_args(Gauge))
        object.__setattr__(self, "sources", tuple(self.sources))
        if len(set(self.sources)) < len(self.sources):
            raise AgonicError(f"a source is named twice: {', '.join(self.sources)}")
        for name in ("soft_iron_sd", "turn_sd_deg"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise AgonicError(f"{name} is {value}; a prior needs it above zero, or None")

    def recorded(self) -> Mapping[str, Any]:
        """The settings for the provenance."""
        plain = {f.name: getattr(self, f.name) for f in fields(self)}
        return plain | {"sources": list(self.sources)}
