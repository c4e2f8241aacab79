"""What records of a calibration file share: types of their fields, provenance and validity."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

Vector = tuple[float, float, float]


Matrix = tuple[Vector, Vector, Vector]


Row = tuple[float, ...]


Four = tuple[float, float, float, float]


Five = tuple[float, float, float, float, float]


Unit = Annotated[
    Literal["nT", "raw", "m/s2"],
    Meta(description="nT, raw where the scale is unknown; of an accelerometer m/s2."),
]


Frame = Annotated[
    str,
    Meta(
        pattern="^[a-z]$",
        description="Axes, one letter: m magnetometer, b body (forward, right, down).",
    ),
]


Sensor = Annotated[str, Meta(description="Whose readings the calibration corrects.")]


NotNegative = Annotated[float, Meta(ge=0)]


Gauge = Annotated[
    Literal["symmetric", "triangular", "free"],
    Meta(description="How the rotation that magnitude alone leaves open was fixed."),
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
