"""What a calibration file holds, kind by kind: the records that its JSON Schema is made of."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from agonic.calibration.affine import FREE_PARAMETERS, PARAMETERS
from agonic.calibration.deviation import PARAMETERS as DEVIATION_PARAMETERS
from agonic.calibration.schema_fields import (
    DeviceId,
    Five,
    Four,
    Frame,
    Gauge,
    Magnitude,
    Matrix,
    Noise,
    NotNegative,
    ProvenanceRecord,
    Row,
    Sensor,
    Unit,
    ValidityRecord,
    Vector,
)

LOWER = FREE_PARAMETERS[len(PARAMETERS) :]


class AffineRecord(Struct, frozen=True, kw_only=True, tag_field="kind", tag="affine"):
    """field = matrix @ (raw − bias)."""

    sensor: Sensor
    unit_in: Unit
    unit_out: Unit
    frame_in: Frame
    frame_out: Frame
    model: Literal["sphere", "diagonal", "full", "ellipse"]
    gauge: Gauge
    bias: Annotated[Vector, Meta(description="Subtracted from the readings, in unit_in.")]
    matrix: Annotated[Matrix, Meta(description="Row by row, unit_out per unit_in.")]
    covariance: Annotated[
        tuple[Row, ...] | None,
        Meta(
            description=f"Of {', '.join(PARAMETERS)}; in the gauge free, {', '.join(LOWER)} after "
            "them; of an interference, its coefficients row by row after those. Bias in unit_in, "
            "matrix in unit_out per unit_in."
        ),
    ] = None
    magnitude: Magnitude = None
    noise: Noise = None
    device_id: DeviceId = None
    latency_s: Annotated[
        float, Meta(description="How late the readings came beside the attitude, seconds.")
    ] = 0.0
    latency_sd_s: Annotated[
        NotNegative | None, Meta(description="Standard error of that; null: nothing told it.")
    ] = None
    validity: ValidityRecord = ValidityRecord()
    provenance: ProvenanceRecord


class InterferenceRecord(AffineRecord, frozen=True, kw_only=True, tag="interference"):
    """field = matrix @ (raw − bias − coefficients @ x), x from the sources."""

    sources: Annotated[
        tuple[Annotated[str, Meta(min_length=1, max_length=1000)], ...],
        Meta(
            description="Columns in x, each as it is, to a power (motor1_duty^1.5) or 1 above a "
            "value (heater_A>0.5), recorded late (@0.2) or through a filter (~0.3; the field "
            "follows it: ~-2), s; second is another magnetometer, three numbers."
        ),
    ]
    coefficients: Annotated[
        tuple[Row, Row, Row], Meta(description="Row by row, unit_in per unit of x.")
    ]
    second_sensor: Annotated[
        str | None, Meta(description="The name of the second magnetometer, where it is a source.")
    ] = None
    typical: Annotated[
        Row | None, Meta(description="What the sources were on average in the log.")
    ] = None
    timing_sd_s: Annotated[
        dict[str, float],
        Meta(description="Standard errors of delays and time constants that were found, s."),
    ] = {}


class ThermalRecord(Struct, frozen=True, kw_only=True, tag_field="kind", tag="thermal"):
    """field = matrix(T) @ (raw − bias(T) − rate dT/dt), powers of x = (T − centre)/half range."""

    sensor: Sensor
    unit_in: Unit
    unit_out: Unit
    frame_in: Frame
    frame_out: Frame
    gauge: Gauge
    centre_C: Annotated[float, Meta(description="Temperature at x = 0, °C.")]
    half_range_C: Annotated[float, Meta(gt=0, description="From x = 0 to x = 1, °C.")]
    bias: Annotated[
        tuple[Vector, ...], Meta(min_length=1, description="Of each power of x, in unit_in.")
    ]
    matrix: Annotated[
        tuple[Matrix, ...],
        Meta(min_length=1, description="Of each power of x, row by row, unit_out per unit_in."),
    ]
    rate: Annotated[
        Vector | None, Meta(description="Added to the bias, unit_in per °C/s; null: none.")
    ] = None
    covariance: Annotated[
        tuple[Row, ...] | None,
        Meta(
            description=f"Of {', '.join(PARAMETERS)}; in the gauge free, {', '.join(LOWER)} after "
            "them; each with all its powers, the rates last."
        ),
    ] = None
    magnitude: Magnitude = None
    noise: Noise = None
    device_id: DeviceId = None
    validity: ValidityRecord = ValidityRecord()
    provenance: ProvenanceRecord


class NetworkRecord(Struct, frozen=True, kw_only=True, tag_field="kind", tag="network"):
    """field = base(raw) + g(x) · (output_middle + output_half · V [tanh(U [x, 1]), 1]).

    With `second` it is V [tanh(W [tanh(U [x, 1]), 1]), 1].
    """

    sensor: Sensor
    unit_in: Unit
    unit_out: Unit
    frame_in: Frame
    frame_out: Frame
    base: Annotated[
        AffineRecord | InterferenceRecord | ThermalRecord | None,
        Meta(description="What corrects alone far from the training; null: nothing."),
    ]
    inputs: Annotated[
        tuple[str, ...],
        Meta(
            min_length=1,
            description="What goes in, in order: field (the reading, unit_in), temperature, "
            "temperature_rate, current_A, throttle, second, or a column such as motor1_duty.",
        ),
    ]
    input_middle: Annotated[Row, Meta(description="x = (input − middle) / half.")]
    input_half: Annotated[Row, Meta(description="x = (input − middle) / half.")]
    output_middle: Annotated[Row, Meta(description="Three, or one along the field, unit_out.")]
    output_half: Annotated[float, Meta(gt=0, description="From output 0 to 1, unit_out.")]
    hidden: Annotated[
        tuple[Row, ...], Meta(min_length=1, description="U: a row a node, its constant last.")
    ]
    output: Annotated[
        tuple[Row, ...], Meta(min_length=1, description="V: a row an output, its constant last.")
    ]
    centres: Annotated[
        tuple[Row, ...], Meta(min_length=1, description="Points that cover the training, in x.")
    ]
    reach: Annotated[
        float,
        Meta(gt=0, description="g(x) is 1 so far from the nearest centre, 0 at twice as far."),
    ]
    second: Annotated[
        tuple[Row, ...] | None,
        Meta(description="W: the nodes of a second hidden layer; null: there is one."),
    ] = None
    bound: Annotated[NotNegative | None, Meta(description="The longest correction, unit_out.")] = (
        None
    )
    misfit: Annotated[
        NotNegative | None, Meta(description="What the base leaves on an axis, sd, unit_out.")
    ] = None
    unmodelled: Annotated[
        NotNegative, Meta(description="What the network leaves inside on an axis, sd, unit_out.")
    ] = 0.0
    base_sd_ratio: Annotated[
        NotNegative, Meta(description="Standard errors of the base inside, over its own.")
    ] = 1.0
    covariance: Annotated[
        tuple[Row, ...] | None, Meta(description="Of U row by row, then W, then V.")
    ] = None
    held: Annotated[
        dict[str, float], Meta(description="Inputs that stay at a value instead of being read.")
    ] = {}
    magnitude: Annotated[
        NotNegative | None, Meta(description="Field magnitude it was trained in, in unit_out.")
    ] = None
    noise: Annotated[
        NotNegative | None,
        Meta(description="Standard deviation of what is left on an axis, in unit_out."),
    ] = None
    device_id: DeviceId = None
    validity: ValidityRecord = ValidityRecord()
    provenance: ProvenanceRecord


class RotationRecord(Struct, frozen=True):
    """A rotation as a unit quaternion, Hamilton, scalar first."""

    quat_wxyz: tuple[float, float, float, float]


class AlignmentRecord(Struct, frozen=True, kw_only=True, tag_field="kind", tag="alignment"):
    """field_out = rotation.apply(field_in)."""

    sensor: Sensor
    unit_in: Unit
    frame_in: Frame
    frame_out: Frame
    rotation: Annotated[RotationRecord, Meta(description="Turns frame_in into frame_out.")]
    covariance: Annotated[
        Matrix | None, Meta(description="Of the rotation vector, rad², row by row.")
    ] = None
    provenance: ProvenanceRecord


class ChainRecord(Struct, frozen=True, kw_only=True, tag_field="kind", tag="chain"):
    """Calibrations applied one after the other, in this order."""

    steps: Annotated[
        tuple[
            AffineRecord | InterferenceRecord | ThermalRecord | NetworkRecord | AlignmentRecord,
            ...,
        ],
        Meta(min_length=1),
    ]
    provenance: ProvenanceRecord


class DeviationRecord(Struct, frozen=True, kw_only=True, tag_field="kind", tag="deviation"):
    """magnetic = compass + deviation(compass), in one state of the vehicle."""

    sensor: Sensor
    coefficients: Annotated[Five, Meta(description="A, B, C, D, E, degrees; east positive.")]
    heel: Annotated[
        Four | None,
        Meta(description="Degrees per degree of roll·cos, roll·sin, pitch·cos, pitch·sin."),
    ] = None
    covariance: Annotated[
        tuple[Row, ...] | None, Meta(description=f"Of {', '.join(DEVIATION_PARAMETERS)}, degrees.")
    ] = None
    terms: Annotated[str, Meta(pattern="^[A-E]+$", description="The level terms that were fitted.")]
    noise_deg: Annotated[
        NotNegative | None, Meta(description="Standard deviation of one reading.")
    ] = None
    freedom: Annotated[
        NotNegative | None, Meta(description="Degrees of freedom of noise_deg; null: it was given.")
    ] = None
    power_state: Annotated[str, Meta(description="What was switched on during the swing.")] = ""
    current_A: Annotated[float | None, Meta(description="The current drawn then.")] = None
    largest_gap_deg: Annotated[
        float | None, Meta(description="Widest arc between headings that were steered.")
    ] = None
    largest_heel_deg: Annotated[
        tuple[float, float] | None, Meta(description="Largest roll and pitch during the swing.")
    ] = None
    provenance: ProvenanceRecord


AnyRecord = (
    AffineRecord
    | InterferenceRecord
    | ThermalRecord
    | NetworkRecord
    | AlignmentRecord
    | ChainRecord
    | DeviationRecord
)


class CalibrationFile(Struct, frozen=True):
    """A calibration of a magnetometer, made with agonic."""

    schema: Literal["agonic/calibration@1"]
    equation: Annotated[str, Meta(description="The correction in words, for the reader.")]
    calibration: AnyRecord
