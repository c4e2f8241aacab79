"""What the program that a file was written for makes of it: read, then applied to readings.

Each pair follows the source that its writer names, so that a test compares the two.
"""

import csv
import re
import struct
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from agonic.arrays import Array
from agonic.calibration.autopilots import ARDUPILOT, PX4
from agonic.errors import LogError
from agonic.exports.ardupilot import ardupilot_names
from agonic.exports.matlab import WARM
from agonic.exports.motioncal import PACKET_BYTES, SIGNATURE, Packet, compute_crc16
from agonic.exports.px4 import POWER, POWER_KIND, THERMAL, thermal_names
from agonic.exports.ros import BIAS, MATRIX
from agonic.exports.table import COLUMNS, NAMES
from agonic.logs.ardupilot.compass import LARGEST_SCALE
from agonic.logs.contents import read_bytes
from agonic.maths.equation.affine import split
from agonic.maths.equation.symmetric import unpack_symmetric

Float32 = NDArray[np.float32]


def parse_ardupilot(path: Path | str) -> dict[str, float]:
    """The parameters of a `.param` file, by name."""
    parameters = {}
    text = read_bytes(path).decode(errors="replace")
    for row, line in enumerate(text.splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if words:
            try:
                name, value = words
                parameters[name] = float(value)
            except ValueError:
                raise LogError("a row needs a name and a number", path=path, row=row) from None
    return parameters


def apply_ardupilot(
    parameters: Mapping[str, float], raw: ArrayLike, *, compass: int = 1, x: ArrayLike = 0.0
) -> Array:
    """The field (…, 3) that ArduPilot makes of readings, both in mG and body axes.

    `x` is the current in A or the throttle 0…1, whichever COMPASS_MOTCT says.
    """
    values = np.array([parameters[name] for name in ardupilot_names(compass)])
    offset, six, scale = values[:3], values[3:9], values[9]
    if not 1 / LARGEST_SCALE <= scale <= LARGEST_SCALE:
        scale = 1.0
    matrix = unpack_symmetric(six) if six[:3].any() else unpack_symmetric([1, 1, 1, *six[3:]])
    motor = np.array([parameters.get(name, 0.0) for name in ARDUPILOT.names(compass, "MOT")])
    added = np.asarray(x, dtype=np.float64)[..., None] * motor
    return np.asarray((scale * (np.asarray(raw) + offset)) @ matrix.T + added)


def parse_px4(path: Path | str) -> dict[str, float | int]:
    """The parameters of a `.params` file, by name."""
    parameters: dict[str, float | int] = {}
    text = read_bytes(path).decode(errors="replace")
    for row, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.startswith("#"):
            try:
                _, _, name, value, kind = line.split()
                parameters[name] = int(value) if int(kind) <= 6 else float(value)
            except ValueError:
                raise LogError(
                    "a row needs vehicle, component, name, number and type", path=path, row=row
                ) from None
    return parameters


def apply_px4(
    parameters: Mapping[str, float],
    raw: ArrayLike,
    *,
    slot: int = 0,
    x: ArrayLike = 0.0,
    temperature_C: ArrayLike | None = None,
) -> Array:
    """The field (…, 3) that PX4 makes of readings while armed, both in gauss and sensor axes.

    `x` is the current in A or the throttle 0…1, whichever CAL_MAG_COMP_TYP says; `temperature_C`
    the sensor's, where TC_M is to count.
    """
    values = np.array([parameters[name] for name in PX4.names(slot + 1, *PX4.parts[:3])])
    comp = np.array([parameters.get(name, 0.0) for name in PX4.names(slot + 1, "COMP")])
    unit = dict(POWER_KIND.values())[int(parameters.get(POWER, 1))]
    power = np.asarray(x, np.float64)[..., None] / unit
    offset = values[:3] + thermal_offset(parameters, temperature_C, slot=slot)
    return np.asarray((np.asarray(raw) + power * comp - offset) @ unpack_symmetric(values[3:]).T)


def thermal_offset(
    parameters: Mapping[str, float], temperature_C: ArrayLike | None, *, slot: int
) -> Array:
    """TC(T) (…, 3) in gauss; zero where it is not enabled or no temperature is given."""
    if temperature_C is None or not parameters.get(THERMAL):
        return np.zeros(3)
    *terms, reference, low, high = (parameters[name] for name in thermal_names(slot))
    d = np.clip(np.asarray(temperature_C, np.float64), low, high)[..., None] - reference
    return np.asarray(d ** np.arange(4) @ np.reshape(terms, (4, 3)))


def parse_matlab(path: Path | str) -> dict[str, Array]:
    """`A` (3, 3), `b` (1, 3), `expmfs` (1, 1), and of a calibration that changes `WARM`."""
    data = read_bytes(path)
    try:
        found = loadmat(BytesIO(data), variable_names=["A", "b", "expmfs", *WARM])  # type: ignore[arg-type]
        names = ["A", "b", "expmfs", *(name for name in WARM if name in found)]
        return {name: np.asarray(found[name], dtype=float) for name in names}
    except (MatReadError, NotImplementedError, KeyError, TypeError, ValueError) as error:
        raise LogError(f"not a MAT-file with A, b and expmfs ({error})", path=path) from None


def apply_matlab(
    variables: Mapping[str, Any],
    raw: ArrayLike,
    *,
    temperature_C: ArrayLike | None = None,
    rate_C_s: ArrayLike = 0.0,
) -> Array:
    """The field that MATLAB makes of readings (n, 3), (D − b) * A, or by the polynomials of T."""
    if temperature_C is None:
        return np.asarray((np.asarray(raw) - variables["b"]) @ variables["A"])
    centre, half = (np.ravel(variables[name])[0] for name in ("centre_C", "half_range_C"))
    pages = np.atleast_3d(variables["A_T"])
    powers = ((np.asarray(temperature_C) - centre) / half)[:, None] ** np.arange(pages.shape[2])
    late = np.broadcast_to(rate_C_s, len(powers))[:, None] * variables["rate"]
    left = np.asarray(raw) - powers @ variables["b_T"] - late
    return np.asarray(np.einsum("ni,ijk,nk->nj", left, pages, powers))


def parse_table(path: Path | str) -> dict[str, tuple[float, float | None, str]]:
    """Value, standard error (None where empty) and unit of each parameter of a table."""
    lines = read_bytes(path).decode(errors="replace").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    try:
        return {
            row["parameter"]: (
                float(row["value"]),
                float(row["standard_error"]) if row["standard_error"] else None,
                row["unit"],
            )
            for row in rows
        }
    except (KeyError, TypeError, ValueError) as error:
        raise LogError(f"not a table of {', '.join(COLUMNS)} ({error})", path=path) from None


def apply_table(
    parameters: Mapping[str, tuple[float, float | None, str]],
    raw: ArrayLike,
    *,
    temperature_C: ArrayLike | None = None,
    rate_C_s: ArrayLike = 0.0,
) -> Array:
    """The field (…, 3) of readings, in the units of the table."""
    if temperature_C is None:
        bias, matrix = split(np.array([parameters[name][0] for name in NAMES]))
        return np.asarray((np.asarray(raw) - bias) @ matrix.T)
    order = max(int(name.rsplit("_", 1)[1]) for name in parameters if name.startswith("bias_x_"))
    terms = [[parameters[f"{name}_{k}"][0] for name in NAMES] for k in range(order + 1)]
    x = (np.asarray(temperature_C) - parameters["centre"][0]) / parameters["half_range"][0]
    values = x[..., None] ** np.arange(order + 1) @ np.array(terms)
    rate = [parameters.get(f"rate_{axis}", (0.0,))[0] for axis in "xyz"]
    left = np.asarray(raw) - values[..., :3] - np.asarray(rate_C_s)[..., None] * rate
    matrix = values[..., 3:].reshape(*x.shape, 3, 3)
    return np.asarray(np.einsum("...ij,...j->...i", matrix, left))


def parse_ros(path: Path | str) -> dict[str, list[float]]:
    """The parameters of a file, each as a list of numbers, by name."""
    text = read_bytes(path).decode(errors="replace")
    found = re.findall(r"^\s*(initial_mag_\w+):\s*\[?([^]\n]*)", text, flags=re.MULTILINE)
    try:
        parameters = {name: [float(n) for n in numbers.split(",")] for name, numbers in found}
    except ValueError as error:
        raise LogError(f"a parameter is not a number ({error})", path=path) from None
    if set(parameters) != {*BIAS, MATRIX} or len(parameters[MATRIX]) != 9:
        raise LogError(f"it needs {', '.join(BIAS)} and nine numbers of {MATRIX}", path=path)
    return parameters


def apply_ros(parameters: Mapping[str, list[float]], raw: ArrayLike) -> Array:
    """The field (…, 3) that the node makes of readings, both in tesla."""
    bias = np.ravel([parameters[name] for name in BIAS])
    return np.asarray((np.asarray(raw) - bias) @ np.reshape(parameters[MATRIX], (3, 3)).T)


def parse_motioncal(path: Path | str) -> Packet:
    """The packet in a file; `LogError` where signature, length or CRC are wrong."""
    data = read_bytes(path)
    if len(data) != PACKET_BYTES or not data.startswith(SIGNATURE) or compute_crc16(data):
        raise LogError(
            "not a MotionCal packet: 68 bytes that start with 75 54 and end with their CRC",
            path=path,
        )
    values = struct.unpack("<16f", data[2:-2])
    return Packet(offset=values[6:9], field=values[9], matrix=values[10:])


def apply_motioncal(packet: Packet, raw: ArrayLike) -> Array:
    """The field (…, 3) that the device makes of readings, both in µT and sensor axes."""
    return np.asarray((np.asarray(raw) - packet.offset) @ unpack_symmetric(packet.matrix).T)


def parse_c(path: Path | str, *, name: str = "mag") -> dict[str, Float32]:
    """`b` (3,) and `A` (3, 3) of a header, or `T` (p, 12 or 15), `scale_C` and `range_C` (2,)."""
    text = read_bytes(path).decode(errors="replace")
    of_temperature = re.search(rf"\b{name}_T\[", text)
    arrays = {}
    for key in ("T", "scale_C", "range_C") if of_temperature else ("b", "A"):
        found = re.search(rf"\b{name}_{key}((?:\[\d+\])+)(?: AGONIC_FLASH)? = ([^;]*);", text)
        shape = [int(n) for n in re.findall(r"\d+", found[1])] if found else [0]
        numbers = re.findall(r"[-+.\d]+(?:e[-+]\d+)?(?=f)", found[2]) if found else []
        if not found or len(numbers) != np.prod(shape):
            raise LogError(f"no {name}_{key} with its numbers", path=path)
        arrays[key] = np.array(numbers, dtype=np.float32).reshape(shape)
    return arrays


def apply_c(
    arrays: Mapping[str, Float32],
    raw: ArrayLike,
    *,
    temperature_C: ArrayLike = 0.0,
    rate_C_s: ArrayLike = 0.0,
) -> Float32:
    """The field (…, 3) that the header makes of readings, in its own float32."""
    bias, matrix = arrays.get("b"), arrays.get("A")
    if "T" in arrays:
        clamped = np.clip(np.asarray(temperature_C, dtype=np.float32), *arrays["range_C"])
        x = ((clamped - arrays["scale_C"][0]) / arrays["scale_C"][1])[..., None]
        value = np.zeros_like(x)
        for row in arrays["T"][::-1]:
            value = value * x + row
        rate = np.asarray(rate_C_s, dtype=np.float32)[..., None]
        bias = value[..., :3] + (value[..., 12:] * rate if value.shape[-1] > 12 else np.float32(0))
        matrix = value[..., 3:12].reshape(*value.shape[:-1], 3, 3)
    assert bias is not None
    assert matrix is not None
    left = np.asarray(raw, dtype=np.float32) - bias
    return np.asarray((matrix * left[..., None, :]).sum(axis=-1), dtype=np.float32)


def turn_by_hand(*, roll: float, pitch: float, yaw: float) -> np.ndarray:
    """R = Rz(yaw) Ry(pitch) Rx(roll), degrees, entry by entry.

    As ArduPilot's Matrix3::from_euler and Quaternion::from_euler (AP_Math) and PX4's
    matrix::Dcm(Euler) write it: sensor axes into body axes.
    """
    (cr, cp, cy), (sr, sp, sy) = (f(np.radians([roll, pitch, yaw])) for f in (np.cos, np.sin))
    return np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )
