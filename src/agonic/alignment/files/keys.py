"""The keys of the descriptions of sessions, session.toml, north.toml and coil.toml, in one table.

A key has the type of its value, what it is where it is left out, and the attribute of the session
that holds it, so that reading and writing are each one loop over the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from msgspec import NODEFAULT

from agonic.alignment.session.session import Mounting, Pier, Site
from agonic.maths.earth.starlight import Air


class Key(NamedTuple):
    """A key: its type, its default if it may be left out, and what of the session holds it."""

    kind: Any
    default: Any = NODEFAULT
    holds: str = ""


Keys = Mapping[str, Key]

Effect = Literal["present", "removed"]
Optional = float | None
Vector = tuple[float, float, float]


def _file(name: str, /, **others: Key) -> Keys:
    """A section about a table; what is not said of it is in a file of the section's name."""
    return {"file": Key(str, f"{name}.csv"), **others}


def _readings(name: str, sensor: str, **others: Key) -> Keys:
    """A section about the readings of a magnetometer."""
    return _file(name, name=Key(str, sensor), unit=Key(str | None, None), **others)


SECTIONS: Mapping[str, Keys] = {
    "": {
        "name": Key(str, "", "name"),
        "time_scale": Key(Literal["UTC", "TAI", "GPS", "TT"], "UTC"),
    },
    "site": {
        "latitude_deg": Key(float, holds="site.latitude_deg"),
        "longitude_deg": Key(float, holds="site.longitude_deg"),
        "coordinates": Key(Literal["astronomical", "geodetic"], "astronomical", "site.coordinates"),
        "pressure_hPa": Key(float, 1013.25, "site.air.pressure_hPa"),
        "temperature_C": Key(float, 15.0, "site.air.temperature_C"),
        "humidity": Key(float, 0.5, "site.air.humidity"),
        "wavelength_um": Key(float, 0.6, "site.air.wavelength_um"),
    },
    "star": {
        "refraction": Key(Effect, holds="star.refraction"),
        "aberration": Key(Effect, holds="star.aberration"),
        "file": Key(str, "star.csv"),
        "name": Key(str, "star sensor", "star.name"),
        "turns": Key(Literal["ci", "ic"], "ci"),
        "across_sd_arcsec": Key(Optional, None),
        "about_sd_arcsec": Key(Optional, None),
    },
    "gyro": {
        "constant_arcsec": Key(float, 0.0, "constant_arcsec"),
        "constant_sd_arcsec": Key(float, 0.0, "constant_sd_arcsec"),
        "reading_sd_arcsec": Key(Optional, None, "reading_sd_arcsec"),
        "time_sd_s": Key(Optional, None, "time_sd_s"),
        "transit_constant": Key(Optional, None, "transit_constant"),
        "transit_constant_sd": Key(float, 0.0, "transit_constant_sd"),
    },
    "reversal": _file("reversal"),
    "transit": _file("transit"),
    "swing": _file("swing"),
    "platform": _file(
        "platform",
        circle_sd_arcsec=Key(float, 2.0, "platform.circle_sd_arcsec"),
        level_sd_arcsec=Key(float, 2.0, "platform.level_sd_arcsec"),
        mirror=Key(bool, False, "platform.mirror"),
    ),
    "coil": {
        "name": Key(str, "coil", "coil"),
        "axis": Key(Vector | None, None, "geometric_axis"),
        "frame": Key(Literal["m", "b", "c", "n"], "m", "geometric_frame"),
        "settle_s": Key(float, 0.0, "settle_s"),
        "current_sd": Key(float, 0.0, "current_sd"),
    },
    "magnetometer": _readings(
        "magnetometer",
        "magnetometer",
        noise_nT=Key(Optional, None, "noise"),
        calibration=Key(str, ""),
    ),
    "reference": _readings(
        "reference",
        "reference",
        axes=Key(Literal["NED", "XYZ", "ENU", "NWU"], "NED"),
        noise_nT=Key(Optional, None, "reference_noise"),
        axes_sd_arcsec=Key(Optional, None, "reference_sd_arcsec"),
    ),
    "pier": {
        "difference_nT": Key(Vector, (0.0, 0.0, 0.0), "pier.difference"),
        "sd_nT": Key(Optional, None, "pier.sd"),
    },
    "remanence": _readings("remanence", "magnetometer"),
    "mounting": {
        "alpha_deg": Key(float, holds="mounting.alpha_deg"),
        "beta_deg": Key(float, holds="mounting.beta_deg"),
        "gamma_deg": Key(float, holds="mounting.gamma_deg"),
        "sd_deg": Key(float, 2.0, "mounting.sd_deg"),
    },
    "alignment": {"file": Key(str)},
    "attitude": {
        **dict.fromkeys(("roll_deg", "pitch_deg", "heading_deg"), Key(Optional, None)),
        **dict.fromkeys(("level_sd_arcsec", "heading_sd_arcsec"), Key(float, 0.0)),
        **dict.fromkeys(("ra_deg", "dec_deg", "rot_deg"), Key(Optional, None)),
        "utc": Key(str | None, None),
        **dict.fromkeys(("across_sd_arcsec", "about_sd_arcsec"), Key(float, 0.0)),
    },
    "[sighting]": {
        "name": Key(str),
        "readings_deg": Key(list[float] | None, None),
        "readings_gon": Key(list[float] | None, None),
        "mirror": Key(bool, False),
    },
}
"""The keys of all sections; `docs/jobs` shows descriptions that have them."""


class Kind(NamedTuple):
    """A kind of session: its fit, its sections, the keys before the first of them, sections that
    must be there and that may stand several times, and whether a standard deviation may be 0."""

    fit: str
    sections: tuple[str, ...]
    head: tuple[str, ...] = ("name",)
    needed: tuple[str, ...] = ()
    repeated: tuple[str, ...] = ()
    zero: bool = True

    def find_keys(self, section: str) -> Keys:
        """The keys of a section; of "" those before the first."""
        keys = SECTIONS[section]
        return keys if section else {name: keys[name] for name in self.head}


KINDS: Mapping[str, Kind] = {
    "session.toml": Kind(
        "alignment",
        ("site", "star", "magnetometer", "reference", "pier", "remanence", "mounting"),
        head=("name", "time_scale"),
        needed=("site", "star", "magnetometer", "reference"),
        zero=False,
    ),
    "north.toml": Kind(
        "north",
        ("gyro", "reversal", "transit", "swing", "platform", "magnetometer", "reference", "pier"),
        repeated=("sighting",),
    ),
    "coil.toml": Kind(
        "coil",
        ("coil", "magnetometer", "reference", "alignment", "attitude", "site"),
        needed=("magnetometer",),
    ),
}
"""Descriptions by the name of their file."""
NOUNS = {"site": Site, "air": Air, "pier": Pier, "mounting": Mounting}
"""What the keys of a section make together."""
AXES = {
    "NED": np.eye(3),
    "XYZ": np.eye(3),
    "ENU": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "NWU": np.diag([1.0, -1.0, -1.0]),
}
"""From the axes of the reference to north, east, down."""
