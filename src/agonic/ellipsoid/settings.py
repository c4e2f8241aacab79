"""What the fits by magnitude have in common to choose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

from agonic.errors import check_choice
from agonic.reference import Reference

Model = Literal["auto", "sphere", "diagonal", "full"]
Fixed = Literal["sphere", "diagonal", "full", "ellipse"]
Method = Literal["likelihood", "adjusted", "li-griffiths", "linear"]
Gauge = Literal["symmetric", "triangular"]

STATED_DIP_DEG = 60.0
"""At which the heading's standard error is stated where no place is known."""

CITATIONS = {
    "likelihood": ("huber-1981", "beaton-tukey-1974"),
    "adjusted": ("markovsky-kukush-vanhuffel-2004", "kukush-markovsky-vanhuffel-2004"),
    "li-griffiths": ("li-griffiths-2004", "nikolaev-2023"),
    "linear": ("li-griffiths-2004",),
}


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a fit; see `fit_ellipsoid`."""

    model: Model = "auto"
    method: Method = "likelihood"
    robust: bool = True
    soft_iron_sd: float | None = 0.1
    gauge: Gauge = "symmetric"
    inclination_deg: float = STATED_DIP_DEG
    seed: int = 0

    def __post_init__(self) -> None:
        check_choice("model", self.model, get_args(Model))
        check_choice("method", self.method, get_args(Method))
        check_choice("gauge", self.gauge, get_args(Gauge))

    def recorded(self, reference: Reference | None) -> Mapping[str, Any]:
        """The settings for the provenance."""
        chosen = {f.name: getattr(self, f.name) for f in fields(self)}
        del chosen["inclination_deg"]
        return {"fit": "ellipsoid", **chosen, "reference": describe_reference(reference)}


def describe_reference(reference: Reference | None) -> str:
    """The reference of a fit by magnitude, in words."""
    if reference is None:
        return "none: mean gain set to 1"
    return reference.describe()
