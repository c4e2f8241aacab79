"""The sections of session.toml, north.toml and coil.toml: their keys, and what these hold."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from agonic.alignment.session import Mounting

Effect = Literal["present", "removed"]


class Head(Struct):
    """What stands before the first section."""

    name: str = ""


class SessionHead(Head):
    """The same of a session.toml."""

    time_scale: Literal["UTC", "TAI", "GPS", "TT"] = "UTC"


class SiteSection(Struct):
    """[site]"""

    latitude_deg: float
    longitude_deg: float
    coordinates: Literal["astronomical", "geodetic"] = "astronomical"
    pressure_hPa: float = 1013.25
    temperature_C: float = 15.0
    humidity: float = 0.5
    wavelength_um: float = 0.6


class StarSection(Struct):
    """[star]"""

    refraction: Effect
    aberration: Effect
    file: str = "star.csv"
    name: str = "star sensor"
    turns: Literal["ci", "ic"] = "ci"
    across_sd_arcsec: float | None = None
    about_sd_arcsec: float | None = None


class MagnetometerSection(Struct):
    """[magnetometer]"""

    file: str = "magnetometer.csv"
    name: str = "magnetometer"
    unit: str | None = None
    noise_nT: float | None = None
    calibration: str = ""


class ReferenceSection(Struct):
    """[reference]"""

    file: str = "reference.csv"
    name: str = "reference"
    unit: str | None = None
    axes: Literal["NED", "XYZ", "ENU", "NWU"] = "NED"
    noise_nT: float | None = None
    axes_sd_arcsec: float | None = None


class PierSection(Struct):
    """[pier]"""

    difference_nT: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sd_nT: float | None = None


class RemanenceSection(Struct):
    """[remanence]"""

    file: str = "remanence.csv"
    name: str = "magnetometer"
    unit: str | None = None


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


SESSION: dict[str, type[Struct]] = {
    "site": SiteSection,
    "star": StarSection,
    "magnetometer": MagnetometerSection,
    "reference": ReferenceSection,
    "pier": PierSection,
    "remanence": RemanenceSection,
    "mounting": Mounting,
}
NEEDED = ("site", "star", "magnetometer", "reference")
NORTH: dict[str, type[Struct]] = {
    "gyro": GyroSection,
    "reversal": ReversalSection,
    "transit": TransitSection,
    "swing": SwingSection,
    "platform": PlatformSection,
    "magnetometer": MagnetometerSection,
    "reference": ReferenceSection,
    "pier": PierSection,
}
COIL: dict[str, type[Struct]] = {
    "coil": CoilSection,
    "magnetometer": MagnetometerSection,
    "reference": ReferenceSection,
    "alignment": AlignmentSection,
    "attitude": AttitudeSection,
    "site": SiteSection,
}
