"""`departures`: sensors that left their population, by where they are and how they moved."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from agonic.arrays import Array, Index, Mask
from agonic.health import Finding
from agonic.health.finding import figure
from agonic.history.fit import MAX_DRIFT_CHANCE, MIN_CALIBRATIONS, NAMES, extract_parameters
from agonic.history.maths.drift_model import Series, compute_posterior
from agonic.history.result import Drift
from agonic.population import Population, find_outliers
from agonic.population.outlier import choose_rate, discover, list_tests
from agonic.population.peers import MIN_PEERS, make_quantity
from agonic.population.store import History

_KINDS = {"bias": slice(0, 3), "gain": slice(3, 6), "cross": slice(6, 9)}


@dataclass(frozen=True)
class Departure:
    """A sensor that left the others: "level", where its last calibration is, or "move", how far it
    went since the one before. `distance` is in what is usual among the others, `p_value` how often
    chance puts a regular one there."""

    sensor: str
    kind: str
    sentence: str
    distance: float
    p_value: float


def departures(history: History, *, rate: float | None = None) -> tuple[Departure, ...]:
    """The sensors of a history that left their population.

    The last good calibration of each is set against those of all others, as `find_outliers` does
    it, and its move since the one before against the moves of all others: their robust centre and
    spread, and the tail that the moves themselves show. Of the sensors named, chance has named a
    share of at most `rate` (Benjamini and Hochberg).

    Parameters
    ----------
    history : of many sensors; fewer than eight do not tell what is usual.
    rate : the false discovery rate; default: 3 %, and up to 10 % among a few dozen sensors.

    Returns them in the order of their names.

    Source: Benjamini, Hochberg, J. R. Stat. Soc. B 57 (1995) 289.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from agonic.population import Row
    >>> def row(k, bias):
    ...     return Row(sensor=f"s{k:02d}", source=f"{k}.csv", verdict="good", status="",
    ...                unit_in="nT", bias_x=bias, bias_y=0.1 * bias, bias_z=-50.0 - bias)
    >>> crowd = [row(k, 40.0 * (-1) ** k + k) for k in range(20)] + [row(20, 9000.0)]
    >>> with TemporaryDirectory() as folder, History.open(folder + "/boards.sqlite") as history:
    ...     added = history.add(crowd)
    ...     print([(one.sensor, one.kind) for one in departures(history)])
    [('s20', 'level')]
    """
    latest = history.latest()
    if len(latest) < MIN_PEERS:
        return ()
    levels = [
        Departure(o.sensor, "level", o.sentence, o.distance, o.p_value)
        for o in find_outliers(latest, rate=rate)
    ]
    return tuple(
        sorted([*levels, *find_moves(latest, history.latest(1), rate)], key=lambda d: d.sensor)
    )


def add_departures(drift: Drift, departed: Iterable[Departure]) -> Drift:
    """How a sensor moved, with what it looks like among the others added to its findings."""
    found = tuple(
        Finding(
            "left its population",
            "check",
            one.sentence,
            "look at the board, at how it was turned, and at what is near it",
        )
        for one in departed
        if one.sensor == drift.sensor
    )
    return replace(drift, findings=(*drift.findings, *found))


def find_moves(
    latest: Population, previous: Population, rate: float | None = None
) -> list[Departure]:
    """The sensors that moved unlike the others between two calibrations of each."""
    now, then = _pair(latest, previous)
    if rate is None:
        rate = choose_rate(len(now))
    found: list[Departure] = []
    for units in sorted({*zip(now["unit_in"], now["unit_out"], strict=True)}, key=str):
        same = (now["unit_in"] == units[0]) & (now["unit_out"] == units[1])
        if same.sum() >= MIN_PEERS:
            found.extend(_test_moves(now.select(same), then.select(same), rate))
    return found


def _pair(latest: Population, previous: Population) -> tuple[Population, Population]:
    """The sensors that have two calibrations which can be compared, row by row."""
    names = ("sensor", "channel", "unit_in", "unit_out")
    keys = [list(zip(*(p[name] for name in names), strict=True)) for p in (latest, previous)]
    place = {key: k for k, key in enumerate(keys[1])}
    there = [k for k, key in enumerate(keys[0]) if key in place]
    return (
        latest.select(np.array(there, dtype=int)),
        previous.select(np.array([place[keys[0][k]] for k in there], dtype=int)),
    )


def _test_moves(now: Population, then: Population, rate: float) -> list[Departure]:
    after, before = extract_parameters(now), extract_parameters(then)
    away = after.values - before.values
    sd = np.hypot(after.sd, before.sd)
    tested = [
        test
        for kind, part in _KINDS.items()
        for test in list_tests(kind, make_quantity(away[:, part], sd[:, part]))
    ]
    found = []
    for test, holds in zip(tested, discover(tested, rate), strict=True):
        off, unit = (
            test.quantity.values - test.quantity.centre,
            after.units[_KINDS[test.name].start],
        )
        for k in np.flatnonzero(holds).tolist():
            member, times = test.members[k], float(test.times[k])
            said = _describe(test.name, off[member], unit, times)
            sensor, p_value = str(now["sensor"][member]), float(test.p_values[k])
            found.append(Departure(sensor, "move", said, times, p_value))
    return found


def _describe(kind: str, off: Array, unit: str, times: float) -> str:
    worst = int(np.argmax(np.abs(off)))
    name = NAMES[_KINDS[kind].start + worst]
    size = f"{'−' if off[worst] < 0 else '+'}{figure(abs(float(off[worst])))} {unit}".rstrip()
    return (
        f"since the calibration before, its {name} moved by {size} more than that of the others, "
        f"{figure(times)} times as far as is usual"
    )


_COLUMNS = (
    "sensor",
    "channel",
    "unit_in",
    "time",
    "bias_x",
    "bias_y",
    "bias_z",
    "bias_x_sd",
    "bias_y_sd",
    "bias_z_sd",
)
_AT_ONCE = 100


def find_drifting(history: History, progress: Callable[[int, int], None] | None = None) -> set[str]:
    """The sensors whose bias drifts, as `drift` judges it, with steps not taken out. A plain line
    through the biases comes first: where it sees nothing, nothing is there."""
    columns = history.columns(*_COLUMNS)
    first, last = _find_sensors(columns)
    keep = _select_like_last(columns, first, last)
    bounds = np.concatenate([[0], np.cumsum(keep)])
    kept = {name: values[keep] for name, values in columns.items()}
    first, last = bounds[first], bounds[last]
    found: set[str] = set()
    known, done = last - first >= MIN_CALIBRATIONS, 0
    for n in np.unique((last - first)[known]):
        of_length = np.flatnonzero(last - first == n)
        for start in range(0, len(of_length), _AT_ONCE):
            rows = first[of_length[start : start + _AT_ONCE], None] + np.arange(n)
            found.update(kept["sensor"][rows[_test_drift(kept, rows), 0]])
            done += len(rows)
            if progress:
                progress(done, int(known.sum()))
    return found


def _find_sensors(columns: dict[str, NDArray[Any]]) -> tuple[Index, Index]:
    """The first row of each sensor and the one after its last."""
    names = columns["sensor"]
    starts = np.flatnonzero(np.concatenate([[True], names[1:] != names[:-1]])[: len(names)])
    return starts, np.append(starts[1:], len(names)) if len(starts) else starts


def _select_like_last(columns: dict[str, NDArray[Any]], first: Index, last: Index) -> Mask:
    """The rows of each sensor with a bias, and the channel and unit of the last."""
    of = np.repeat(last - 1, last - first)
    keep = np.ones(len(of), dtype=bool)
    for axis in "xyz":
        keep &= np.isfinite(columns[f"bias_{axis}"]) & ~np.isinf(columns[f"bias_{axis}_sd"])
    for name in ("channel", "unit_in"):
        keep &= np.asarray(columns[name] == columns[name][of], dtype=bool)
    return np.asarray(keep, dtype=bool)


def _test_drift(columns: dict[str, NDArray[Any]], rows: Index) -> Mask:
    """Which of sensors with rows (s, n) drift on one axis or another."""
    time = columns["time"][rows]
    span = time[:, -1:] - time[:, :1]
    spread = (span > 0)[:, 0]
    scaled = (time - time[:, :1]) / np.where(span > 0, span, 1.0)
    line = np.stack([np.ones_like(scaled), scaled], axis=1)
    found = np.zeros(len(rows), dtype=bool)
    for axis in "xyz":
        value = columns[f"bias_{axis}"][rows]
        value = value - value.mean(axis=1, keepdims=True)
        moves = spread & (np.ptp(value, axis=1) > 0)
        moves[moves] = _test_plain_lines(scaled[moves], value[moves]) < 0.05
        if not moves.any():
            continue
        sd = np.nan_to_num(columns[f"bias_{axis}_sd"][rows[moves]])
        series = Series(scaled[moves], value[moves], sd**2, line[moves])
        found[moves] |= compute_posterior(series).p_value(1) * len(NAMES) < MAX_DRIFT_CHANCE
    return found


def _test_plain_lines(time: Array, value: Array) -> Array:
    """p-values (s,) of the slopes of plain lines through values (s, n) about their means."""
    about = time - time.mean(axis=1, keepdims=True)
    span, free = (about**2).sum(axis=1), time.shape[1] - 2
    slope = (about * value).sum(axis=1) / span
    left = np.maximum((value**2).sum(axis=1) - slope**2 * span, 1e-300) / free
    return np.asarray(2 * stdtr(free, -np.abs(slope) / np.sqrt(left / span)))
