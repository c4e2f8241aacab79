"""CDF files of space missions, with cdflib; what variables are called is told in `products`."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.errors import LogError, MissingExtraError
from agonic.logs.clocks.clock import to_moments
from agonic.logs.contents import MOST_COMPRESSION, explain_damage
from agonic.logs.groups import Found
from agonic.logs.headers.header import MOST_COLUMNS
from agonic.logs.space.variables import find_variables

VERSION_3 = b"\xcd\xf3\x00\x01"

_EPOCH, _EPOCH16, _TT2000 = 31, 32, 33
"""Data types of moments: ms since year 0; s and ps since year 0; ns since 2000, leap seconds in."""


def read_tables(path: Path) -> Found:
    """The tables that the variables of a CDF file are."""
    try:
        import cdflib
    except ImportError:
        raise MissingExtraError("reading a CDF file", "space") from None
    with explain_damage("cannot be read as CDF"):
        with path.open("rb") as stream:
            _check(stream)
        file = cdflib.CDF(path)
        file._f = _Bounded(file._f, 100_000 + path.stat().st_size)
        info = file.cdf_info()
        names = [*info.zVariables, *info.rVariables]
    variables: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    notes: list[str] = []
    for name in names:
        try:
            if (values := _read_values(file, name, path.stat().st_size)) is not None:
                variables[name] = values
                said = {key.upper(): value for key, value in file.varattsget(name).items()}
                units[name] = str(said.get("UNITS", "")).strip()
        except Exception as error:
            notes.append(f"{name} cannot be read ({type(error).__name__}): the file is damaged")
    return find_variables(variables, units, {"format": "CDF", "notes": tuple(notes)})


class _Bounded:
    """A file that can be read only so often: damaged counts send cdflib round and round."""

    def __init__(self, file: Any, reads: int):
        self._file, self._left = file, reads

    def read(self, *size: int) -> Any:
        self._left -= 1
        if self._left < 0:
            raise EOFError("too many records")
        return self._file.read(*size)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def _check(stream: BinaryIO) -> None:
    """Refuse counts that no file has and that would keep cdflib busy for hours. Global descriptor
    and chains of variables, as the CDF Internal Format Description lays them out (version 3.9,
    sections 2.2 and 2.3). Compressed files have none to be seen."""
    head = stream.read(8)
    if head[4:] != b"\0\0\xff\xff":
        return
    wide = head.startswith(VERSION_3)
    offset, size = (">q", 8) if wide else (">i", 4)

    def number(at: int, form: str = ">i") -> int:
        stream.seek(max(at, 0))
        data = stream.read(struct.calcsize(form))
        if at < 0 or len(data) < struct.calcsize(form):
            raise LogError("damaged: it ends among its descriptors; fetch it again")
        return int(struct.unpack(form, data)[0])

    descriptor = number(8 + size + 4, offset)
    chains = [number(descriptor + size + 4 + k * size, offset) for k in range(2)]
    counts = [number(descriptor + 5 * size + 4 + 4 * k) for k in range(5)]
    r_variables, attributes, _, r_dimensions, z_variables = counts
    for count in (r_variables, z_variables, attributes):
        _refuse_count(count, MOST_COLUMNS, "variables or attributes")
    _refuse_count(r_dimensions, 10, "dimensions")
    at = chains[1]
    for _ in range(z_variables):
        _refuse_count(number(at + (340 if wide else 128)), 10, "dimensions")
        at = number(at + size + 4, offset)


def _refuse_count(count: int, most: int, what: str) -> None:
    if not 0 <= count <= most:
        raise LogError(f"damaged, or no log: it claims {count} {what}; fetch it again")


def _read_values(file: Any, name: str, size: int) -> NDArray[Any] | None:
    """The values of a variable, a row a record; moments as datetime64; `None` where it is none."""
    info = file.vdr_info(name)
    dimensions = [n for n, vary in zip(info.dim_sizes, info.dim_vary, strict=True) if vary]
    each = int(np.prod(dimensions, dtype=np.int64)) * 16 * max(info.num_elements, 1)
    if not 0 <= info.max_rec * each <= MOST_COMPRESSION * size:
        raise ValueError("more records than the file can hold")
    if not info.record_vary or len(dimensions) > 1:
        return None
    values = decode_moments(np.asarray(file.varget(name)), info.data_type)
    return values if values.ndim else None


def decode_moments(values: NDArray[Any], data_type: int) -> NDArray[Any]:
    """Values of one of CDF's three types of time as moments; those of other types as they are."""
    if data_type == _TT2000:  # in UTC by cdflib's table of leap seconds
        import cdflib

        known = values > np.iinfo(np.int64).min + 1_000
        stamps = cdflib.cdfepoch.to_datetime(np.where(known, values, 0))
        stamps = np.atleast_1d(stamps).astype("datetime64[us]")
        stamps[~known] = np.datetime64("NaT", "us")
        return np.asarray(stamps)
    if data_type == _EPOCH16:
        return _decode_epoch(values.real * 1e3 + values.imag * 1e-9)
    return _decode_epoch(values) if data_type == _EPOCH else values


def _decode_epoch(milliseconds: Array) -> NDArray[Any]:
    """Milliseconds since year 0, of which 1970 begins after 62 167 219 200 000, as moments; what
    lies outside 0…9999 is no time."""
    known = (milliseconds > 0) & (milliseconds < 315_569_520_000_000)
    return to_moments((np.where(known, milliseconds, np.nan) - 62_167_219_200_000) * 1e3)
