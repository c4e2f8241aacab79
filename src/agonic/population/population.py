"""`Population`: the calibrations of many sensors, column by column."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Mask
from agonic.calibration.decomposition import PAIRS
from agonic.errors import AgonicError
from agonic.health import Verdict
from agonic.readable import Readable


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """The calibration of one sensor from one log, or the reason why there is none.

    Figures of a row that could not be fitted are None. The fields are the columns of the table, in
    its order.

    Parameters
    ----------
    sensor : who it is in the population; the same for all logs of one sensor.
    channel : its name inside the log.
    device_id : the number by which an autopilot knows it, if it does.
    source : the log, as named by the user; `sha256` of its content.
    key : what the result depends on (content, settings, version), as one digest.
    start : when the readings begin (UTC), where the log knows; `duration_s` how long they last.
    temperature_C : mean, where it was recorded.
    rows : how many readings took part.
    method, model, gauge : as for `Calibrated` and `Affine`; "adjusted" is a fit from moments alone.
    verdict, status : the word and the sentence; `findings` the names of what was found.
    unusual : what is unlike the other sensors, in sentences; empty where nothing is, and until the
        row is in a table.
    unit_in, unit_out : of readings and field.
    bias_x … : in `unit_in`; matrix_xx … in `unit_out` per `unit_in`; standard errors with _sd.
    magnitude : of the field, in `unit_out`; `noise` of one reading on one axis, in `unit_in`.
    spread_before, spread_after : relative spread of the magnitude.
    residual_rms : in `unit_out`, on rows that the fit had not seen where there are any.
    heading_sd_deg : of a level heading.
    calibration, report : files of this row, from the folder of the table; None where not written.
    settings : what was asked for, as JSON; `version` of the software.
    """

    sensor: str
    channel: str = "mag"
    device_id: int | None = None
    source: str
    sha256: str = ""
    key: str = ""
    start: datetime | None = None
    duration_s: float | None = None
    temperature_C: float | None = None
    rows: int = 0
    method: str = ""
    model: str = ""
    gauge: str = ""
    verdict: Verdict
    status: str
    findings: tuple[str, ...] = ()
    unusual: str = ""
    unit_in: str = ""
    unit_out: str = ""
    bias_x: float | None = None
    bias_y: float | None = None
    bias_z: float | None = None
    bias_x_sd: float | None = None
    bias_y_sd: float | None = None
    bias_z_sd: float | None = None
    matrix_xx: float | None = None
    matrix_xy: float | None = None
    matrix_xz: float | None = None
    matrix_yx: float | None = None
    matrix_yy: float | None = None
    matrix_yz: float | None = None
    matrix_zx: float | None = None
    matrix_zy: float | None = None
    matrix_zz: float | None = None
    matrix_xx_sd: float | None = None
    matrix_xy_sd: float | None = None
    matrix_xz_sd: float | None = None
    matrix_yx_sd: float | None = None
    matrix_yy_sd: float | None = None
    matrix_yz_sd: float | None = None
    matrix_zx_sd: float | None = None
    matrix_zy_sd: float | None = None
    matrix_zz_sd: float | None = None
    magnitude: float | None = None
    noise: float | None = None
    spread_before: float | None = None
    spread_after: float | None = None
    residual_rms: float | None = None
    heading_sd_deg: float | None = None
    calibration: str | None = None
    report: str | None = None
    settings: str = ""
    version: str = ""


_HINTS = get_type_hints(Row)
COLUMNS: Mapping[str, Any] = {field.name: _HINTS[field.name] for field in fields(Row)}
"""The columns of a population and the types of `Row` that they hold."""

AXES = ("x", "y", "z")
ENTRIES = tuple(f"{i}{j}" for i in AXES for j in AXES)


@dataclass(frozen=True, eq=False)
class Population(Readable):
    """The calibrations of many sensors: one row a sensor and log, kept as columns.

    `columns` has every field of `Row`: numbers as float64 with NaN where missing (`rows` as int64),
    all else as objects with None. Rows are in order of source, channel and sensor.

    >>> row = Row(sensor="a", source="a.csv", verdict="refused", status="empty")
    >>> population = Population.of([row])
    >>> len(population), population["status"][0], population.bias.shape
    (1, 'empty', (1, 3))
    """

    columns: Mapping[str, NDArray[Any]]

    def __post_init__(self) -> None:
        if list(self.columns) != list(COLUMNS):
            odd = set(self.columns).symmetric_difference(COLUMNS)
            raise AgonicError(f"not the columns of a population: {', '.join(sorted(odd))}")

    @classmethod
    def of(cls, rows: Iterable[Row]) -> Population:
        """The population of these rows, in its order."""
        ordered = sorted(rows, key=lambda row: (row.source, row.channel, row.sensor))
        return cls({n: make_column(n, [getattr(row, n) for row in ordered]) for n in COLUMNS})

    @classmethod
    def joined(cls, parts: Sequence[Population]) -> Population:
        """The rows of all parts, in the order of a population."""
        every = (*parts, cls.of(()))  # so that no parts are no rows
        columns = {name: np.concatenate([part[name] for part in every]) for name in COLUMNS}
        keys = [columns[name].astype(str) for name in ("sensor", "channel", "source")]
        return cls(columns).select(np.lexsort(keys))

    def __len__(self) -> int:
        return len(self.columns["sensor"])

    def _say(self) -> list[str]:
        """How many rows, of what verdicts."""
        words, counts = np.unique(self["verdict"].astype(str), return_counts=True)
        said = ", ".join(f"{n} {word}" for word, n in zip(words, counts, strict=True))
        return [f"Population: {len(self)} rows", *([said] if said else [])]

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    def __iter__(self) -> Iterator[Row]:
        for values in zip(*self.columns.values(), strict=True):
            named = zip(COLUMNS, values, strict=True)
            yield Row(**{name: _make_value(value) for name, value in named})

    def select(self, rows: NDArray[Any]) -> Population:
        """The `rows` of a mask (n,) or indices (k,), as a population."""
        return Population({name: column[rows] for name, column in self.columns.items()})

    @property
    def fitted(self) -> Mask:
        """Which rows carry a calibration, good or to be checked, (n,)."""
        return np.asarray(self["verdict"] != "refused", dtype=bool)

    @property
    def bias(self) -> Array:
        """(n, 3), NaN where there is none."""
        return np.column_stack([self[f"bias_{i}"] for i in AXES])

    @property
    def bias_sd(self) -> Array:
        """(n, 3)."""
        return np.column_stack([self[f"bias_{i}_sd"] for i in AXES])

    @property
    def matrix(self) -> Array:
        """(n, 3, 3)."""
        return np.column_stack([self[f"matrix_{e}"] for e in ENTRIES]).reshape(-1, 3, 3)

    @property
    def matrix_sd(self) -> Array:
        """(n, 3, 3); of a symmetric or triangular matrix, NaN below the diagonal."""
        return np.column_stack([self[f"matrix_{e}_sd"] for e in ENTRIES]).reshape(-1, 3, 3)

    @property
    def cross(self) -> Array:
        """The symmetric part of xy, xz, yz, the same in every gauge to first order, (n, 3).

        NaN where the model has none.
        """
        i, j = np.array(PAIRS).T
        cross = 0.5 * (self.matrix[:, i, j] + self.matrix[:, j, i])
        cross[np.isin(self["model"].astype(str), ("sphere", "diagonal"))] = np.nan
        return np.asarray(cross)

    @property
    def cross_sd(self) -> Array:
        """(n, 3); where xy and yx have errors of their own, of their mean."""
        i, j = np.array(PAIRS).T
        errors = np.nan_to_num(self.matrix_sd, posinf=np.inf)
        once = (self["gauge"] == "symmetric")[:, None]
        both = 0.5 * np.hypot(errors[:, i, j], errors[:, j, i])
        return np.where(once, errors[:, i, j], both)


def make_column(name: str, values: Sequence[Any]) -> NDArray[Any]:
    """A column (n,) of the values of a field; None is NaN where they are numbers."""
    column: NDArray[Any] = np.empty(len(values), dtype=get_dtype(name))
    column[:] = values
    return column


def get_dtype(name: str) -> type:
    """The NumPy type that a column is kept as."""
    hint = COLUMNS[name]
    if hint is int:
        return np.int64
    return np.float64 if hint == (float | None) else object


def _make_value(value: Any) -> Any:
    """A column's entry as the field of a row."""
    if isinstance(value, np.floating):
        return None if np.isnan(value) else float(value)
    return int(value) if isinstance(value, np.integer) else value
