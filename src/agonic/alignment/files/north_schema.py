"""The sections of a north.toml: which keys each has, and what they hold."""

from __future__ import annotations

from msgspec import Struct

from agonic.alignment.files.session_schema import MagnetometerSection, PierSection, ReferenceSection


class NorthHead(Struct):
    """What stands before the first section."""

    name: str = ""


class GyroSection(Struct):
    """[gyro]"""

    constant_arcsec: float = 0.0
    constant_sd_arcsec: float = 0.0
    reading_sd_arcsec: float | None = None
    time_sd_s: float | None = None
    transit_constant: float | None = None
    transit_constant_sd: float = 0.0


class ReversalSection(Struct):
    """[reversal]"""

    file: str = "reversal.csv"


class TransitSection(Struct):
    """[transit]"""

    file: str = "transit.csv"


class SwingSection(Struct):
    """[swing]"""

    file: str = "swing.csv"


class SightingSection(Struct):
    """[[sighting]]"""

    name: str
    readings_deg: list[float] | None = None
    readings_gon: list[float] | None = None
    mirror: bool = False


class PlatformSection(Struct):
    """[platform]"""

    file: str = "platform.csv"
    circle_sd_arcsec: float = 2.0
    level_sd_arcsec: float = 2.0
    mirror: bool = False


SECTIONS: dict[str, type[Struct]] = {
    "gyro": GyroSection,
    "reversal": ReversalSection,
    "transit": TransitSection,
    "swing": SwingSection,
    "platform": PlatformSection,
    "magnetometer": MagnetometerSection,
    "reference": ReferenceSection,
    "pier": PierSection,
}
