"""The records of a track file."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from msgspec import Struct

Row = tuple[float, ...]
Rows = tuple[Row, ...]


class BaseRecord(Struct, frozen=True, kw_only=True):
    """The calibration that was started from."""

    bias: Row
    matrix: Rows
    covariance: Rows | None
    unit_in: str
    gauge: str
    model: str
    noise: float | None
    sensor: str
    device_id: int | None
    frame_in: str
    frame_out: str
    parents: tuple[str, ...]


class ThermalRecord(Struct, frozen=True, kw_only=True):
    """How the calibration that was started from changes with temperature."""

    bias: Rows
    matrix: tuple[Rows, ...]
    centre_C: float
    half_range_C: float
    rate: Row | None
    covariance: Rows | None
    temperature_C: tuple[float, float] | None


class AboardRecord(Struct, frozen=True, kw_only=True):
    """What the calibration that was started from takes out of what disturbs on board."""

    bias: Row
    matrix: Rows
    covariance: Rows | None
    sources: tuple[str, ...]
    coefficients: Rows
    typical: Row | None
    second_sensor: str | None


class BatchesRecord(Struct, frozen=True):
    """Sums over batches of readings, by which errors that last show; lengths that were reached."""

    score: Row
    pending: Rows
    rows: int
    total: int
    information: Rows
    number: Row
    square: tuple[Rows, ...]
    waiting: Rows


class FilterRecord(Struct, frozen=True):
    """State, factors of its covariance, and what the filter watches."""

    state: Row
    columns: Rows
    diagonal: Row
    watch: Row
    batches: BatchesRecord | None = None


class OpeningRecord(Struct, frozen=True, rename={"outliers": "strays"}):
    """First readings, not yet settled."""

    prior: FilterRecord
    rows: Rows
    before: FilterRecord | None
    outliers: int | None
    learns: bool


class RecentRecord(Struct, frozen=True):
    """The last readings, to go back to the beginning of a jump."""

    before: FilterRecord
    middle: FilterRecord
    rows: Rows


class JumpRecord(Struct, frozen=True):
    """A jump of the bias."""

    time: float
    seen: float
    shift: Row
    shift_sd: Row


class StateRecord(Struct, frozen=True, kw_only=True, rename={"estimate": "belief"}):
    """Where it stands."""

    base: BaseRecord
    ground: ThermalRecord | None
    estimate: FilterRecord
    noise: float
    noise_known: bool
    opening: OpeningRecord | None
    recent: RecentRecord | None
    n: int
    refused: int
    jumps: tuple[JumpRecord, ...]
    epoch: datetime | None
    magnitude: float
    external_sd: float = 0.0
    external_time_s: float = 600.0
    gyro_unused: str = ""
    aboard: AboardRecord | None = None


class TrackFile(Struct, frozen=True):
    """A calibration followed in time, made with agonic."""

    schema: str
    params: dict[str, Any]
    state: StateRecord
    history: Rows
