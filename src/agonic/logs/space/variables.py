"""Named variables with units, as CDF and netCDF files and texts of VirES hold them, as tables.

What magnetic satellites call theirs is known: Swarm, CryoSat-2, GRACE and CHAMP data as ESA and
VirES write them: Timestamp; Latitude, Longitude and Radius, geocentric; vectors in nT named for
their frame (`B_VFM`, `B_NEC`); `F`, the scalar instrument; `q_NEC_CRF`, which turns vectors of the
star camera frame into north-east-centre, scalar last; and flags, where 255 is "no data" (Swarm
Level 1b Product Definition, SW-RS-DSC-SY-0007; CDF format, SW-ID-GMV-GS-0006).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Mask
from agonic.errors import LogError, UnitError
from agonic.logs.arrays import stacked
from agonic.logs.clocks.clock import UNIX, read_clock, to_moments
from agonic.logs.contents import to_number
from agonic.logs.groups import Found
from agonic.logs.headers.columns import refuse_many
from agonic.logs.headers.header import name_quantity
from agonic.logs.headers.quantities import DOCUMENT
from agonic.logs.log import About, Stream
from agonic.logs.rows.auxiliary import MOST_OF_THE_ROWS
from agonic.maths.earth.geodesy import directions, earth_fixed, from_geocentric, north_east_down
from agonic.maths.rotations.attitude import angles_deg
from agonic.units import RAW, find_unit, nanotesla_per

Variables = Mapping[str, NDArray[Any]]

FILL = 1e30
"""Floating numbers of at least this size stand for missing ones in CDF (−1e31) and netCDF."""

_SPELLINGS = {
    theirs: ours for ours, words in DOCUMENT["spellings"].items() for theirs in words.split()
}


def find_variables(variables: Variables, units: Mapping[str, str], about: About) -> Found:
    """The tables that variables are: as magnetic satellites name them, or as a table's columns.
    `units` of the variables by name, where the file says; moments are datetime64."""
    if not variables and about.get("notes"):
        raise LogError(f"{about['notes'][0]}; fetch it again")
    if stacked.is_broad(variables):
        return stacked.find_tables(variables, {**about, "notes": ()})
    known: dict[str, NDArray[Any]] = {}
    for name, values in variables.items():
        if values.ndim or stacked.is_sampling_rate(name):
            floating = values.dtype.kind == "f"
            known[name] = np.where(np.abs(values) < FILL, values, np.nan) if floating else values
    if not known:
        raise LogError("there are no variables in it; fetch the file again")
    spelled = {name: _SPELLINGS.get(text.strip().lower(), text) for name, text in units.items()}
    if not is_spacecraft(known):
        headed = {_header(n, v, spelled.get(n, "")): v for n, v in known.items()}
        return stacked.find_tables(_add_clock(headed, "time"), about)
    ours = {name: _convert_unit(name, known[name], spelled.get(name, "")) for name in known}
    try:
        with np.errstate(all="ignore"):
            return find_spacecraft(_add_clock(ours, "Timestamp"), about)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:  # beyond all bounds
        raise LogError(f"the numbers in it make no sense ({error}); fetch it again") from error


def _convert_unit(name: str, values: NDArray[Any], unit: str) -> NDArray[Any]:
    """Lengths in m and fields in nT; variables of other kinds as they are."""
    if name == "Radius":
        return values * (1e3 if unit == "km" else 1.0)
    with suppress(UnitError):
        if values.dtype.kind == "f" and find_unit(unit) != RAW:
            return values * nanotesla_per(unit)
    return values


def _add_clock(variables: Variables, name: str) -> dict[str, NDArray[Any]]:
    """The variables with the first that holds moments under that name, unless it is taken."""
    moments = [n for n, values in variables.items() if values.dtype.kind == "M"]
    if not moments or name in moments:
        return dict(variables)
    return {name if n == moments[0] else n: values for n, values in variables.items()}


def _header(name: str, values: NDArray[Any], unit: str) -> str:
    """The name with the unit behind it, where that can be understood, as a column's header."""
    headed = f"{name}_{unit}"
    return headed if unit and name_quantity(headed + "[0]" * (values.ndim == 2)) else name


def read_tables(path: Path) -> Found:
    """The tables of a text of VirES; the service writes nT, degrees and metres."""
    header, *lines = path.read_bytes().decode("latin-1").replace("\r\n", "\n").split("\n")
    names = header.split(",")
    refuse_many(len(names))
    rows = [cells for line in lines if len(cells := line.split(",")) == len(names)]
    lost = sum(bool(line.strip()) for line in lines) - len(rows)
    if not rows:
        raise LogError("there is a header and no whole row below it; fetch it again")
    notes = (f"{lost} rows are not whole: left out",) if lost else ()
    columns = {
        name: _column(name, cells)
        for name, cells in zip(names, zip(*rows, strict=True), strict=True)
    }
    variables = {name: values for name, values in columns.items() if values is not None}
    return find_variables(variables, {}, {"format": "VirES text table", "notes": notes})


