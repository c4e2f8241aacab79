"""What the calibrations of a dataset's sensors leave of its readings, summed inside DuckDB."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.health.mounting import NEAR_GRAVITY, UPRIGHT_SD
from agonic.logs.large.dataset import Channel, Dataset, quote, select_table
from agonic.logs.large.grouped_moments import group_by_sensor, select_clock, select_readings

BLOCKS = 8
"""Stretches of equal time into which each sensor's readings are cut."""
_SOME = 20_000  # readings tell what the accelerometers measure at rest


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
    result.
    """
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
        count=count,
        squares=squares,
        fourths=fourths,
        largest=largest,
        pull=sums[..., 4:7],
        vertical=vertical,
    )


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
    some = f"(select {', '.join(axes)} from {select_table(dataset.files)} limit {_SOME})"
    usual = db.execute(f"select {felt} from {some} where isfinite(ax + ay + az)").fetchall()[0][0]
    return axes, float(usual or 1.0)
