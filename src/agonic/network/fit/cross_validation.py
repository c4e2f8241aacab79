"""Base and network on blocks of time that neither has seen."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.coverage import cells_of
from agonic.network.fit.problem import Task
from agonic.network.fit.result import Comparison, Errors
from agonic.network.fit.solve import blocks, correlation, trained

FOLDS = 4


def compare(task: Task, believed: Index) -> Comparison:
    """Base and network made from three blocks of four, judged on the fourth, in turn.

    Parameters: `believed` the rows (k,) that take part; strays would judge luck.
    """
    number = blocks(len(believed))
    before, after = (np.empty((len(believed), task.wanted.shape[1])) for _ in range(2))
    outputs, targets = [], []
    for fold in range(FOLDS):
        unseen = number % FOLDS == fold
        rows = believed[unseen]
        made = trained(task, believed[~unseen]).calibration
        field, _ = made.evaluated(task.samples.field[rows], task.beside(rows))
        based, wanted = task.based(made.base, rows), task.wanted[rows]
        before[unseen], after[unseen] = _error(based, wanted), _error(field, wanted)
        outputs.append(_added(field, based, wanted) - made.output_middle)
        targets.append(_taught(wanted, based) - made.output_middle)
    middle = task.samples.field[believed].mean(axis=0)
    return Comparison(
        base=None if task.settings.base is None else Errors(values=before),
        network=Errors(values=after),
        rows=believed,
        block=number,
        cell=cells_of(task.samples.field[believed] - middle),
        regression=correlation(np.concatenate(outputs), np.concatenate(targets)),
    )


def _error(field: Array, wanted: Array) -> Array:
    """How far fields (n, 3) are from vectors (n, 3), or from magnitudes (n, 1)."""
    if wanted.shape[1] == 3:
        return field - wanted
    return np.asarray(np.linalg.norm(field, axis=1, keepdims=True) - wanted)


def _taught(wanted: Array, based: Array) -> Array:
    """What the base leaves to the network: (n, 3), or (n, 1) of the magnitude."""
    return -_error(based, wanted)


def _added(field: Array, based: Array, wanted: Array) -> Array:
    """What the network added, likewise."""
    if wanted.shape[1] == 3:
        return field - based
    lengths = (np.linalg.norm(values, axis=1, keepdims=True) for values in (field, based))
    return np.asarray(next(lengths) - next(lengths))
