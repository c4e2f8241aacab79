"""Calibrations that other programs made: a vector, a matrix, and how they are meant.

ArduPilot's and PX4's parameters and MotionCal's packet say it themselves. Others give two numbers
b and A: Magneto's text, MATLAB's `magcal` (A, b), a vendor's JSON, arrays in source code. Which of
the ways to use them is meant, and in which unit, a log tells: every way is tried on its readings
(`CONVENTIONS`), and the one that leaves the magnitude steadiest is taken.

Sources: AP_Compass_Backend.cpp; PX4 Magnetometer.hpp; MotionCal rawdata.c; S. Balabay, Magneto 1.2;
MathWorks, magcal: m = (x − b) A.
"""

from __future__ import annotations

import hashlib
import json
import re
import struct
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.errors import LogError
from agonic.logs.contents import read_bytes
from agonic.logs.formats import name_content
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.one_pass import find_length, median
from agonic.provenance import Input, Provenance
from agonic.samples import Samples
from agonic.units import NANOTESLA_PER, RAW


def _invert(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


CONVENTIONS: Mapping[str, Callable[[Array, Array], tuple[Array, Array]]] = {
    "A (raw − b)": lambda b, a: (b, a),
    "(raw − b) A": lambda b, a: (b, a.T),
    "A⁻¹ (raw − b)": lambda b, a: (b, _invert(a)),
    "(raw − b) A⁻¹": lambda b, a: (b, _invert(a).T),
    "A (raw + b)": lambda b, a: (-b, a),
    "(raw + b) A": lambda b, a: (-b, a.T),
    "A raw − b": lambda b, a: (_invert(a) @ b, a),
    "A raw + b": lambda b, a: (-_invert(a) @ b, a),
    "raw A + b": lambda b, a: (-_invert(a.T) @ b, a.T),
}
"""Ways to use a vector b and a matrix A, as bias and matrix of field = matrix @ (raw − bias)."""
MOTIONCAL = b"\x75\x54"
LARGEST_FILE = 1_000_000
"""Bytes: what holds twelve numbers is small."""
ALIKE = 1.02
"""Spreads of two ways that differ by less are of the same calibration."""
LARGEST_CONDITION = 20.0
"""Of a matrix: no soft iron stretches one axis so much more than another."""
MOST_NUMBERS = 60
"""In a text: more are a table of readings."""
HELPS, STEADY = 0.5, 0.03
"""Of the spread as recorded, what a calibration of this sensor leaves at most; or so much of the
field."""
WORSE = 1.5
"""Another way leaves so much more, or the log does not tell which is meant."""
_NUMBER = re.compile(r"(?<![\w.\[^−-])[-+−]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w\]])")


class Foreign(NamedTuple):
    """A vector and a matrix that were read, what they are, their unit and convention, if known."""

    what: str
    vector: Array
    matrix: Array
    unit: str | None = None
    convention: str | None = None


class Understood(NamedTuple):
    """A foreign calibration as one of agonic, how it was read, and what is left of the spread of
    the magnitude by it, and by the next way to read it."""

    calibration: Affine
    how: str
    spread: float
    next_spread: float


def is_foreign(path: Path) -> bool:
    """Whether a file is none of agonic's own, which say so at their beginning; setups are TOML."""
    return path.suffix.lower() != ".toml" and b"agonic" not in read_bytes(path)[:400]


def read_foreign(path: Path) -> list[Foreign]:
    """Every calibration that a file of another program holds.

    Raises `LogError` where it holds no vector of three numbers and no matrix of nine.
    """
    data = read_bytes(path)
    for read in (_read_packet, _read_matlab, _read_json, _read_parameters, _read_text):
        if len(data) < LARGEST_FILE and (found := read(data)):
            return found
    raise LogError(
        f"this is {name_content(data)}, and a calibration file is needed: the JSON that agonic "
        "calibrate LOG writes into LOG-agonic, or of another program parameters of ArduPilot or "
        "PX4, a MotionCal packet, or a vector of 3 and a matrix of 3 × 3 numbers (text, JSON, "
        ".mat)",
        path=path,
    )


def understand(path: Path, samples: Samples) -> Understood:
    """The calibration of a file of another program, read as these samples show it is meant.

    Raises `LogError` where no way of reading it makes the magnitude steadier than it is.
    """
    tried = sorted(_try_all(read_foreign(path), samples), key=lambda one: one[0])
    spread, affine, how = tried[0]
    before = _find_spread(samples.field)
    if not spread < max(HELPS * before, STEADY):
        raise LogError(
            f"in no way that was tried does this calibration fit {samples.name}: the magnitude "
            f"varies by {100 * spread:.1f} %, as recorded by {100 * before:.1f} %; check that it "
            "is of this sensor, and the unit of the log",
            path=path,
        )
    others = [s for s, other, _ in tried[1:] if not _is_same(affine, other)]
    left = f"the magnitude varies by {100 * spread:.2g} % with it, by {100 * before:.2g} % without"
    nearest = min(others, default=float("inf"))
    if nearest < WORSE * spread:
        left += f"; another way to read it leaves {100 * nearest:.2g} %: the log hardly tells which"
    made = _make_provenance(path, read_bytes(path), f"{how}; {left}")
    found = Affine(
        bias=affine[0],
        matrix=affine[1],
        unit_in=samples.unit,
        unit_out=samples.unit,
        gauge="free",
        sensor=samples.name,
        frame_in=samples.frame,
        frame_out=samples.frame,
        provenance=made,
    )
    return Understood(found, how, spread, nearest)


def read_plain(path: Path) -> Affine:
    """The one calibration of a file whose form says how it is meant.

    Raises `LogError` where it holds several, or only a log can tell.
    """
    read = read_foreign(path)
    one = read[0]
    if len(read) > 1 or one.unit is None or one.convention is None:
        raise LogError(
            f"{len(read)} calibrations are in it, or it does not say how its numbers are meant: "
            "find that on a log, agonic verify FILE LOG -o mag.json, and give mag.json",
            path=path,
        )
    bias, matrix = CONVENTIONS[one.convention](one.vector, one.matrix)
    data = read_bytes(path)
    return Affine(
        bias=NANOTESLA_PER[one.unit] * bias,
        matrix=matrix,
        gauge="free",
        provenance=_make_provenance(path, data, one.what),
    )


def _make_provenance(path: Path, data: bytes, how: str) -> Provenance:
    return Provenance(
        inputs=(Input(name=path.name, sha256=hashlib.sha256(data).hexdigest(), count=1),),
        settings={"fit": "another program", "reference": "none: as it was given", "read_as": how},
    )


def _try_all(
    read: list[Foreign], samples: Samples
) -> Iterator[tuple[float, tuple[Array, Array], str]]:
    """The spread that each way to read each calibration leaves, it, and the way in words."""
    for one in read:
        units = [one.unit] if one.unit else list(NANOTESLA_PER) if samples.unit != RAW else [RAW]
        for unit in units:
            factor = 1.0 if samples.unit == RAW or unit == RAW else NANOTESLA_PER[unit]
            for name in [one.convention] if one.convention else CONVENTIONS:
                try:
                    bias, matrix = CONVENTIONS[name](one.vector, one.matrix)
                except np.linalg.LinAlgError:
                    continue
                affine = factor * bias, matrix
                field = (samples.field - affine[0]) @ matrix.T
                in_unit = "" if unit == RAW else f", b in {unit}"
                yield _find_spread(field), affine, f"{one.what}: field = {name}{in_unit}"


def _find_spread(field: Array) -> float:
    """The robust spread of the lengths of vectors (n, 3) over how far they move: a bias far beyond
    all readings would leave little of it over the length itself."""
    length = find_length(field)
    moved = float(np.sqrt(np.mean(np.sum((field - field.mean(axis=0)) ** 2, axis=1))))
    return float(MAD_TO_SD * median(np.abs(length - median(length))) / max(moved, 1e-300))


def _is_same(one: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    size = float(np.abs(one[1]).max())
    near = np.abs(one[1] - other[1]).max() < (ALIKE - 1) * size
    reach = max(float(np.abs(one[0]).max()), 1e-300)
    return bool(near and np.abs(one[0] - other[0]).max() < (ALIKE - 1) * reach)


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
    return [
        Foreign(f"{b or 'vector'} and {a or 'matrix'}", vector, matrix)
        for b, vector in vectors
        for a, matrix in matrices
        if not np.array_equal(np.diag(matrix), vector)
        and np.linalg.cond(matrix) < LARGEST_CONDITION
    ]


def _read_parameters(data: bytes) -> list[Foreign]:
    """ArduPilot's COMPASS_* and PX4's CAL_MAGn_*, of every compass that is calibrated."""
    named: dict[str, float] = {}
    for line in data.decode(errors="replace").splitlines():
        words = re.split(r"[\s,=]+", line.strip())
        for at, word in enumerate(words[:-1]):
            if re.fullmatch(r"(COMPASS|CAL_MAG\d)_\w+", word):
                try:
                    named[word] = float(words[at + 1])
                except ValueError:
                    continue
    found = []
    for number in ("", "2", "3"):
        names = [f"COMPASS_{k}{number}_{axis}" for k in ("OFS", "DIA", "ODI") for axis in "XYZ"]
        offset, six = np.split(np.array([named.get(name, 0.0) for name in names]), [3])
        if not offset.any():
            continue
        scale = named.get(f"COMPASS_SCALE{number}", 0.0)
        scale = scale if 1 / 1.5 <= scale <= 1.5 else 1.0
        matrix = scale * unpack_symmetric(six if six[:3].any() else np.r_[1.0, 1, 1, six[3:]])
        what = f"ArduPilot, compass {number or 1}"
        found.append(Foreign(what, offset, matrix, "mG", "A (raw + b)"))
    for slot in range(4):
        names = [f"CAL_MAG{slot}_{a}{k}" for k in ("OFF", "SCALE", "ODIAG") for a in "XYZ"]
        offset, six = np.split(np.array([named.get(name, 0.0) for name in names]), [3])
        if offset.any():
            matrix = unpack_symmetric(six if six[:3].any() else np.r_[1.0, 1, 1, six[3:]])
            found.append(Foreign(f"PX4, CAL_MAG{slot}", offset, matrix, "G", "A (raw − b)"))
    return found


def _read_text(data: bytes) -> list[Foreign]:
    """Three numbers in a line or below each other, and nine: Magneto's text, arrays in code."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return []
    rows = [
        [float(n.replace("−", "-")) for n in _NUMBER.findall(line)] for line in text.splitlines()
    ]
    rows = [row for row in rows if row]
    arrays: list[tuple[str, Array]] = []
    at = 0
    while at < len(rows):
        following = rows[at : at + 3]
        if len(following) == 3 and all(len(row) == 3 for row in following):
            square = np.array(following)
            if len(rows) > at + 3 and len(rows[at + 3]) == 3 and not _leads(square):
                arrays.append(("", square[0]))
                at += 1
                continue
            arrays.append(("", square))
            at += 3
        elif len(following) == 3 and all(len(row) == 1 for row in following):
            arrays.append(("", np.array(following)[:, 0]))
            at += 3
        else:
            row = np.array(rows[at])
            arrays += [("", part) for part in _split_row(row)]
            at += 1
    return _pair(arrays)


def _leads(square: Array) -> bool:
    """Whether a matrix is near a multiple of the identity, as calibrations are."""
    off = np.abs(square - np.diag(np.diag(square))).max()
    return bool(off < np.abs(np.diag(square)).min())


def _split_row(row: Array) -> list[Array]:
    """A line of 3, 9 or 12 numbers as vector and matrix."""
    if row.size == 12:
        return [row[:3], row[3:].reshape(3, 3)]
    if row.size == 9:
        return [row.reshape(3, 3)]
    return [row] if row.size == 3 else []
