"""Cross-validation: base and network on blocks of time that neither has seen."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.coverage import find_cells
from agonic.network.fit.problem import Problem, compute_errors
from agonic.network.fit.result import Comparison, Errors
from agonic.network.fit.solve import correlate, train
from agonic.network.maths.blocks import number_blocks

FOLDS = 4


def cross_validate(problem: Problem, used: Index) -> Comparison:
    """Base and network made from three blocks of four, judged on the fourth, in turn.

    Parameters: `used` (k,) the rows that take part; outliers would judge luck.
    """
    number = number_blocks(len(used))
    before, after = (np.empty((len(used), problem.wanted.shape[1])) for _ in range(2))
    outputs, targets = [], []
    for fold in range(FOLDS):
        unseen = number % FOLDS == fold
        rows = used[unseen]
        made = train(problem, used[~unseen]).calibration
        field, _ = made.evaluated(problem.samples.field[rows], problem.select_columns(rows))
        based, wanted = problem.apply_base(made.base, rows), problem.wanted[rows]
        before[unseen], after[unseen] = compute_errors(based, wanted), compute_errors(field, wanted)
        outputs.append(_measure_network_part(field, based, wanted) - made.output_middle)
        targets.append(-compute_errors(based, wanted) - made.output_middle)
    middle = problem.samples.field[used].mean(axis=0)
    return Comparison(
        base=None if problem.settings.base is None else Errors(values=before),
        network=Errors(values=after),
        rows=used,
        block=number,
        cell=find_cells(problem.samples.field[used] - middle),
        regression=correlate(np.concatenate(outputs), np.concatenate(targets)),
    )


def _measure_network_part(field: Array, based: Array, wanted: Array) -> Array:
    """What the network added, likewise."""
    if wanted.shape[1] == 3:
        return field - based
    lengths = (np.linalg.norm(values, axis=1, keepdims=True) for values in (field, based))
    return np.asarray(next(lengths) - next(lengths))
