"""Sums over the readings of each sensor of a dataset, made inside DuckDB.

Two passes: the first finds the middle and spread of each sensor's readings, the second sums the 35
products of degree four about them. One pass about a common centre would lose, to rounding, about
(distance of a bias / spread)⁴ of the digits that the noise is told by.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.health.mounting import NEAR_GRAVITY, UPRIGHT_SD
from agonic.logs.clocks.clock import UNIX_SECONDS
from agonic.logs.headers.header import Column
from agonic.logs.large.dataset import NUMBERS, Channel, Dataset, quote, select_clock, select_table
from agonic.maths.equation.moments import EXPONENTS


@dataclass(frozen=True, kw_only=True, eq=False)
class Grouped:
    """What the rows of each of n sensors add up to, in the unit of the result.

    `sensors` (n,) as the column has them, as texts; `count` (n,) readings, and `left_out` (n,)
    rows without a finite one; `empty` sensors without any, with their rows; `nameless` rows that
    name no sensor; `centre` (n, 3), `scale` (n,)
    and `sums` (n, 35) as of `Moments`; `at_ends` (n,) readings at the ends of the range of any
    axis; `magnitude` (n,) mean length of the readings and `spread` (n,) its standard deviation
    over it; `start` (n,) Unix seconds and `duration_s` (n,), NaN where the clock does not tell;
    `temperature_C` (n,) the mean.
    """

    sensors: NDArray[Any]
    count: NDArray[np.int64]
    left_out: NDArray[np.int64]
    empty: tuple[tuple[str, int], ...]
    nameless: int
    centre: Array
    scale: Array
    sums: Array
    at_ends: NDArray[np.int64]
    magnitude: Array
    spread: Array
    start: Array
    duration_s: Array
    temperature_C: Array

    def __len__(self) -> int:
        return len(self.sensors)


def sum_moments(db: Any, dataset: Dataset, channel: Channel) -> Grouped:
    """The sums of each sensor's readings, in order of the sensors' names. Leaves the table
    `sensors` in the database `db`: id (0…n−1), sensor, count, centre, scale, ends of the ranges,
    and the clock's first and last, for what is asked further."""
    _first_pass(db, dataset, channel)
    known = db.execute("select * from sensors order by id").fetchnumpy()
    count = _whole(known["count"])
    sums = _second_pass(db, dataset, channel, len(count))
    total, empty, nameless = _all_rows(db, dataset, count)
    start, duration = _clock(known, dataset)
    magnitude = _numbers(known["magnitude"])
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = _numbers(known["magnitude_sd"]) / magnitude
    centre = np.column_stack([_numbers(known[f"centre_{axis}"]) for axis in "xyz"])
    warm = dataset.column("temperature")
    factor, offset = warm.quantity.units[warm.unit] if warm and warm.unit else (1.0, 0.0)
    return Grouped(
        sensors=known["name"].astype(object),
        count=count,
        left_out=total - count,
        empty=empty,
        nameless=nameless,
        centre=channel.factor * centre,
        scale=channel.factor * _numbers(known["scale"]),
        sums=sums[:, : len(EXPONENTS)],
        at_ends=sums[:, -1].astype(np.int64),
        magnitude=channel.factor * magnitude,
        spread=spread,
        start=start,
        duration_s=duration,
        temperature_C=factor * _numbers(known["temperature"]) + offset,
    )


def select_readings(dataset: Dataset, channel: Channel, *more: str) -> str:
    """The SQL of the finite readings: sensor, x, y, z as doubles, and `more` expressions."""
    names = zip("xyz", channel.axes, strict=True)
    axes = [f"{quote(header)}::double as {axis}" for axis, header in names]
    columns = ", ".join((f"{quote(dataset.sensor)} as sensor", *axes, *more))
    finite = " and ".join(f"isfinite({axis})" for axis in "xyz")
    return (
        f"(select * from (select {columns} from {select_table(dataset.files)}) "
        f"where {finite} and sensor is not null)"
    )


def _first_pass(db: Any, dataset: Dataset, channel: Channel) -> None:
    """The table `sensors`: middle, spread, range, clock and temperature of each."""
    warm = dataset.column("temperature")
    numeric = warm is not None and dataset.columns[warm.header].startswith(NUMBERS)
    degrees = f"{quote(warm.header)}::double" if warm and numeric else "null::double"
    size = "sqrt(x * x + y * y + z * z)"
    ends = ", ".join(f"min({a}) as low_{a}, max({a}) as high_{a}" for a in "xyz")
    centre = ", ".join(f"avg({a}) as centre_{a}" for a in "xyz")
    scale = "sqrt(var_pop(x) + var_pop(y) + var_pop(z)) as scale"
    source = select_readings(
        dataset, channel, f"{select_clock(dataset)} as t", f"{degrees} as warm"
    )
    db.execute("drop table if exists sensors")
    db.execute(
        "create temp table sensors as "
        "select row_number() over (order by sensor) - 1 as id, sensor::varchar as name, * from ("
        f"select sensor, count(*) as count, {centre}, {scale}, {ends}, avg({size}) as magnitude, "
        f"stddev_pop({size}) as magnitude_sd, min(t) filter (isfinite(t)) as first, "
        "max(t) filter (isfinite(t)) as last, "
        "avg(warm) filter (isfinite(warm)) as temperature "
        f"from {source} group by sensor) order by id"
    )


