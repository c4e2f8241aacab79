"""What disturbs on board as a section: what was tried, what it is good for, and what it moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.attitude.disturbers.choice import POWER, Trial
from agonic.attitude.problem import find_terms
from agonic.calibration.interference import Interference
from agonic.calibration.sources import name_sources
from agonic.model.gram import BLOCKS
from agonic.recording.calibrated import Calibrated
from agonic.report import tables
from agonic.report.digits import percent, quantity, with_sd
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table

TITLE = "What disturbs"
TRIED = ("Sources", "Signals", "Less left of unseen squares")
MOVED = ("Source", "Range", "Moves the field by", "Share of its size")


def describe_disturbers(result: Calibrated) -> list[Section]:
    """The section; none where the log holds nothing that could disturb."""
    if result.disturbers is None or not result.disturbers.trials:
        return []
    blocks: list[Any] = [Table(TRIED, list(map(_list_cells, _list_best(result))), style="numbers")]
    if isinstance(result.fit.calibration, Interference):
        blocks.append(Table(MOVED, _list_moves(result), style="numbers"))
    shapes = [element("p", f"{one.describe()}.") for one in result.disturbers.shapes]
    return [Section(TITLE, [*blocks, *shapes, _explain()])]


def list_trials(result: Calibrated) -> list[dict[str, Any]]:
    """What was tried, for programs."""
    return [one._asdict() for one in (result.disturbers.trials if result.disturbers else ())]


def measure_moves(result: Calibrated) -> dict[str, float]:
    """By how much the usual changes of each source move the field, nT: from 5 to 95 %."""
    calibration = result.fit.calibration
    assert isinstance(calibration, Interference)
    moves: dict[str, float] = {}
    added = calibration.matrix @ calibration.coefficients
    at = 0
    for source in calibration.sources:
        x = find_terms(result.samples, (source,))
        width = x.shape[1]
        moves[source] = _find_range(x @ added[:, at : at + width].T)
        at += width
    return moves


def _find_range(moved: Array) -> float:
    low, high = np.percentile(moved, (5, 95), axis=0)
    return float(np.linalg.norm(high - low))


def _list_best(result: Calibrated) -> list[Trial]:
    """What was taken, in its order, and of the rest what the first comparison says."""
    assert result.disturbers is not None
    trials = result.disturbers.trials
    first = {one.sources: one for one in reversed(trials)}
    taken = [one for one in trials if one.taken]
    rest = [one for one in first.values() if one.sources not in {t.sources for t in taken}]
    return [*taken, *sorted(rest, key=lambda one: -one.gain)]


def _list_cells(one: Trial) -> list[str]:
    return [
        ("✓ " if one.taken else "") + name_sources(one.sources),
        str(len(one.sources)),
        f"{with_sd(100 * one.gain, 100 * one.gain_sd)} %",
    ]


def _list_moves(result: Calibrated) -> list[list[str]]:
    calibration = result.fit.calibration
    unit = unit_label(calibration.unit_out)
    rows = []
    for source, moved in measure_moves(result).items():
        x = find_terms(result.samples, (source,))
        ends = f"{x.min():.3g} … {x.max():.3g}"
        share = percent(moved / calibration.magnitude) if calibration.magnitude else tables.NOTHING
        rows.append([source, ends, quantity(moved, unit, 2), share])
    return rows


def _explain() -> Markup:
    return element(
        "p",
        f"The log was cut into {BLOCKS} blocks of time; the last column is what a fit to the "
        "other blocks leaves less of a block with the sources than without. That set is taken "
        "which explains most of the residuals, beside drifts and whatever else may cause them; a "
        f"second that is taken, beside the first. A duty counts to the power {POWER:g}, as a "
        "motor’s current, unless another power, a delay or a filter is surely likelier.",
        class_="aside",
    )
