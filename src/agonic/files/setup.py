"""The setup file: TOML that names the calibrations of a vehicle's compasses, and the rest.

[[compass]]
calibration = "MAG1.json"       # beside this file
deviation = "MAG1-card.json"    # may be left out, as all below
sensor = "MAG1"                 # its name in the log, where the calibration has another
latency_s = 0.014               # else what the calibration says
latency_sd_s = 0.001            # else what the calibration says of its own

[tilt]
source = "log"                  # auto, log, accelerometer, gyro or level
accelerometer = "acc.json"      # its calibration, by `agonic fit pair`
order = "roll-pitch"            # or pitch-roll
sd_deg = 0.5
settling_s = 10.0               # of the gyro filter

[declination]
degrees = 2.7                   # east positive, or "model"
sd_deg = 0.4

[field]                         # to expect; else from the world model
horizontal_nT = 19100
vertical_nT = 45600

[limits]                        # beyond which a heading is flagged
magnitude = 0.1
dip_deg = 10
tilt_deg = 80
disagreement_deg = 10           # of two compasses
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_type_hints

from msgspec import Struct, defstruct

from agonic.atomic import sign_text, write_atomically
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.deviation import Deviation
from agonic.calibration.setup import Compass, Setup
from agonic.calibration.setup import find_mistakes as out_of_range
from agonic.errors import LogError
from agonic.files.calibration import load, save
from agonic.files.names import file_stem
from agonic.files.toml_sections import read_section, read_toml, try_to_make, write_value
from agonic.logs.contents import read_bytes
from agonic.units import ACCELERATION


class CompassSection(Struct):
    """One [[compass]]."""

    calibration: str
    deviation: str | None = None
    sensor: str | None = None
    latency_s: float | None = None
    latency_sd_s: float | None = None


SECTIONS: Mapping[str, Mapping[str, str]] = {
    "tilt": {
        "source": "tilt",
        "order": "tilt_order",
        "sd_deg": "tilt_sd_deg",
        "settling_s": "settling_s",
        "accelerometer": "accelerometer",
    },
    "declination": {"degrees": "declination_deg", "sd_deg": "declination_sd_deg"},
    "field": {"horizontal_nT": "horizontal", "vertical_nT": "vertical"},
    "limits": {
        "magnitude": "magnitude_limit",
        "dip_deg": "dip_limit_deg",
        "tilt_deg": "tilt_limit_deg",
        "disagreement_deg": "disagreement_limit_deg",
    },
}
"""The keys of each section, and the attributes of a `Setup` that they stand for."""


def _make_section(name: str) -> type[Struct]:
    """The structure of a section's keys; only [field] needs all of its keys."""
    hints = get_type_hints(Setup)
    hints |= {"accelerometer": str | None, "declination_deg": float | Literal["model"]}
    keys = [(key, hints[attribute]) for key, attribute in SECTIONS[name].items()]
    return defstruct(name, keys if name == "field" else [(*key, None) for key in keys])


NEEDED = (
    "a setup (TOML) or a calibration file (JSON) is needed: agonic calibrate LOG writes both into "
    "LOG-agonic"
)


def as_setup(given: Path | str | Calibration) -> Setup:
    """The setup of a file, or that of one compass with a calibration."""
    if isinstance(given, Path | str):
        return load_setup(given)
    return Setup(compasses=(Compass(calibration=given),))


def load_setup(path: Path | str) -> Setup:
    """Read a setup file; a calibration file alone is the setup of one compass.

    Parameters: `path` of the file; paths in it are relative to it. Raises `LogError` that names
    every mistake at once.

    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from agonic.calibration.affine import Affine
    >>> with TemporaryDirectory() as folder:
    ...     _ = save(Affine(bias=[1, 2, 3], matrix=np.eye(3)), folder + "/mag.json")
    ...     text = '[[compass]]\\ncalibration = "mag.json"\\n[declination]\\ndegrees = 2.7\\n'
    ...     _ = Path(folder, "setup.toml").write_text(text)
    ...     load_setup(folder + "/setup.toml").declination_deg
    2.7
    """
    file = Path(path)
    data = read_bytes(file)
    if data.lstrip().startswith(b"{"):
        return as_setup(_calibration(file))
    mistakes: list[str] = []
    setup = _setup(read_toml(file, NEEDED), file.parent, mistakes)
    if setup is None or mistakes:
        raise LogError("; ".join(mistakes), path=file)
    return setup


def _setup(table: Mapping[str, Any], folder: Path, mistakes: list[str]) -> Setup | None:
    """The setup, or `None` with what is wrong added to `mistakes`."""
    unknown = [name for name in table if name not in (*SECTIONS, "compass")]
    if unknown:
        known = ", ".join(f"[{name}]" for name in SECTIONS)
        mistakes.append(f"{', '.join(unknown)}: not part of a setup; it has [[compass]], {known}")
    sections = {
        name: read_section(table.get(name), _make_section(name), f"[{name}]", mistakes)
        for name in SECTIONS
    }
    listed = table.get("compass", [])
    if not isinstance(listed, list) or not listed:
        mistakes.append("it needs at least one [[compass]] with its calibration")
        listed = []
    compasses = [
        _compass(one, folder, f"[[compass]] {k}", mistakes) for k, one in enumerate(listed, start=1)
    ]
    given = {
        attribute: getattr(sections[section], key)
        for section, keys in SECTIONS.items()
        for key, attribute in keys.items()
        if key in (table.get(section) or {}) and sections[section] is not None
    }
    if "accelerometer" in given:
        read = partial(_accelerometer, folder / given["accelerometer"])
        given["accelerometer"] = try_to_make(read, "[tilt]", mistakes)
    if given.get("declination_deg") == "model":
        given["declination_deg"] = None
    if mistakes:
        mistakes += out_of_range({k: v for k, v in given.items() if k != "accelerometer"})
        return None
    found = tuple(filter(None, compasses))
    return try_to_make(partial(Setup, compasses=found, **given), "the file", mistakes)