def _second_pass(db: Any, dataset: Dataset, channel: Channel, n: int) -> Array:
    """The 35 sums about each sensor's own middle, and how many readings are at an end, (n, 36)."""
    pairs = ", ".join(f"{p} * {q} as {p}{q}" for p, q in ("xx", "xy", "xz", "yy", "yz", "zz"))
    about = ", ".join(f"(r.{a} - centre_{a}) / scale as {a}" for a in "xyz")
    ends = " or ".join(f"r.{a} = low_{a} or r.{a} = high_{a}" for a in "xyz")
    products = ", ".join(f"sum({_product(e)}) as m{k}" for k, e in enumerate(EXPONENTS) if k)
    return group_by_sensor(
        db,
        n,
        "count(*) as m0, " + products + ", count_if(at_end) as m35",
        f"select *, {pairs} from (select id, {about}, {ends} as at_end "
        f"from {select_readings(dataset, channel)} r join sensors using (sensor) where scale > 0)",
    )


def _product(exponents: tuple[int, ...]) -> str:
    """x^a y^b z^c by the products of two that are at hand."""
    letters = "".join(axis * power for axis, power in zip("xyz", exponents, strict=True))
    return " * ".join(filter(None, (letters[:2], letters[2:])))


def group_by_sensor(db: Any, n: int, sums: str, source: str, by: str = "id") -> Array:
    """What `sums` makes of the rows of `source` with the same `by`, 0…n−1; (n, k), 0 for none."""
    found = db.execute(f"select {by} as by_id, {sums} from ({source}) group by by_id").fetchnumpy()
    rows = _whole(found.pop("by_id"))
    made = np.zeros((n, len(found)))
    for k, column in enumerate(found.values()):
        made[rows, k] = _numbers(column)
    return made


def _all_rows(
    db: Any, dataset: Dataset, count: NDArray[np.int64]
) -> tuple[NDArray[np.int64], tuple[tuple[str, int], ...], int]:
    """Rows of each sensor whatever they hold, sensors without a reading, and nameless rows."""
    rows = db.execute(f"select count(*) from {select_table(dataset.files)}").fetchall()[0][0]
    if rows == count.sum():
        return count, (), 0
    n = len(count)
    every = f"select {quote(dataset.sensor)} as sensor from {select_table(dataset.files)}"
    total = group_by_sensor(
        db, n, "count(*)", f"select id from ({every}) join sensors using (sensor)"
    )
    empty = db.execute(
        f"select sensor::varchar, count(*) from ({every}) anti join sensors using (sensor) "
        "where sensor is not null group by sensor order by 1"
    ).fetchall()
    nameless = db.execute(f"select count(*) from ({every}) where sensor is null").fetchall()
    return total[:, 0].astype(np.int64), tuple(empty), int(nameless[0][0])


def _clock(known: dict[str, Any], dataset: Dataset) -> tuple[Array, Array]:
    """Start in Unix seconds and duration of each sensor, NaN where the clock does not tell."""
    first, last = _numbers(known["first"]), _numbers(known["last"])
    column = dataset.column("time")
    if column is None or not len(first):
        return np.full(len(first), np.nan), np.full(len(first), np.nan)
    per_second = _per_second(column, first, dataset)
    first, last = first / per_second, last / per_second
    low, high = UNIX_SECONDS
    dated = (first > low) & (first < high)
    return np.where(dated, first, np.nan), last - first


def _per_second(column: Column, first: Array, dataset: Dataset) -> float:
    """How many of the clock's units a second has; by their size where the header does not say."""
    if not dataset.columns[column.header].startswith(NUMBERS):
        return 1.0
    if column.unit:
        return 1 / column.quantity.units[column.unit][0]
    middle = float(np.nanmedian(first)) if np.isfinite(first).any() else np.nan
    low, high = UNIX_SECONDS
    for per_second in (1.0, 1e3, 1e6, 1e9):
        if low < middle / per_second < high:
            return per_second
    return 1.0


def _numbers(column: Any) -> Array:
    """A column as float64, NaN where it is null."""
    return np.asarray(np.ma.filled(np.ma.asarray(column, dtype=np.float64), np.nan))


def _whole(column: Any) -> NDArray[np.int64]:
    return np.asarray(np.ma.getdata(column), dtype=np.int64)