def _column(name: str, cells: tuple[str, ...]) -> NDArray[Any] | None:
    """Moments, texts, vectors (n, k) or numbers; `None` where vectors differ in length."""
    if name == "Spacecraft":
        return np.array(cells, dtype=object)
    if name == "Timestamp":
        seconds, epoch, _ = read_clock(np.array(cells, dtype=object), None)
        if seconds is None or epoch is None:
            raise LogError(f"the time {cells[0][:40]!r} cannot be read; fetch the file again")
        return to_moments((seconds + (epoch - UNIX).total_seconds()) * 1e6)
    parts = [cell.strip("{} ").split(";") for cell in cells]
    width = max(set(map(len, parts)), key=[len(p) for p in parts].count)
    values = [[to_number(x) for x in p] if len(p) == width else [np.nan] * width for p in parts]
    return np.array(values)[:, 0] if width == 1 else np.array(values)


def compare_scalar(field: Array, scalar: Array) -> tuple[Array, Array | None, tuple[str, ...]]:
    """The field (n, 3) and the scalar reading (n,), both nT, as they can stand beside each other. A
    reading that is not above zero is none. Rows without one lose their field where most rows have
    one, which is worth more than they are; else the scalar column is left out. So is one that is
    the magnitude of the vector itself."""
    readings = np.asarray(np.isfinite(field).all(axis=1))
    known = np.isfinite(scalar) & (scalar > 0)
    both = readings & known
    if not both.any():
        return field, None, ()
    if np.abs(np.linalg.norm(field[both], axis=1) - scalar[both]).max() < 1e-3:
        note = "F is the magnitude of the vector, not the reading of a scalar instrument"
        return field, None, (note,)
    if both.all():
        return field, scalar, ()
    missing = int((readings & ~known).sum())
    said = f"no scalar reading in {missing} of {readings.sum()} rows"
    if both.sum() < MOST_OF_THE_ROWS * readings.sum():
        return field, None, (f"{said}: the scalar column was left out",)
    kept = np.where(both[:, None], field, np.nan)
    return kept, np.where(known, scalar, np.nan), (f"{said}: left out",) if missing else ()


FRAMES = {"VFM": "m", "FGM": "m", "CRF": "c", "NEC": "n"}
"""The letter of the axes in the name of a vector. NEC ends in the centre of the Earth, not in the
nadir of the ellipsoid; NEC components are turned into north, east, down."""
NO_DATA = 255
NOMINAL = (0, 1)
"""Flags of readings to trust; 1 is another mode of the scalar instrument."""

_VECTOR = re.compile(rf"B_({'|'.join(FRAMES)})\d?")
_ATTITUDE = "q_NEC_CRF"
_SAME_TURN = 0.01
"""Share of the field by which B_VFM and B_NEC may differ after the camera's attitude."""


def is_spacecraft(variables: Variables) -> bool:
    """Whether a vector is named as magnetic satellites name theirs."""
    return bool(_vectors(variables))


def find_spacecraft(variables: Variables, about: About) -> Found:
    """The tables that the variables are, one for each vector of each spacecraft, those in sensor
    axes first. `variables` (n,), (n, 3) or (n, 4) by name, in nT, degrees and m; `Timestamp` as
    datetime64."""
    rows = len(variables[_vectors(variables)[0]])
    fitting = {name: values for name, values in variables.items() if len(values) == rows}
    crafts = np.array([str(one) for one in fitting.get("Spacecraft", [""] * rows)])
    several = list(dict.fromkeys(crafts.tolist()))
    tables: dict[str, dict[str, NDArray[Any]]] = {}
    remarks: dict[str, tuple[str, ...]] = {}
    used: set[str] = set()
    for vector, craft in product(_vectors(fitting), several):
        own = {name: values[crafts == craft] for name, values in fitting.items()}
        shared, said, used = _shared(own)
        name = f"{craft} {vector}" if len(several) > 1 else vector
        tables[name], notes = _table(vector, own, shared)
        remarks[name] = (*said, *notes)
    streams = (
        Stream(name=name, rows=len(values))
        for name, values in variables.items()
        if name not in {*used, *_vectors(fitting)}
    )
    return Found(tables, about, remarks=remarks, streams=tuple(streams))


def _vectors(variables: Variables) -> list[str]:
    """The names of the vectors of a magnetometer, sensor axes first."""
    names = [
        name
        for name, values in variables.items()
        if _VECTOR.fullmatch(name) and values.ndim == 2 and values.shape[1] == 3
    ]
    return sorted(names, key=lambda name: list(FRAMES).index(name.split("_")[1][:3]))


