"""How fields of calibrations stand in a file: their JSON types and descriptions, said once."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple

from msgspec import Meta, Struct


class Stored(NamedTuple):
    """The form in a file of a field that has another in memory, as an array has."""

    form: Any


def described(says: str, **limits: Any) -> Meta:
    """What is said of a field, and the limits of its values."""
    return Meta(description=says, **limits)


def stored(form: Any, says: str, **limits: Any) -> Stored:
    """The form of a field in a file, what is said of it, and the limits of its values."""
    return Stored(Annotated[form, described(says, **limits)])


Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Row = tuple[float, ...]
Rows = tuple[Row, ...]
Four = tuple[float, float, float, float]
Five = tuple[float, float, float, float, float]
NotNegative = Annotated[float, Meta(ge=0)]
Name = Annotated[str, Meta(min_length=1, max_length=1000)]

Unit = Annotated[
    str,
    stored(
        Literal["nT", "raw", "m/s2"],
        "nT, raw where the scale is unknown; of an accelerometer m/s2.",
    ),
]
Frame = Annotated[
    str,
    Meta(
        pattern="^[a-z]$",
        description="Axes, one letter: m magnetometer, b body (forward, right, down).",
    ),
]
Sensor = Annotated[str, Meta(description="Whose readings the calibration corrects.")]
Gauge = Annotated[
    str,
    stored(
        Literal["symmetric", "triangular", "free"],
        "How the rotation that magnitude alone leaves open was fixed.",
    ),
]
Magnitude = Annotated[
    NotNegative | None, Meta(description="Field magnitude it was scaled to, in unit_out.")
]
Noise = Annotated[
    NotNegative | None,
    Meta(description="Standard deviation of one reading on one axis, in unit_in."),
]
DeviceId = Annotated[
    int | None, Meta(description="The number by which an autopilot knows the sensor.")
]


class InputRecord(Struct, frozen=True):
    """One thing that went in: its name, the SHA-256 of its bytes, and how many rows were used."""

    name: str
    sha256: str
    count: int


class ProvenanceRecord(Struct, frozen=True):
    """Where the calibration came from."""

    inputs: Annotated[tuple[InputRecord, ...], Meta(description="The data it was made from.")]
    settings: Annotated[dict[str, Any], Meta(description="What the user or the program chose.")]
    method: Annotated[tuple[str, ...], Meta(description="Citation keys, see `agonic cite`.")]
    parents: Annotated[tuple[str, ...], Meta(description="SHA-256 of calibrations it rests on.")]
    software: Annotated[str, Meta(description="Program and version that made it.")]
    created: Annotated[str, Meta(description="UTC, ISO 8601.")]


class ValidityRecord(Struct, frozen=True):
    """Where the calibration may be used."""

    largest_reading: Annotated[
        float | None, Meta(description="Largest reading seen on an axis, in unit_in.")
    ] = None
    temperature_C: Annotated[
        tuple[float, float] | None, Meta(description="Lowest and highest temperature seen, °C.")
    ] = None


class RotationRecord(Struct, frozen=True):
    """A rotation as a unit quaternion, Hamilton, scalar first."""

    quat_wxyz: tuple[float, float, float, float]
