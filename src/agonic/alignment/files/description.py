"""Descriptions of sessions in TOML: read and written by one table of their keys.

A key has the type of its value, what it is where it is left out, and the attribute of the session
that holds it, so that reading and writing are each one loop over the table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from msgspec import NODEFAULT, Struct, defstruct

from agonic.alignment.session.session import Mounting, Pier, Recorded, Site
from agonic.atomic import write_atomically
from agonic.errors import LogError
from agonic.files.toml_sections import read_section, read_toml, try_to_make, write_value
from agonic.logs.read import open_log
from agonic.maths.earth.starlight import Air
from agonic.provenance import Input, hash_file
from agonic.samples import Samples


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


@dataclass(frozen=True)
class Description:
    """A description as it was read: what stands before its sections, and each section. `parts` are
    None where a section is missing or wrong; every mistake is in `mistakes`, to which further
    checks add theirs before `require`. `given` are attributes of the session by name. `sources` are
    the tables that were read."""

    file: Path
    head: Any
    parts: Mapping[str, Any]
    repeated: Mapping[str, list[Any]]
    given: Mapping[str, Any]
    mistakes: list[str]
    sources: list[Input] = field(default_factory=list)

    def require(self) -> None:
        """Raise a `LogError` that names every mistake, if there is one."""
        if self.mistakes or self.head is None:
            raise LogError("; ".join(self.mistakes), path=self.file)

    def find(self, name: str) -> Path:
        """A file beside the description."""
        return self.file.parent / name

    def read_samples(self, section: str) -> Samples | None:
        """The readings of a magnetometer, whatever the kind of its file; the reference's in north,
        east, down. None without the section."""
        part = self.parts[section]
        if part is None:
            return None
        path = self.find(part.file)
        log = open_log(path, unit=part.unit)
        if len(log.sensors) > 1:
            names = ", ".join(sensor.name for sensor in log.sensors)
            raise LogError(f"holds {names}; a session needs a file for each", path=path)
        samples = log.sensors[0]
        self.add_source(part.file, len(samples))
        made = replace(samples, name=part.name, rejected={})
        if section != "reference":
            return made
        return made.with_columns(field=made.field @ AXES[part.axes].T)

    def add_source(self, name: str, count: int) -> None:
        """Note a table as read."""
        self.sources.append(Input(name=name, sha256=hash_file(self.find(name)), count=count))


def read_description(path: Path | str, name: str) -> Description:
    """The description in a file, or in a folder under its `name`, with every mistake in it."""
    given, kind = Path(path), KINDS[name]
    file = given / name if given.is_dir() else given
    needed_file = f"{name}, which describes the recordings beside it in TOML,"
    if given.is_dir() and not file.is_file():
        held = [
            f"{one}, for agonic fit {k.fit}" for one, k in KINDS.items() if (given / one).is_file()
        ]
        but = f"; it holds {held[0]}" if held else ""
        raise LogError(f"the folder does not hold {needed_file.rstrip(',')}{but}", path=given)
    table, known = read_toml(file, f"{needed_file} is needed"), (*kind.sections, *kind.repeated)
    mistakes: list[str] = []
    plain = {key: value for key, value in table.items() if key not in known}
    head = read_section(plain, _structure(kind.find_keys("")), "the file", mistakes, known)
    parts = {
        one: read_section(table.get(one), _structure(SECTIONS[one]), f"[{one}]", mistakes)
        for one in kind.sections
    }
    repeated: dict[str, list[Any]] = {one: [] for one in kind.repeated}
    for one, several in repeated.items():
        stated, keys = table.get(one, []), _structure(SECTIONS[f"[{one}]"])
        if not isinstance(stated, list):
            mistakes.append(f"{one}s are written [[{one}]], once for each")
            continue
        for number, each in enumerate(stated, start=1):
            part = read_section(each, keys, f"[[{one}]] {number}", mistakes)
            several += [] if part is None else [part]
    mistakes += [f"there is no section [{key}]" for key in kind.needed if key not in table]
    mistakes += [
        f"[{one}]: there is no file {part.file} in {file.parent}"
        for one, part in parts.items()
        if hasattr(part, "file") and not (file.parent / part.file).is_file()
    ]
    mistakes += _list_wrong_errors(kind, parts)
    given_parts = _list_given(kind, head, parts, mistakes)
    return Description(file, head, parts, repeated, given_parts, mistakes)


def _list_wrong_errors(kind: Kind, parts: Mapping[str, Any]) -> Iterator[str]:
    """Standard deviations that cannot be."""
    wanted = "must not be below 0" if kind.zero else "must be above 0, or left out"
    for one, part in parts.items():
        for key in () if part is None else part.__struct_fields__:
            value = getattr(part, key)
            error = "_sd" in key or key.startswith(("sd_", "noise"))
            numeric = isinstance(value, float | int)
            if error and numeric and not (value >= 0 if kind.zero else value > 0):
                yield f"[{one}] {key} is {value:g}; it {wanted}"


def _structure(keys: Keys) -> type[Struct]:
    """The keys of a section as a struct, which checks their types."""
    fields = [(name, key.kind, key.default) for name, key in keys.items()]
    return defstruct("Section", fields, kw_only=True)


def _list_given(
    kind: Kind, head: Any, parts: Mapping[str, Any], mistakes: list[str]
) -> dict[str, Any]:
    """Attributes of the session that a description gives; what they make together is made."""
    made: dict[str, Any] = {}
    for section, part in {"": head, **parts}.items():
        if part is None:
            continue
        nested: dict[str, Any] = {}
        for name, key in kind.find_keys(section).items():
            if key.holds:
                *within, last = key.holds.split(".")
                at = nested
                for one in within:
                    at = at.setdefault(one, {})
                value = getattr(part, name)
                at[last] = np.array(value) if isinstance(value, tuple) else value
        made |= try_to_make(partial(_make, nested), f"[{section}]", mistakes) or {}
    return made


def _make(nested: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes with their own attributes as the nouns they are, where there is one."""
    made = {}
    for name, value in nested.items():
        inside = _make(value) if isinstance(value, dict) else value
        made[name] = NOUNS[name](**inside) if name in NOUNS else inside
    return made


def write_description(
    session: Recorded, home: Path, name: str, beside: Mapping[str, Mapping[str, Any] | None]
) -> Path:
    """Write what a session holds under the keys of its kind, and return the path. `beside` has keys
    that no attribute holds, by section; a section that has a file is written only where it is among
    them. What is None is left out."""
    kind, lines = KINDS[name], []
    for section in ("", *kind.sections):
        keys, others = kind.find_keys(section), beside.get(section)
        if "file" in keys and others is None:
            continue
        held = {key: _find(session, how.holds) for key, how in keys.items() if how.holds}
        lines += _write_section(section, {**(others or {}), **held})
    for section in kind.repeated:
        for one in beside.get(section) or ():
            lines += _write_section(f"[{section}]", one)  # type: ignore[arg-type]
    return write_atomically(home / name, "\n".join(lines) + "\n")


def _find(session: object, path: str) -> Any:
    """What a session holds; None where the way there ends."""
    for name in path.split("."):
        session = getattr(session, name, None)
    return session


def _write_section(name: str, values: Mapping[str, Any]) -> list[str]:
    """A section as lines; none where nothing stands in it."""
    plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}
    keys = [f"{k} = {write_value(v)}" for k, v in plain.items() if v is not None]
    return ["", f"[{name}]", *keys] if keys and name else keys
