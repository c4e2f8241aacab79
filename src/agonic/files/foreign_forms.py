"""Files in which other programs keep a calibration, each read as a vector and a matrix.

ArduPilot's and PX4's parameters and MotionCal's packet say how they are meant. Text, JSON and
arrays hold two numbers b and A, and nothing of how they are used: see `foreign`.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.autopilots import ARDUPILOT, PX4
from agonic.errors import LogError
from agonic.logs.ardupilot.compass import LARGEST_SCALE
from agonic.logs.contents import read_bytes
from agonic.logs.formats import name_content
from agonic.maths.equation.symmetric import unpack_symmetric

MOTIONCAL = b"\x75\x54"
_TOKEN = re.compile(
    r"(?P<number>(?<![\w.^-])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)[fF]?(?!\w)"
    r"|(?P<word>[^\W\d]\w*(?:\[[\d,]*\])*)"
)
"""A number, of C or not, or a word with its indices, which are no numbers."""
_INDEX = re.compile(r"[\W\d_]*[xyzXYZ]{0,2}[\W\d_]*$")


class Foreign(NamedTuple):
    """A vector and a matrix that were read, what they are, and where the file says it their unit,
    convention and the number of the compass, from 1."""

    what: str
    vector: Array
    matrix: Array
    unit: str | None = None
    convention: str | None = None
    number: int | None = None


def is_foreign(path: Path) -> bool:
    """Whether a file is none that agonic reads as its own: JSON that says so at its beginning, or a
    setup, which is TOML. What agonic exported for others is theirs."""
    head = read_bytes(path)[:400].lstrip()
    return path.suffix.lower() != ".toml" and not (head.startswith(b"{") and b"agonic" in head)


def read_foreign(path: Path) -> list[Foreign]:
    """Every calibration that a file of another program holds."""
    data = read_bytes(path)
    for read in (_read_packet, _read_matlab, _read_json, _read_parameters, _read_text):
        if len(data) < 1_000_000 and (found := read(data)):
            return found
    raise LogError(
        f"this is {name_content(data)}, and a calibration file is needed: the JSON that agonic "
        "calibrate LOG writes into LOG-agonic, or of another program parameters of ArduPilot or "
        "PX4, a MotionCal packet, or a vector of 3 and a matrix of 3 × 3 numbers (text, JSON, "
        ".mat)",
        path=path,
    )


def _read_packet(data: bytes) -> list[Foreign]:
    """MotionCal's 68 bytes: V and invW in µT (`exports.motioncal`)."""
    if len(data) != 68 or not data.startswith(MOTIONCAL):
        return []
    values = np.array(struct.unpack("<16f", data[2:66]))
    matrix = unpack_symmetric(values[10:16])
    return [Foreign("MotionCal", values[6:9], matrix, "uT", "A (raw − b)")]


def _read_matlab(data: bytes) -> list[Foreign]:
    if not data.startswith(b"MATLAB 5.0"):
        return []
    from scipy.io import loadmat  # slow to load

    try:
        held = loadmat(BytesIO(data), squeeze_me=True)  # type: ignore[arg-type]
    except (ValueError, TypeError, NotImplementedError, OSError):
        return []
    return _pair(_list_arrays({k: v for k, v in held.items() if not k.startswith("__")}))


def _read_json(data: bytes) -> list[Foreign]:
    try:
        held = json.loads(data)
    except (ValueError, RecursionError):
        return []
    return _pair(_list_arrays(held))


def _list_arrays(held: Any, name: str = "") -> list[tuple[str, Array]]:
    """Every vector and matrix inside, with its name."""
    if isinstance(held, Mapping):
        if {"x", "y", "z"} <= {str(key).lower() for key in held}:
            low = {str(key).lower(): value for key, value in held.items()}
            held = [low[axis] for axis in "xyz"]
        else:
            return [one for key, value in held.items() for one in _list_arrays(value, str(key))]
    try:
        array = np.asarray(held, dtype=np.float64)
    except (TypeError, ValueError):
        within = held if isinstance(held, list) else []
        return [one for value in within for one in _list_arrays(value, name)]
    if array.size not in (3, 9) or not np.isfinite(array).all():
        return []
    return [(name, array.reshape(3) if array.size == 3 else array.reshape(3, 3))]