def _shared(variables: Variables) -> tuple[dict[str, NDArray[Any]], list[str], set[str]]:
    """Time and place, flags, spacecraft: what goes with every vector; notes; and what was used."""
    table: dict[str, NDArray[Any]] = {}
    remarks: list[str] = []
    if "Timestamp" in variables:
        table["time"] = variables["Timestamp"]
    places = ("Latitude", "Longitude", "Radius")
    if all(name in variables for name in places):
        latitude, longitude, height = from_geocentric(*(variables[name] for name in places))
        table |= {"latitude_deg": latitude, "longitude_deg": longitude, "altitude_m": height}
        remarks.append("latitude and radius are geocentric: made geodetic")
    flags = {name: variables[name] for name in ("Flags_F", "Flags_B") if name in variables}
    odd = np.zeros(len(next(iter(variables.values()))), dtype=bool)
    for name, values in flags.items():
        strange = ~np.isin(values, (*NOMINAL, NO_DATA))
        odd |= strange
        if strange.any():
            remarks.append(f"{name} is above 1 in {strange.sum()} rows: flagged")
    if flags:
        table["flagged"] = odd.astype(float)
    used = {"Timestamp", "Spacecraft", "F", _ATTITUDE, "Flags_q", *places, *flags}
    return table, remarks, used


def _table(
    name: str, variables: Variables, shared: Mapping[str, NDArray[Any]]
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """The table of one vector, and notes on it."""
    field = np.array(variables[name], dtype=np.float64)
    notes: list[str] = []
    gone = variables.get("Flags_B", np.zeros(len(field))) == NO_DATA
    gone |= ~field.any(axis=1)  # a vector of three zeros stands for none too
    if gone.any():
        field[gone] = np.nan
        notes.append(f"no data in {gone.sum()} rows: left out")
    table = dict(shared)
    letter = FRAMES[name.split("_")[1][:3]]
    if letter != "n":
        attitude, why = _attitude(name, variables, shared.get("latitude_deg"))
        table |= attitude
        notes += [why] if why else []
    elif "latitude_deg" in shared:  # in the nadir of the geodetic latitude
        seen = directions(variables["Latitude"], variables["Longitude"])
        vectors_e = earth_fixed(field.T, seen)
        down = directions(shared["latitude_deg"], variables["Longitude"])
        field = north_east_down(vectors_e, down).T
        notes.append("components of north, east, centre: turned into north, east, down")
    if "F" in variables:
        reading = np.array(variables["F"], dtype=np.float64)
        reading[variables.get("Flags_F", np.zeros(len(reading))) == NO_DATA] = np.nan
        field, beside, said = compare_scalar(field, reading)
        table |= {} if beside is None else {"scalar_nT": beside}
        notes += said
    table |= {f"mag_{axis}_nT": field[:, k] for k, axis in enumerate("xyz")}
    table["frame"] = np.full(len(field), letter, dtype=object)
    return table, notes


def _attitude(
    name: str, variables: Variables, latitude_deg: Array | None
) -> tuple[dict[str, Array], str]:
    """Roll, pitch and heading of the star camera frame, and a note."""
    q = variables.get(_ATTITUDE)
    if q is None or q.ndim != 2 or q.shape[1] != 4:
        return {}, ""
    q = np.array(q, dtype=np.float64)
    size = np.linalg.norm(q, axis=1)
    usable = np.asarray(np.abs(size - 1) < _SAME_TURN)
    usable &= variables.get("Flags_q", np.zeros(len(q))) != NO_DATA
    if not usable.any():
        return {}, f"{_ATTITUDE} left out: it holds no attitude"
    rot_nc = Rotation.from_quat(np.where(usable[:, None], q, [0.0, 0.0, 0.0, 1.0]))
    if not _agree(rot_nc[usable], name, variables, usable):
        return {}, f"{_ATTITUDE} left out: it does not take {name} to B_NEC"
    if latitude_deg is not None:  # from the centre of the Earth to the nadir of the ellipsoid
        tilt_deg = latitude_deg - variables["Latitude"]
        rot_nc = Rotation.from_euler("y", tilt_deg[:, None], degrees=True) * rot_nc
    angles = angles_deg(rot_nc.as_matrix())
    columns = ("roll_deg", "pitch_deg", "heading_deg")
    given = {c: np.where(usable, a, np.nan) for c, a in zip(columns, angles, strict=True)}
    return given, "roll, pitch and heading are those of the star camera's frame"


def _agree(rot_nc: Rotation, name: str, variables: Variables, rows: Mask) -> bool:
    """Whether one constant turn takes the vector to B_NEC by way of the camera's attitude."""
    known = variables.get("B_NEC")
    if known is None:
        return True
    seen_c = rot_nc.apply(np.asarray(known[rows], np.float64), inverse=True)
    field = np.asarray(variables[name][rows], np.float64)
    usable = np.isfinite(seen_c).all(axis=1) & np.isfinite(field).all(axis=1)
    seen_c, field = seen_c[usable], field[usable]
    size = np.linalg.norm(field, axis=1)
    if len(field) < 3 or not size.all():
        return True
    turn, _ = Rotation.align_vectors(seen_c, field)
    apart = np.linalg.norm(turn.apply(field) - seen_c, axis=1)
    return bool(np.median(apart / size) < _SAME_TURN)
