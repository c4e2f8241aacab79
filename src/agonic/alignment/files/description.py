"""Descriptions of sessions in TOML: read and written by the table of their keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct, defstruct

from agonic.alignment.files.keys import AXES, KINDS, NOUNS, SECTIONS, Keys, Kind
from agonic.alignment.session.session import Recorded
from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.calibration.steps import require_calibration
from agonic.errors import LogError
from agonic.files.calibration import load
from agonic.files.toml_sections import read_section, read_toml, try_to_make, write_value
from agonic.logs.read import open_log
from agonic.provenance import Input, hash_file
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True)
class Description:
    """A description as it was read: what stands before its sections, and each section.

    `parts` are None where a section is missing or wrong; every mistake is in `mistakes`, to which
    further checks add theirs before `require`. `given` are attributes of the session by name.
    `sources` are the tables that were read.
    """

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

    def load_calibration(self) -> Calibration | None:
        """The calibration of the magnetometer, where one is named."""
        part = self.parts["magnetometer"]
        if part is None or not part.calibration:
            return None
        return require_calibration(load(self.find(part.calibration)))

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
        section: read_section(
            table.get(section), _structure(SECTIONS[section]), f"[{section}]", mistakes
        )
        for section in kind.sections
    }
    repeated = {one: list(_read_repeated(table, one, mistakes)) for one in kind.repeated}
    mistakes += [f"there is no section [{key}]" for key in kind.needed if key not in table]
    mistakes += [
        f"[{one}]: there is no file {part.file} in {file.parent}"
        for one, part in parts.items()
        if hasattr(part, "file") and not (file.parent / part.file).is_file()
    ]
    mistakes += _list_bad_sds(parts, kind.zero)
    return Description(
        file=file,
        head=head,
        parts=parts,
        repeated=repeated,
        given=_list_given(kind, head, parts, mistakes),
        mistakes=mistakes,
    )


def _structure(keys: Keys) -> type[Struct]:
    """The keys of a section as a struct, which checks their types."""
    fields = [(name, key.kind, key.default) for name, key in keys.items()]
    return defstruct("Section", fields, kw_only=True)


def _read_repeated(table: Mapping[str, Any], name: str, mistakes: list[str]) -> Iterator[Any]:
    """The sections of a name that may stand several times."""
    stated, kind = table.get(name, []), _structure(SECTIONS[f"[{name}]"])
    if not isinstance(stated, list):
        mistakes.append(f"{name}s are written [[{name}]], once for each")
        return
    for number, each in enumerate(stated, start=1):
        if (part := read_section(each, kind, f"[[{name}]] {number}", mistakes)) is not None:
            yield part


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


def _list_bad_sds(parts: Mapping[str, Any], zero: bool) -> Iterator[str]:
    """Standard deviations and noises that are below 0, or that are 0 and must not be."""
    wanted = "must not be below 0" if zero else "must be above 0, or left out"
    for name, part in parts.items():
        for key in () if part is None else part.__struct_fields__:
            value = getattr(part, key)
            error = "_sd" in key or key.startswith(("sd_", "noise"))
            if error and isinstance(value, float | int) and not (value >= 0 if zero else value > 0):
                yield f"[{name}] {key} is {value:g}; it {wanted}"


def write_description(
    session: Recorded, home: Path, name: str, beside: Mapping[str, Mapping[str, Any] | None]
) -> Path:
    """Write what a session holds under the keys of its kind, and return the path.

    `beside` has keys that no attribute holds, by section; a section that has a file is written only
    where it is among them. What is None is left out.
    """
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
