"""The sections of a setup file: which keys each has, and what they hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct

from agonic.calibration.setup import Tilt
from agonic.maths.rotations.tilt import Order


class CompassSection(Struct, forbid_unknown_fields=True):
    """One [[compass]]."""

    calibration: str
    deviation: str | None = None
    sensor: str | None = None
    latency_s: float | None = None
    latency_sd_s: float | None = None


class TiltSection(Struct, forbid_unknown_fields=True):
    """[tilt]"""

    source: Tilt = "auto"
    accelerometer: str | None = None
    order: Order = "roll-pitch"
    sd_deg: float | None = None
    settling_s: float = 10.0


class DeclinationSection(Struct, forbid_unknown_fields=True):
    """[declination]"""

    degrees: float | Literal["model"] = "model"
    sd_deg: float | None = None


class FieldSection(Struct, forbid_unknown_fields=True):
    """[field]"""

    horizontal_nT: float
    vertical_nT: float


class LimitsSection(Struct, forbid_unknown_fields=True):
    """[limits]"""

    magnitude: float = 0.1
    dip_deg: float = 10.0
    tilt_deg: float = 80.0
    disagreement_deg: float = 10.0


SECTIONS: Mapping[str, type[Struct]] = {
    "tilt": TiltSection,
    "declination": DeclinationSection,
    "field": FieldSection,
    "limits": LimitsSection,
}
ATTRIBUTES: Mapping[str, tuple[str, str]] = {
    "tilt": ("tilt", "source"),
    "tilt_order": ("tilt", "order"),
    "tilt_sd_deg": ("tilt", "sd_deg"),
    "settling_s": ("tilt", "settling_s"),
    "declination_deg": ("declination", "degrees"),
    "declination_sd_deg": ("declination", "sd_deg"),
    "horizontal": ("field", "horizontal_nT"),
    "vertical": ("field", "vertical_nT"),
    "magnitude_limit": ("limits", "magnitude"),
    "dip_limit_deg": ("limits", "dip_deg"),
    "tilt_limit_deg": ("limits", "tilt_deg"),
    "disagreement_limit_deg": ("limits", "disagreement_deg"),
}
"""Where each attribute of a `Setup` stands in the file."""