def _pair(arrays: list[tuple[str, Array]]) -> list[Foreign]:
    """Every vector with every matrix; three scale factors are a diagonal one."""
    vectors = [(name, value) for name, value in arrays if value.ndim == 1]
    matrices = [(name, value) for name, value in arrays if value.ndim == 2]
    if not matrices and len(vectors) > 1:
        matrices = [(name, np.diag(value)) for name, value in vectors]
    if len(vectors) * len(matrices) > 60:  # a table of readings
        return []
    return [
        Foreign(f"{b or 'vector'} and {a or 'matrix'}", vector, matrix)
        for b, vector in vectors
        for a, matrix in matrices
        if not np.array_equal(np.diag(matrix), vector)
        and np.linalg.cond(matrix) < 20.0  # no soft iron stretches an axis more
    ]


def _read_parameters(data: bytes) -> list[Foreign]:
    """ArduPilot's COMPASS_* and PX4's CAL_MAGn_*, of every compass that is calibrated."""
    named: dict[str, float] = {}
    for line in data.decode(errors="replace").splitlines():
        words = re.split(r"[\s,=:]+", re.sub(r"\[[\d,]*\]", "", line).strip())
        for at, word in enumerate(words[:-1]):
            if re.fullmatch(r"(COMPASS|CAL_MAG\d)_\w+", word):
                try:
                    named[word] = float(words[at + 1])
                except ValueError:
                    continue
    found = []
    for pilot, what in ((ARDUPILOT, "ArduPilot, compass {number}"), (PX4, "PX4, CAL_MAG{slot}")):
        for number, slot in enumerate(pilot.slots, start=1):
            offset, diagonal, beside, motor = (
                np.array([named.get(one, 0.0) for one in pilot.names(number, part)])
                for part in pilot.parts
            )
            if not offset.any():
                continue
            scale = named.get(f"COMPASS_SCALE{slot}", 1.0) if pilot is ARDUPILOT else 1.0
            scale = scale if 1 / LARGEST_SCALE <= scale <= LARGEST_SCALE else 1.0
            diagonal = diagonal if diagonal.any() else np.ones(3)
            matrix = scale * unpack_symmetric(np.r_[diagonal, beside])
            left = f" without its {pilot.parts[-1]}" * bool(motor.any())
            read = what.format(slot=slot, number=number) + left
            found.append(Foreign(read, offset, matrix, pilot.unit, pilot.convention, number))
    return found


def _read_text(data: bytes) -> list[Foreign]:
    """Three numbers and nine with no word between them: Magneto's text, arrays in code, YAML; or
    each behind a name that ends with its axis or index."""
    try:
        text = data.decode().replace("−", "-")
    except UnicodeDecodeError:
        return []
    groups: list[tuple[str, list[float]]] = []
    words: list[str] = []
    for token in _TOKEN.finditer(text):
        if token["word"]:
            words.append(token["word"])
            continue
        if words or not groups:
            groups.append((" ".join(words[-3:]), []))
        groups[-1][1].append(float(token["number"]))
        words = []
    arrays = [
        (name, part) for name, group in _join_named(groups) for part in _split(np.array(group))
    ]
    return _pair(arrays)


def _join_named(groups: list[tuple[str, list[float]]]) -> Iterator[tuple[str, list[float]]]:
    """Groups of numbers; those of one, whose names differ by axis or index only, as one."""
    joined: list[float] = []
    before = ""
    for name, group in [*groups, ("", [])]:
        stem = _INDEX.sub("", name.split(" ")[-1])
        if joined and (len(group) != 1 or stem != before):
            yield before, joined
            joined = []
        if len(group) == 1:
            joined, before = [*joined, *group], stem
        else:
            yield name, group


def _split(numbers: Array) -> list[Array]:
    """Of 3, 9 or 12 numbers the vector and the matrix, whichever comes first; of the ten that a
    MotionCal device answers (Cal1) the vector."""
    if numbers.size == 10:
        return [numbers[6:9]]
    if numbers.size == 12:
        first = _leads(numbers[:9].reshape(3, 3)) and not _leads(numbers[3:].reshape(3, 3))
        return [part for half in np.split(numbers, [9 if first else 3]) for part in _split(half)]
    if numbers.size == 9:
        return [numbers.reshape(3, 3)]
    return [numbers] if numbers.size == 3 else []


def _leads(square: Array) -> bool:
    """Whether the diagonal of a matrix is larger than all else in it, as of calibrations."""
    off = np.abs(square - np.diag(np.diag(square))).max()
    return bool(off < np.abs(np.diag(square)).min())
