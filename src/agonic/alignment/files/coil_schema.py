"""The sections of a coil.toml: which keys each has, and what they hold."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from agonic.alignment.files.session_schema import MagnetometerSection, ReferenceSection, SiteSection


class CoilSection(Struct):
    """[coil]"""

    name: str = "coil"
    axis: tuple[float, float, float] | None = None
    frame: Literal["m", "b", "c", "n"] = "m"
    settle_s: float = 0.0
    current_sd: float = 0.0


class AlignmentSection(Struct):
    """[alignment]"""

    file: str


class AttitudeSection(Struct):
    """[attitude]"""

    roll_deg: float | None = None
    pitch_deg: float | None = None
    heading_deg: float | None = None
    level_sd_arcsec: float = 0.0
    heading_sd_arcsec: float = 0.0
    ra_deg: float | None = None
    dec_deg: float | None = None
    rot_deg: float | None = None
    utc: str | None = None
    across_sd_arcsec: float = 0.0
    about_sd_arcsec: float = 0.0


SECTIONS: dict[str, type[Struct]] = {
    "coil": CoilSection,
    "magnetometer": MagnetometerSection,
    "reference": ReferenceSection,
    "alignment": AlignmentSection,
    "attitude": AttitudeSection,
    "site": SiteSection,
}