def _compass(table: Any, folder: Path, where: str, mistakes: list[str]) -> Compass | None:
    """One compass, or `None` with what is wrong added to `mistakes`."""
    before = len(mistakes)
    said = read_section(table, CompassSection, where, mistakes)
    if said is None:
        return None
    parts: dict[str, Any] = {}
    for key, read in (("calibration", _calibration), ("deviation", _card)):
        if getattr(said, key) is not None:
            file = folder / getattr(said, key)
            parts[key] = try_to_make(partial(read, file), where, mistakes)
    if len(mistakes) > before:
        return None
    if said.sensor not in (None, parts["calibration"].sensor):
        parts["calibration"] = _rename(parts["calibration"], said.sensor)
    for key in ("latency_s", "latency_sd_s"):
        if getattr(said, key) is not None:
            parts[key] = getattr(said, key)
    return try_to_make(partial(Compass, **parts), where, mistakes)


def _calibration(path: Path) -> Calibration:
    found = load(path)
    if isinstance(found, Deviation):
        raise LogError(
            "a deviation card stands where a calibration is needed: name it in a setup beside the "
            'calibration of its compass (deviation = "card.json"), and give that setup',
            path=path,
        )
    return found


def _accelerometer(path: Path) -> Affine:
    found: object = load(path)
    if not isinstance(found, Affine) or found.unit_out != ACCELERATION:
        raise LogError("it is not a calibration of an accelerometer", path=path)
    return found


def _card(path: Path) -> Deviation:
    found: object = load(path)
    if not isinstance(found, Deviation):
        raise LogError("a calibration stands where a deviation card is needed", path=path)
    return found


def _rename(calibration: Any, sensor: str) -> Calibration:
    """The same calibration for the sensor of another name."""
    if isinstance(calibration, Chain):
        first, *rest = calibration.steps
        return replace(calibration, steps=(replace(first, sensor=sensor), *rest))
    renamed: Calibration = replace(calibration, sensor=sensor)
    return renamed


def save_setup(setup: Setup, path: Path | str, *, saved: Mapping[str, str] | None = None) -> Path:
    """Write a setup as TOML, and its calibrations and deviation cards as JSON beside it.

    They are named after the file and the sensor: `boat.toml`, `boat-MAG1.json`,
    `boat-MAG1-deviation.json`, `boat-accelerometer.json`; calibrations in `saved` (file name
    by sensor) lie beside it already. Returns the path of the TOML file.

    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[1, 2, 3], matrix=np.eye(3), sensor="MAG1")
    >>> with TemporaryDirectory() as folder:
    ...     path = save_setup(Setup(compasses=(Compass(calibration=mag),)), folder + "/boat.toml")
    ...     sorted(file.name for file in Path(folder).iterdir()), load_setup(path).tilt
    (['boat-MAG1.json', 'boat.toml'], 'auto')
    """
    file = Path(path)
    lines: list[str] = []
    for compass in setup.compasses:
        stem = file_stem(compass.sensor)
        beside: dict[str, Any] = {
            "calibration": compass.calibration,
            "deviation": compass.deviation,
        }
        lines.append("[[compass]]")
        for key, part in beside.items():
            if part is not None:
                name = f"{file.stem}-{stem}{'' if key == 'calibration' else '-deviation'}.json"
                if key == "calibration" and saved and compass.sensor in saved:
                    name = saved[compass.sensor]
                else:
                    save(part, file.with_name(name))
                lines.append(f"{key} = {write_value(name)}")
        if compass.latency_s or getattr(compass.calibration, "latency_s", 0.0):
            lines.append(f"latency_s = {compass.latency_s!r}")
        if compass.latency_sd_s not in (None, getattr(compass.calibration, "latency_sd_s", None)):
            lines.append(f"latency_sd_s = {compass.latency_sd_s!r}")
        lines.append("")
    values: dict[str, Any] = vars(setup)
    if setup.accelerometer is not None:
        felt = save(setup.accelerometer, file.with_name(f"{file.stem}-accelerometer.json"))
        values = values | {"accelerometer": felt.name}
    for section, keys in SECTIONS.items():
        said = {key: values[attribute] for key, attribute in keys.items()}
        rows = [
            f"{key} = {write_value(value) if isinstance(value, str) else repr(float(value))}"
            for key, value in said.items()
            if value is not None
        ]
        lines += [f"[{section}]", *rows, ""] if rows else []
    return write_atomically(file, sign_text("\n".join(lines).rstrip() + "\n"))
