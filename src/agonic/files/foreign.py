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
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.errors import LogError
from agonic.files.foreign_forms import Foreign, read_foreign
from agonic.logs.contents import read_bytes
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.one_pass import find_length, median
from agonic.provenance import Input, Provenance
from agonic.samples import Samples
from agonic.units import NANOTESLA_PER, RAW

Convention = Callable[[Array, Array], tuple[Array, Array]]


def _invert(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


_SHAPES: tuple[tuple[str, str, Callable[[Array], Array]], ...] = (
    ("A ", "", lambda a: a),
    ("", " A", lambda a: a.T),
    ("A⁻¹ ", "", _invert),
    ("", " A⁻¹", lambda a: _invert(a).T),
)
"""A matrix before or behind the readings, or its inverse, as the one before them."""
_PLACES: tuple[tuple[str, Callable[[Array, Array], Array]], ...] = (
    ("{}(raw − b){}", lambda b, w: b),
    ("{}(raw + b){}", lambda b, w: -b),
    ("{}raw{} − b", lambda b, w: _invert(w) @ b),
    ("{}raw{} + b", lambda b, w: -_invert(w) @ b),
)
"""A vector inside or outside, as the bias beside the matrix."""


def _use(shape: Callable[[Array], Array], place: Callable[[Array, Array], Array]) -> Convention:
    def convert(b: Array, a: Array) -> tuple[Array, Array]:
        return place(b, shape(a)), shape(a)

    return convert


CONVENTIONS: Mapping[str, Convention] = {
    said.format(before, behind): _use(shape, place)
    for said, place in _PLACES
    for before, behind, shape in _SHAPES
}
"""Ways to use a vector b and a matrix A, as bias and matrix of field = matrix @ (raw − bias)."""
ALIKE_SPREADS = 1.02
"""Spreads of two ways that differ by less are of the same calibration."""


class Understood(NamedTuple):
    """A foreign calibration as one of agonic, how it was read, and what is left of the spread of
    the magnitude by it, and by the next way to read it."""

    calibration: Affine
    how: str
    spread: float
    next_spread: float


def understand(path: Path, samples: Samples) -> Understood:
    """The calibration of a file of another program, read as these samples show it is meant."""
    tried = sorted(_try_all(read_foreign(path), samples), key=lambda one: one[0])
    spread, affine, how = tried[0]
    before = _find_spread(samples.field)
    if not spread < max(0.5 * before, 0.03):  # half of what was recorded, or 3 % of the field
        raise LogError(
            f"this calibration does not fit {samples.name} in any of the ways that were tried: "
            f"the magnitude varies by {100 * spread:.1f} %, as recorded by {100 * before:.1f} %; "
            "check that it is of this sensor, and the unit of the log",
            path=path,
        )
    others = [s for s, other, _ in tried[1:] if not _is_same(affine, other)]
    left = f"the magnitude varies by {100 * spread:.2g} % with it, by {100 * before:.2g} % without"
    nearest = min(others, default=float("inf"))
    if nearest < 1.5 * spread:  # the log does not tell which is meant
        left += f"; another reading of it leaves {100 * nearest:.2g} %: hardly different"
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


def read_plain(path: Path, number: int | None = None) -> Affine:
    """The one calibration, or that of the compass of a number, in a file whose form says how it is
    meant."""
    read = read_foreign(path)
    if len(read) > 1 and number is not None:
        read = [one for one in read if one.number == number] or read
    one = read[0]
    if len(read) > 1 or one.unit is None or one.convention is None:
        raise LogError(
            "it holds several calibrations, or does not say how its numbers are meant: a log of "
            "the sensor tells (agonic verify FILE LOG -o mag.json); give mag.json",
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
    near = np.abs(one[1] - other[1]).max() < (ALIKE_SPREADS - 1) * size
    reach = max(float(np.abs(one[0]).max()), 1e-300)
    return bool(near and np.abs(one[0] - other[0]).max() < (ALIKE_SPREADS - 1) * reach)
