"""The sections of a session.toml: which keys each has, and what they hold."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

Effect = Literal["present", "removed"]


class SessionHead(Struct):
    """What stands before the first section."""

    name: str = ""
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


class MountingSection(Struct):
    """[mounting]"""

    alpha_deg: float
    beta_deg: float
    gamma_deg: float
    sd_deg: float = 2.0


SECTIONS: dict[str, type[Struct]] = {
    "site": SiteSection,
    "star": StarSection,
    "magnetometer": MagnetometerSection,
    "reference": ReferenceSection,
    "pier": PierSection,
    "remanence": RemanenceSection,
    "mounting": MountingSection,
}
NEEDED = ("site", "star", "magnetometer", "reference")
