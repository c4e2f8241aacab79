"""C files as a library for Arduino and PlatformIO, with a sketch that uses them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from agonic.atomic import write_atomically
from agonic.errors import AgonicError
from agonic.exports.firmware.c_text import fill_template
from agonic.version import __version__

URL = "https://github.com/agonic/agonic"
SKETCHES = (
    ("_training.h", "training", "Train"),
    ("_tracker.h", "tracker", "Follow"),
    (".h", "field", "Field"),
)
"""What the name of the first header ends with, the template of its sketch, and its name."""


def write_library(folder: Path, files: Sequence[Path]) -> tuple[Path, ...]:
    """Beside C files in `folder/src`, what makes them a library; all its files."""
    name, template, sketch = _choose_sketch(files)
    numbers = re.match(r"\d+\.\d+\.\d+", __version__)  # all that both take
    headers = [file.name for file in files if file.suffix == ".h"]
    values = {
        "name": name,
        "version": numbers[0] if numbers else "0.0.0",
        "url": URL,
        "includes": ",".join(headers),
        "listed": ",\n".join(f'    "{header}"' for header in headers),
    }
    texts = {
        "library.properties": fill_template("arduino/library.properties.in", values),
        "library.json": fill_template("arduino/library.json.in", values),
        f"examples/{sketch}/{sketch}.ino": _write_sketch(template, name, files),
    }
    added = []
    for file, text in texts.items():
        place = folder / file
        place.parent.mkdir(parents=True, exist_ok=True)
        added.append(write_atomically(place, text))
    return (*files, *added)


def _choose_sketch(files: Sequence[Path]) -> tuple[str, str, str]:
    """With what the C names begin, and the template and the name of the sketch."""
    first = files[0].name
    if len(files) > 3:  # a setup: header, source, self-test, fits
        return first.removesuffix(".h"), "heading", "Heading"
    for ending, template, sketch in SKETCHES:
        if first.endswith(ending):
            if template == "tracker" and "_tracker_field(" in files[0].read_text():
                template = "tracker_with_gyro"
            return first.removesuffix(ending), template, sketch
    raise AgonicError(f"{first} is not a header that can become a library")


def _write_sketch(template: str, name: str, files: Sequence[Path]) -> str:
    values: dict[str, object] = {
        "name": name,
        "followed": f"{name}_follow(" in files[0].read_text(),
    }
    if template == "field":
        header = next(file for file in files if file.name == f"{name}.h").read_text()
        values |= _read_arguments(name, header)
    return fill_template(f"arduino/{template}.ino.in", values)


def _read_arguments(name: str, header: str) -> dict[str, str]:
    """What `_correct` takes between the reading and the field, and how the sketch declares it."""
    found = re.search(
        rf"\b{name}_correct\(const float raw\[3\],(.*?)float field\[3\]\)", header, re.DOTALL
    )
    between = [part.strip() for part in found[1].split(",") if part.strip()] if found else []
    declared, names = [], []
    for part in between:
        kind, _, given = part.rpartition(" ")
        word, bracket, size = given.partition("[")
        names.append(word)
        value = "{0.0f}" if bracket else "0.0f"
        plain = f"{kind.removeprefix('const ')} {word}{bracket}{size}"
        declared.append(f"    const {plain} = {value}; /* put it here, see {name}.h */\n")
    return {"beside": "".join(declared), "arguments": "".join(f"{word}, " for word in names)}
