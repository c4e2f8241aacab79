"""`calibrate_dataset`: the readings of many sensors in one Parquet table."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.ellipsoid.many_sensors import Fits, fit_many
from agonic.errors import LogError, check_choice
from agonic.field.place import choose_reference
from agonic.fleet.engine import Engine, Here, Lost, Processes
from agonic.fleet.one_log import Task, calibrate_by_rows, describe_log, explain
from agonic.fleet.rows import make_columns, make_refused_row
from agonic.fleet.settings import FleetSettings, digest
from agonic.health import MIN_READINGS
from agonic.health.mounting import VERTICAL_DOUBTFUL
from agonic.health.scale import GAIN
from agonic.logs.large.dataset import (
    Channel,
    Dataset,
    connect,
    database_error_type,
    drop_damaged,
    find_dataset,
    read_tables,
)
from agonic.logs.large.grouped_moments import Grouped, GroupedResiduals, sum_moments, sum_residuals
from agonic.logs.log import Table
from agonic.maths.equation.priors import soft_iron_pull
from agonic.population import Population, Row
from agonic.provenance import Input
from agonic.reference import Reference
from agonic.samples import Samples

MAX_CHANGES = 18.0
"""Of Σ |Σ r û|²/(n σ²) over eight blocks; 8 or less for white noise of one field."""


def find_doubts(
    fits: Fits, grouped: Grouped, residuals: GroupedResiduals, *, unit: str
) -> Mapping[str, Mask]:
    """The sensors (n,) to be fitted to their rows, by the reason."""
    count = grouped.count
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = residuals.sd
        gain = np.trace(fits.matrix, axis1=1, axis2=2) / 3
        limit = np.sqrt(2 * np.log(2 * np.maximum(count, 1))) + 1
        return {
            "no fit": ~fits.fitted,
            "few readings": count < 2 * MIN_READINGS,
            "rows left out": grouped.left_out > 0.01 * (count + grouped.left_out),
            "scale": (unit == "nT") & ~((gain > GAIN[0]) & (gain < GAIN[1])),
            "coverage": ~(fits.heading_sd_deg < 0.5),  # two halves of a log agree within 2°
            "noise": ~(relative < 0.02),  # of adjusted and likely fits the weights are alike
            "prior": ~(_compute_pull(fits) < 0.2),  # standard errors
            "outliers": (residuals.largest.max(axis=1) > limit * relative)
            | (residuals.fourths.sum(axis=1) > 5.0 * count * relative**4),  # kurtosis, of noise 3
            "changed": ~(_compute_changes(residuals) < MAX_CHANGES),
            "clipping": grouped.at_ends > np.maximum(12, 0.02 * count),  # of an axis's range
            "axes": residuals.vertical > 0.6 * VERTICAL_DOUBTFUL,
        }


def _compute_changes(residuals: GroupedResiduals) -> Array:
    """How much more than noise the blocks of each sensor pull its bias, (n,). In a block of white
    residuals E|Σ r û|² = n σ²; a bias that differs there adds to it, and so does noise that
    lasts."""
    expected = np.maximum(residuals.count, 1) * residuals.sd[:, None] ** 2
    return np.asarray(((residuals.pull**2).sum(axis=2) / expected).sum(axis=1))


def _compute_pull(fits: Fits) -> Array:
    """By how many standard errors the prior on soft iron would move each result, (n,)."""
    fitted = fits.fitted
    pull = np.full(len(fits), np.nan)
    prior_sd = 0.1  # on soft iron, of `fit_ellipsoid`
    pull[fitted] = soft_iron_pull(fits.matrix[fitted], fits.covariance[fitted], prior_sd)
    return pull


Refine = Literal["auto", "all", "none"]
Progress = Callable[[str, int, int], None]


def calibrate_dataset(
    dataset: Dataset | Path | str,
    settings: FleetSettings | None = None,
    *,
    refine: Refine = "auto",
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> Population:
    """Calibrate every sensor of a Parquet dataset, one row for each.

    All sensors are fitted from the moments of their readings, which DuckDB sums. Those whose rows
    would change the answer, and those for which there is no good one, are calibrated by their rows
    as `agonic calibrate` does it.

    Source: adjusted least squares (Markovsky, Kukush & Van Huffel 2004); DuckDB for the sums.
    """
    check_choice("refine", refine, get_args(Refine))
    settings = settings or FleetSettings()
    if not isinstance(dataset, Dataset):
        found = find_dataset(dataset, unit=settings.unit)
        if found is None:
            raise LogError("it holds no Parquet table with a column of sensors", path=dataset)
        dataset = found
    how = refine, settings, engine, progress or (lambda stage, done, total: None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what matters is among the findings of the rows
        try:
            return _calibrate_channels(dataset, *how)
        except database_error_type():
            return _calibrate_channels(drop_damaged(dataset), *how)


def _calibrate_channels(
    dataset: Dataset, refine: Refine, settings: FleetSettings, engine: Engine | None, tell: Progress
) -> Population:
    """The rows of all channels, and of what cannot be calibrated at all."""
    tell("hashing", 0, len(dataset.files))
    source, content = str(dataset.path), dataset.sha256
    parts: list[Population] = []
    with connect() as db:
        for channel in _choose_channels(dataset, settings.sensor):
            known = describe_log(source, content, settings, channel.name)
            known["channel"] = channel.name
            del known["sensor"]
            work = _ChannelWork(db, dataset, channel, settings, known, engine, tell)
            parts += work.calibrate(refine)
    lost = [
        make_refused_row(
            explain(LogError(why), file), **{**describe_log(file, "", settings), "sensor": ""}
        )
        for file, why in dataset.damaged
    ]
    return Population.joined([*parts, Population.of(lost)])


def _choose_channels(dataset: Dataset, asked: str | None) -> Sequence[Channel]:
    """The channels, or the one of this name or number."""
    found = dataset.channels
    chosen = [one for k, one in enumerate(found) if asked in (None, one.name, str(k))]
    if not chosen:
        names = ", ".join(one.name for one in found)
        raise LogError(f"no magnetometer {asked!r}; there are {names}", path=dataset.path)
    return chosen


@dataclass(frozen=True)
class _ChannelWork:
    """The work on one channel of a dataset; `known` are fields that its rows share."""

    db: Any
    dataset: Dataset
    channel: Channel
    settings: FleetSettings
    known: Mapping[str, Any]
    engine: Engine | None
    tell: Progress

    def calibrate(self, refine: Refine) -> Iterator[Population]:
        """The rows of all sensors of the channel: by moments alone, then the others."""
        self.tell("summing", 0, 0)
        grouped = sum_moments(self.db, self.dataset, self.channel)
        ids = np.arange(len(grouped))
        if refine != "all" and not _needs_rows(self.dataset, self.settings):
            fitted, doubtful = self._fit_moments(grouped)
            kept = ~doubtful | (refine == "none")
            yield fitted.select(kept)
            ids = ids[~kept]
        yield Population.of(self._refine(grouped.sensors, ids) if len(ids) else ())
        yield Population.of(self._list_empty(grouped))

    def _find_key(self, sensor: str) -> str:
        return digest(self.known["key"], sensor)

    def _fit_moments(self, grouped: Grouped) -> tuple[Population, Mask]:
        """The rows by moments alone, and which sensors should be calibrated by their rows."""
        unit, total = self.channel.unit_in, len(grouped)
        reference, of_place = _find_reference(grouped, self.settings)
        self.tell("fitting", 0, total)
        fits = fit_many(
            grouped.sums, grouped.centre, grouped.scale, reference, threads=2, **of_place
        )
        self.tell("checking", 0, total)
        residuals = sum_residuals(
            self.db, self.dataset, self.channel, fits.bias, fits.matrix, fits.magnitude
        )
        found = find_doubts(fits, grouped, residuals, unit=unit)
        columns = make_columns(
            fits,
            grouped,
            unit=unit,
            scaled=reference is not None,
            inclination_deg=of_place.get("inclination_deg", 60.0),
            **self.known,
        )
        columns["key"][:] = list(map(self._find_key, grouped.sensors))
        return Population(columns), np.any(list(found.values()), axis=0)

    def _refine(self, names: NDArray[Any], ids: Index) -> Iterator[Row]:
        """The rows of these sensors, calibrated as logs are."""
        engine = self.engine or (Here() if len(ids) <= 64 else Processes())  # they begin slowly
        function = partial(
            calibrate_by_rows,
            dataset=self.dataset,
            channel=self.channel,
            source=Input(name=self.known["source"], sha256=self.known["sha256"], count=0),
            settings=self.settings,
            known=self.known,
        )
        done = 0
        for task, rows in engine.run(function, self._make_tasks(names, ids)):
            if isinstance(rows, Lost):
                said = rows.sentence
                rows = tuple(make_refused_row(said, sensor=n, **self.known) for n, _ in task)
            yield from (replace(row, key=self._find_key(row.sensor)) for row in rows)
            done += len(rows)
            self.tell("calibrating by rows", done, len(ids))

    def _make_tasks(self, names: NDArray[Any], ids: Index) -> Iterator[Task]:
        task: list[tuple[str, Table]] = []
        rows = 0
        for place, table in read_tables(self.db, self.dataset, ids):
            task.append((str(names[place]), table))
            rows += len(next(iter(table.values())))
            if len(task) == 16 or rows > 100_000:
                yield tuple(task)
                task, rows = [], 0
        if task:
            yield tuple(task)

    def _list_empty(self, grouped: Grouped) -> Iterator[Row]:
        """The rows of sensors without a finite reading, and of rows that name no sensor."""
        for name, count in grouped.empty:
            said = f"none of its {count} rows holds three finite readings"
            own = {**self.known, "key": self._find_key(name)}
            yield make_refused_row(said, sensor=name, **own)
        if grouped.nameless:
            said = f"{grouped.nameless} rows name no sensor and were left out"
            yield make_refused_row(said, sensor="", **self.known)


def _find_reference(
    grouped: Grouped, settings: FleetSettings
) -> tuple[Reference | None, dict[str, Any]]:
    """The one reference of all sensors, and the settings that go with the place."""
    dated = grouped.start[np.isfinite(grouped.start)]
    epoch = None
    if len(dated):
        epoch = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=float(np.median(dated)))
    date = settings.date or (None if epoch else settings.undated)
    nowhere = Samples(field=np.ones((1, 3)), epoch=epoch)
    return choose_reference(nowhere, settings.at, date, settings.field_nT)


def _needs_rows(dataset: Dataset, settings: FleetSettings) -> bool:
    """Whether a fit by rows knows what moments do not: the attitude, or the place of each row."""
    placed = {"latitude_deg", "longitude_deg"} <= set(dataset.found)
    if settings.method not in ("auto", "ellipsoid"):
        return True
    if settings.field_nT is not None:
        return False
    if settings.at is None:
        return placed
    tilted = {"roll_deg", "pitch_deg"} <= set(dataset.found)
    return tilted and settings.method == "auto"
