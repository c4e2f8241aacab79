"""Readings of before, spread over directions and temperatures: what a training must not forget."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Index
from agonic.calibration.retraining import Running, Window
from agonic.maths.equation.coverage import find_cells
from agonic.network.retraining.candidates import correct

MOST = 300
"""Readings that are kept."""
PER_VISIT = 3
"""Of a cell and a training: neighbours in time err alike, those of another day tell more."""
VISITS = 6
"""Trainings for which a reading is kept: older ones tell of another sensor."""
WIDTH_C = 10.0
"""Of a cell in temperature, °C."""


def add_rows(reservoir: Window, rows: Window, running: Running) -> Window:
    """The reservoir with some of the rows that are later, every cell with about as many."""
    last = float(reservoir.time[-1]) if len(reservoir) else -np.inf
    rows = rows.select(rows.time > last)
    if not len(rows):
        return reservoir
    seen = _count_later(_number_cells(rows, running))
    visit = np.bincount(_number_cells(rows, running))[_number_cells(rows, running)]
    stride = np.maximum(visit // PER_VISIT, 1)
    since = rows.time[-1] - VISITS * (rows.time[-1] - rows.time[0])
    reservoir = reservoir.select(reservoir.time >= since)
    whole = reservoir.with_rows(rows.select((seen % stride == 0) & (seen < PER_VISIT * stride)))
    age = _count_later(_number_cells(whole, running))
    return whole.select(np.sort(np.argsort(age, kind="stable")[:MOST]))


def _number_cells(rows: Window, running: Running) -> Index:
    """The cell of each row (k,), in no order."""
    cells = find_cells(correct(running, rows))
    if "temperature" in rows.columns:
        warmth = np.floor(rows.columns["temperature"] / WIDTH_C).astype(np.intp)
        cells = cells + 80 * (warmth - warmth.min())
    return np.unique(cells, return_inverse=True)[1].reshape(-1)


def _count_later(cells: Index) -> Index:
    """How many later rows are in the cell of each (k,)."""
    order = np.lexsort((-np.arange(len(cells)), cells))
    first = np.searchsorted(cells[order], np.arange(cells.max() + 1))
    found = np.empty(len(cells), dtype=np.intp)
    found[order] = np.arange(len(cells)) - first[cells[order]]
    return found
