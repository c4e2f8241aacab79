"""Which of many sensors drift: the same estimate as for one, made for all that could."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from agonic.arrays import Array, Index, Mask
from agonic.history.fit import DRIFTING, FEWEST
from agonic.history.maths.drift_model import Series, compute_posterior
from agonic.history.parameters import NAMES
from agonic.population.store import History

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
_SCREEN = 0.05
_AT_ONCE = 100


def find_drifting(history: History, progress: Callable[[int, int], None] | None = None) -> set[str]:
    """The sensors whose bias drifts, as `drift` judges it, with steps not taken out.

    A plain line through the biases comes first: where it sees nothing, nothing is there.

    Parameters: `progress` is told how many of how many sensors are done.
    """
    columns = history.columns(*_COLUMNS)
    first, last = _find_sensors(columns)
    keep = _select_like_last(columns, first, last)
    bounds = np.concatenate([[0], np.cumsum(keep)])
    kept = {name: values[keep] for name, values in columns.items()}
    first, last = bounds[first], bounds[last]
    found: set[str] = set()
    known, done = last - first >= FEWEST, 0
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
        moves[moves] = _test_plain_lines(scaled[moves], value[moves]) < _SCREEN
        if not moves.any():
            continue
        sd = np.nan_to_num(columns[f"bias_{axis}_sd"][rows[moves]])
        series = Series(scaled[moves], value[moves], sd**2, line[moves])
        found[moves] |= compute_posterior(series).p_value(1) * len(NAMES) < DRIFTING
    return found


def _test_plain_lines(time: Array, value: Array) -> Array:
    """p-values (s,) of the slopes of plain lines through values (s, n) about their means."""
    about = time - time.mean(axis=1, keepdims=True)
    span, free = (about**2).sum(axis=1), time.shape[1] - 2
    slope = (about * value).sum(axis=1) / span
    left = np.maximum((value**2).sum(axis=1) - slope**2 * span, 1e-300) / free
    return np.asarray(2 * stdtr(free, -np.abs(slope) / np.sqrt(left / span)))