BLOCKS = 8
"""Stretches of equal time into which each sensor's readings are cut."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GroupedResiduals:
    """Residuals r = |W (raw − bias)|/F − 1 of n sensors, by blocks of time, (n, BLOCKS).

    `count` of readings; `squares` Σr² and `fourths` Σr⁴; `largest` |r|; `pull` (n, BLOCKS, 3)
    Σ r û with û the direction of the calibrated field: where the bias of a block is another, they
    point there. `vertical` (n,) is the scatter of the vertical part of the field over the whole, by
    gravity where it was recorded, NaN where not: the right axes keep it constant.
    """

    count: Array
    squares: Array
    fourths: Array
    largest: Array
    pull: Array
    vertical: Array

    @property
    def sd(self) -> Array:
        """Root mean square of all residuals of each sensor, (n,)."""
        return np.asarray(np.sqrt(self.squares.sum(1) / np.maximum(self.count.sum(1), 1)))


def sum_residuals(
    db: Any, dataset: Dataset, channel: Channel, bias: Array, matrix: Array, magnitude: Array
) -> GroupedResiduals:
    """The residuals of sensors that `summed` listed; 0 for those whose calibration is NaN.
    Parameters: bias (n, 3), matrix (n, 3, 3) symmetric or not, magnitude (n,) in the unit of the
    result."""
    import pyarrow as pa

    n = len(magnitude)
    shape = matrix * (channel.factor / magnitude[:, None, None])
    known = np.isfinite(shape).all(axis=(1, 2))
    columns: dict[str, Any] = {"id": np.flatnonzero(known)}
    for i, axis in enumerate("xyz"):
        columns[f"bias_{axis}"] = bias[known, i] / channel.factor
        columns |= {f"w{axis}{other}": shape[known, i, j] for j, other in enumerate("xyz")}
    db.register("given", pa.table(columns))
    db.execute("create or replace temp table fits as select * from given join sensors using (id)")
    db.unregister("given")
    sums = group_by_sensor(
        db,
        n * BLOCKS,
        "count(*) as n, sum(r * r) as q, sum(r * r * r * r) as f, max(abs(r)) as m, "
        "sum(r * u) as pu, sum(r * v) as pv, sum(r * w) as pw, "
        "sum(calm) as c, sum(calm * up) as cu, sum(calm * up * up) as cuu",
        _residuals(db, dataset, channel),
        f"id * {BLOCKS} + block",
    ).reshape(n, BLOCKS, 10)
    count, squares, fourths, largest = np.moveaxis(sums[..., :4], -1, 0)
    weight, first, second = np.moveaxis(sums[..., 7:].sum(axis=1), -1, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        vertical = np.sqrt(np.maximum(second / weight - (first / weight) ** 2, 0.0))
    return GroupedResiduals(
        count=count, squares=squares, fourths=fourths, largest=largest, pull=sums[..., 4:7],
        vertical=vertical,
    )  # fmt: skip


def _residuals(db: Any, dataset: Dataset, channel: Channel) -> str:
    """The SQL of id, block, residual r, direction u v w, and the part along gravity, weighed."""
    along = [f"w{a}x * x + w{a}y * y + w{a}z * z as {u}" for a, u in zip("xyz", "uvw", strict=True)]
    about = ", ".join(f"r.{a} - bias_{a} as {a}" for a in "xyz")
    late = f"floor({BLOCKS} * (t - first) / (last - first))"
    block = f"coalesce(greatest(least({late}, {BLOCKS - 1}), 0), 0)::bigint as block"
    gravity, usual = _gravity(db, dataset, channel)
    source = select_readings(dataset, channel, f"{select_clock(dataset)} as t", *gravity)
    matrix = ", ".join(f"w{i}{j}" for i in "xyz" for j in "xyz")
    kept = "id, block, ax, ay, az"
    moved = (
        f"(select id, ax, ay, az, {matrix}, {block}, {about} "
        f"from {source} r join fits using (sensor))"
    )
    turned = f"(select {kept}, {', '.join(along)} from {moved})"
    sized = (
        f"(select {kept}, u, v, w, sqrt(u * u + v * v + w * w) as size, "
        f"sqrt(ax * ax + ay * ay + az * az) as felt from {turned})"
    )
    off = f"felt / {usual} - 1"
    calm = f"case when abs({off}) < {NEAR_GRAVITY} then 1 / ({UPRIGHT_SD**2} + ({off}) ** 2) end"
    return (
        "select id, block, size - 1 as r, u / size as u, v / size as v, w / size as w, "
        f"(u * ax + v * ay + w * az) / (size * felt) as up, {calm} as calm "
        f"from {sized} where size > 0"
    )


def _gravity(db: Any, dataset: Dataset, channel: Channel) -> tuple[tuple[str, ...], float]:
    """The SQL of the acceleration that goes with a channel, and what it usually measures."""
    groups = dataset.found.get("acceleration", {})
    columns = groups.get(channel.name.removeprefix("mag")) or groups.get("") or {}
    if set(columns) != set("xyz"):
        return tuple(f"null::double as a{axis}" for axis in "xyz"), 1.0
    axes = tuple(f"{quote(columns[a].header)}::double as a{a}" for a in "xyz")
    felt = "median(sqrt(ax * ax + ay * ay + az * az))"
    some = f"(select {', '.join(axes)} from {select_table(dataset.files)} limit 20000)"
    usual = db.execute(f"select {felt} from {some} where isfinite(ax + ay + az)").fetchall()[0][0]
    return axes, float(usual or 1.0)
