"""What the descriptions of all sessions share: reading their sections, the tables they name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from msgspec import Struct, defstruct

from agonic.alignment.session import Mounting, Pier, Site
from agonic.calibration.base import Calibration
from agonic.calibration.steps import require_calibration
from agonic.errors import LogError
from agonic.files.calibration import load
from agonic.files.toml_sections import read_section, read_toml
from agonic.logs.read import open_log
from agonic.maths.earth.starlight import Air
from agonic.provenance import Input, hash_file
from agonic.samples import Samples

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
    **{
        name: defstruct(name, [("file", str, f"{name}.csv")])
        for name in ("reversal", "transit", "swing")
    },
    "platform": PlatformSection,
    "magnetometer": MagnetometerSection,
    "reference": ReferenceSection,
    "pier": PierSection,
}
COIL: dict[str, type[Struct]] = {
    "coil": CoilSection,
    "magnetometer": MagnetometerSection,
    "reference": ReferenceSection,
    "alignment": defstruct("alignment", [("file", str)]),
    "attitude": AttitudeSection,
    "site": SiteSection,
}


AXES = {
    "NED": np.eye(3),
    "XYZ": np.eye(3),
    "ENU": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "NWU": np.diag([1.0, -1.0, -1.0]),
}
"""From the axes of the reference to north, east, down."""


@dataclass(frozen=True, kw_only=True)
class Description:
    """A description as it was read: what stands before its sections, and each section.

    `parts` are None where a section is missing or wrong; every mistake is in `mistakes`, to which
    further checks add theirs before `require`. `sources` are the tables that were read.
    """

    file: Path
    table: Mapping[str, Any]
    head: Any
    parts: Mapping[str, Any]
    mistakes: list[str]
    sources: list[Input] = field(default_factory=list)

    @property
    def home(self) -> Path:
        """The folder of the tables."""
        return self.file.parent

    def require(self) -> None:
        """Raise a `LogError` that names every mistake, if there is one."""
        if self.mistakes or self.head is None:
            raise LogError("; ".join(self.mistakes), path=self.file)

    def read_samples(
        self, part: MagnetometerSection | ReferenceSection | RemanenceSection
    ) -> Samples:
        """The readings of a magnetometer, whatever the kind of its file."""
        path = self.home / part.file
        log = open_log(path, unit=part.unit)
        if len(log.sensors) > 1:
            names = ", ".join(sensor.name for sensor in log.sensors)
            raise LogError(f"holds {names}; a session needs a file for each", path=path)
        samples = log.sensors[0]
        self.add_source(part.file, len(samples))
        return replace(samples, name=part.name, rejected={})

    def read_reference(self) -> Samples | None:
        """The readings of the reference in north, east, down, where there is one."""
        part = self.parts["reference"]
        if part is None:
            return None
        samples = self.read_samples(part)
        return samples.with_columns(field=samples.field @ AXES[part.axes].T)

    def load_calibration(self) -> Calibration | None:
        """The calibration of the magnetometer, where one is named."""
        part = self.parts["magnetometer"]
        if part is None or not part.calibration:
            return None
        return require_calibration(load(self.home / part.calibration))

    def make_pier(self) -> Pier:
        """What the field differs by between the instrument's pier and the reference's."""
        part: PierSection | None = self.parts["pier"]
        if part is None:
            return Pier()
        return Pier(difference=np.array(part.difference_nT), sd=part.sd_nT)

    def make_site(self) -> Site | None:
        """Where the instruments stand."""
        part: SiteSection | None = self.parts["site"]
        if part is None:
            return None
        return Site(
            latitude_deg=part.latitude_deg,
            longitude_deg=part.longitude_deg,
            coordinates=part.coordinates,
            air=Air(part.pressure_hPa, part.temperature_C, part.humidity, part.wavelength_um),
        )

    def add_source(self, name: str, count: int) -> None:
        """Note a table as read."""
        self.sources.append(Input(name=name, sha256=hash_file(self.home / name), count=count))


_KINDS = (("session.toml", "alignment"), ("north.toml", "north"), ("coil.toml", "coil"))
"""Descriptions, and the fits that they are for."""


def read_description(
    path: Path | str,
    name: str,
    head: type[Struct],
    sections: Mapping[str, type[Struct]],
    *,
    needed: tuple[str, ...] = (),
    beside: tuple[str, ...] = (),
    zero: bool = True,
) -> Description:
    """The description in a file, or in a folder under its `name`, with every mistake in it.

    Parameters
    ----------
    head, sections : which keys stand before the first section, and in each. needed : sections that
        must be there. beside : others that the caller reads itself.
    zero : whether a standard deviation may be 0.
    """
    given = Path(path)
    file = given / name if given.is_dir() else given
    needed_file = f"{name}, which describes the recordings beside it in TOML,"
    if given.is_dir() and not file.is_file():
        held = [f"{one}, for agonic fit {kind}" for one, kind in _KINDS if (given / one).is_file()]
        but = f"; it holds {held[0]}" if held else ""
        raise LogError(f"the folder does not hold {needed_file.rstrip(',')}{but}", path=given)
    table, known = read_toml(file, needed_file), (*sections, *beside)
    mistakes: list[str] = []
    plain = {key: value for key, value in table.items() if key not in known}
    made = read_section(plain, head, "the file", mistakes, known)
    parts = {
        key: read_section(table.get(key), kind, f"[{key}]", mistakes)
        for key, kind in sections.items()
    }
    mistakes += [f"there is no section [{key}]" for key in needed if key not in table]
    mistakes += _missing_files(parts, file.parent) + _bad_sds(parts, zero)
    return Description(file=file, table=table, head=made, parts=parts, mistakes=mistakes)


def _missing_files(parts: Mapping[str, Any], home: Path) -> list[str]:
    """Tables that sections name and that are not there."""
    return [
        f"[{name}]: there is no file {part.file} in {home}"
        for name, part in parts.items()
        if part is not None and hasattr(part, "file") and not (home / part.file).is_file()
    ]


def _bad_sds(parts: Mapping[str, Any], zero: bool) -> list[str]:
    """Standard deviations and noises that are below 0, or that are 0 and must not be."""
    wanted = "must not be below 0" if zero else "must be above 0, or left out"
    return [
        f"[{name}] {key} is {value:g}; it {wanted}"
        for name, part in parts.items()
        for key in (() if part is None else part.__struct_fields__)
        if "_sd" in key or key.startswith(("sd_", "noise"))
        if isinstance(value := getattr(part, key), float | int)
        if not (value >= 0 if zero else value > 0)
    ]
