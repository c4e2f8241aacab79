"""C: a header with the numbers, the correction as nine multiplications, and a self-test.

    field = A (raw − b),   float32

in the units and axes of the calibration, with a mounting in a chain inside the matrix. Where it
changes with temperature, b and A are polynomials of it; beyond the range the temperature of the
nearest edge counts, since a cubic runs away there, and the function says so.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.calibration.network import Network
from agonic.calibration.steps import find_magnitude, find_step
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.c_network.header import make_network_header
from agonic.exports.c_network.parts import hold_network
from agonic.exports.c_thermal import make_thermal_header
from agonic.exports.convert import Export, hold_sources, reduce
from agonic.exports.firmware.c_text import (
    fill_template,
    make_c_name,
    require_identifier,
    write_array,
    write_comment,
    write_flash,
)
from agonic.exports.fixed_temperature import hold_temperature
from agonic.exports.polynomials import changes_with_temperature


def write_c(
    calibration: Calibration,
    path: Path | str,
    *,
    name: str | None = None,
    temperature_C: float | None = None,
) -> Export:
    """Write a C header (C99 and C++) with `{name}_b`, `_A`, `_correct` and `_self_test`.

    Parameters: `calibration`; `path` of the header; `name`, with which its identifiers begin,
    by default that of the sensor; `temperature_C`.

    A calibration that changes with temperature becomes polynomials, and `_correct` takes the
    temperature; or with `temperature_C` it is held there. A network keeps its base and its domain:
    `_correct` takes what it needs beside the reading, and returns 0 far from its training.

    Raises `AgonicError` where `name` is not a C identifier.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_c(mag, folder + "/mag.h")
    ...     [row for row in export.path.read_text().split("\\n") if "mag_b[3]" in row]
    ['static const float mag_b[3] = {3000.0f, 0.0f, 0.0f};']
    """
    name = make_c_name(calibration.sensor) if name is None else require_identifier(name)
    if find_step(calibration, Network) is not None:
        if temperature_C is not None:
            calibration = hold_network(calibration, temperature_C)
        text, warnings = make_network_header(calibration, name)
        return Export(path=write_atomically(path, text), target="c", warnings=warnings)
    if changes_with_temperature(calibration) and temperature_C is None:
        text, warnings = make_thermal_header(calibration, name)
        return Export(path=write_atomically(path, text), target="c", warnings=warnings)
    one, lost = hold_temperature(calibration, temperature_C)
    one, held = hold_sources(one)
    bias, matrix = reduce(one)
    raw, expected, tolerance = _example(one, bias, matrix)
    formula, warnings = "field = A (raw - b), float32", (*lost, *held)
    text = fill_template(
        "headers/affine.h.in",
        {
            "name": name,
            "GUARD": name.upper(),
            "about": write_comment(write_banner(calibration, formula, warnings)),
            "flash": write_flash(),
            "unit_in": calibration.unit_in,
            "unit_out": calibration.unit_out,
            "frame_in": calibration.frame_in,
            "b": write_array(bias),
            "A": write_array(matrix),
            "known": write_array([*raw, *expected]),
            "tolerance": format_float32(tolerance),
        },
    )
    return Export(path=write_atomically(path, text), target="c", warnings=warnings)


def _example(calibration: Calibration, bias: Array, matrix: Array) -> tuple[Array, Array, float]:
    """A reading, its field, and how far float32 may be off.

    Seven roundings lie on the way (bias, matrix, difference, product, two sums, expected value),
    each of half a unit in the last place of numbers no larger than |matrix| (|raw| + |bias|); a
    little over twice that is allowed.
    """
    size = find_magnitude(calibration) or float(np.linalg.norm(matrix @ bias)) or 1.0
    field = size * np.array([0.48, -0.6, 0.64])
    raw = (np.linalg.solve(matrix, field) + bias).astype(np.float32).astype(np.float64)
    largest = (np.abs(matrix) @ (np.abs(raw) + np.abs(bias))).max()
    tolerance = 8 * np.finfo(np.float32).eps * largest
    return raw, matrix @ (raw - bias), float(f"{tolerance:.1g}")
