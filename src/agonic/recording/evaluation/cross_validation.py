"""`evaluate`: found against stated errors on blocks of time that a calibration has not seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Index
from agonic.attitude.undo_latency import advance
from agonic.calibration.base import correct_field
from agonic.health import Finding, Verdict, figure, verdict_of
from agonic.logs.any_form import Given, as_samples
from agonic.new_rows import interpolate_repeated
from agonic.readable import Shown
from agonic.recording.calibrated import Calibrated, calibrate_as_named, calibrate_whole
from agonic.recording.choice.choose import Kind
from agonic.recording.evaluation.errors import (
    HEADING,
    UNITS,
    Known,
    find_known,
    measure_errors,
    state_errors,
)
from agonic.recording.parts import cut_blocks
from agonic.reference import Reference
from agonic.samples import Samples

HONEST = 1.5
"""Times the stated error up to which a found one is what was stated."""
WORSE = 1.1
"""Times the error of the readings as recorded above which a calibration makes them worse."""


class Prediction(NamedTuple):
    """The field (n, 3) of unseen rows by a fit to others, and the errors that it states of it;
    `refused` where the fit was refused."""

    field: Array
    stated: Mapping[str, float] = {}
    refused: bool = False


Predict = Callable[[Index, Index], Prediction]
"""Predicts the field at the second rows of a log by a fit to the first."""


class Errors(NamedTuple):
    """Of one kind: the errors (n,) of all rows, each by a fit that had not seen it, and what that
    fit stated (n,), NaN where nothing was."""

    found: Array
    stated: Array

    def select(self, rows: Index) -> tuple[float, float]:
        """The rms of both over some rows."""
        found, stated = (float(np.sqrt(np.mean(one[rows] ** 2))) for one in self)
        return found, stated


class Unseen(NamedTuple):
    """Errors by their kind, the block of time of each row (n,), and what was refused of it."""

    errors: dict[str, Errors]
    block: Index
    refused: Index


def cross_validate(samples: Samples, known: Known, predict: Predict) -> Unseen:
    """The errors of every row by a fit that had not seen it. The log is cut into eight blocks of
    time of equal information; the even ones are judged by a fit to the odd ones, and the reverse.
    Source: blocks, not rows, are held out, because correlated errors are the same in neighbouring
    rows (Burman, Chow & Nolan 1994)."""
    block, _ = cut_blocks(samples)
    refused, errors = np.zeros(len(samples), dtype=np.intp), dict[str, Errors]()
    for odd in (True, False):
        fitted, judged = (np.flatnonzero((block % 2 == 1) == side) for side in (odd, not odd))
        made = predict(fitted, judged)
        refused[judged] = made.refused
        for kind, found in measure_errors(made.field, known.select(judged)).items():
            both = errors.setdefault(kind, Errors(*np.full((2, len(samples)), np.nan)))
            both.found[judged], both.stated[judged] = found, made.stated.get(kind, np.nan)
    return Unseen(errors, block, refused)


def predict_as_recorded(samples: Samples) -> Predict:
    """Predicts the readings as the device or the vehicle had them."""
    field, logged = samples.field, samples.logged
    if logged is not None:
        field = (field - logged.bias) @ logged.matrix.T
    return lambda _, unseen: Prediction(field[unseen])


def predict_by_choice(
    samples: Samples,
    reference: Reference | None,
    known: Known,
    kind: Kind = "auto",
    **settings: Any,
) -> Predict:
    """Predicts by the calibration that all fitted rows allow: one of a stretch of them, between two
    changes of the field, says nothing of the others."""

    def predict(fitted: Index, unseen: Index) -> Prediction:
        part = None if reference is None else reference.select(fitted)
        made = calibrate_whole(interpolate_repeated(samples.select(fitted)), part, kind, settings)
        judged, calibration = samples.select(unseen), made.fit.calibration
        field = advance(correct_field(calibration, samples), samples, calibration)[unseen]
        stated = state_errors(made, judged, field, known.select(unseen))
        return Prediction(field, stated, made.verdict == "refused")

    return predict


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One kind of error over the whole log: rms as `found` on unseen rows, as `stated` by the fits,
    and of the readings as `recorded`, in `unit`."""

    kind: Annotated[str, Shown("Error, rms")]
    unit: Annotated[str, Shown()]
    recorded: Annotated[float, Shown("as recorded", "{unit}")]
    found: Annotated[float, Shown("found", "{unit}")]
    stated: Annotated[float, Shown("stated", "{unit}")]


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """A calibration of a log judged on rows that its fits had not seen.

    `calibrated` is that of the whole log; `unseen` the errors row by row, `recorded` those of the
    readings as recorded; `measures` one of each kind, the most telling first; `findings` what they
    tell; `truth` what the heading was compared with, or "".
    """

    calibrated: Calibrated
    samples: Samples
    unseen: Unseen
    recorded: Unseen
    measures: tuple[Measure, ...]
    findings: tuple[Finding, ...]
    truth: str = ""

    @property
    def verdict(self) -> Verdict:
        """The gravest of the calibration's own verdict and what was found on unseen rows."""
        own = self.calibrated.verdict
        if own == "refused":
            return "refused"
        return verdict_of(self.findings, failed=own == "check")


def evaluate(
    samples: Given,
    reference: Reference | ArrayLike | None = None,
    *,
    truth: Samples | None = None,
    unit: str | None = None,
    kind: Kind = "auto",
    **settings: Any,
) -> Evaluation:
    """Judge the calibration of a log, and its headings, on blocks of time that it has not seen.

    Found errors stand beside those that the fits state: of the heading where the log, or `truth`,
    knows an independent one (which the fits are not shown), of the dip where roll and pitch and the
    field of the place are known, of the magnitude always.

    Parameters
    ----------
    samples, unit, kind, settings : as in `calibrate`. reference : (n,) or constant, as there.
    truth : attitude and heading at the same rows, from something better than the log's own.

    Raises `CoverageError` where nothing can be fitted at all.

    >>> from agonic.simulation import simulate
    >>> evaluate(simulate("tumble").samples, 50_000.0).verdict
    'good'
    """
    meant, reference = as_samples(samples, unit), Reference.of(reference, unit)
    known = find_known(meant, reference, truth)
    judged = kind != "vector" and known.heading_deg is not None
    shown = meant.with_columns(heading_deg=None) if judged else meant

    own = predict_by_choice(shown, reference, known, kind, **settings)
    unseen = cross_validate(shown, known, own)
    recorded = cross_validate(shown, known, predict_as_recorded(shown))
    measures, every = [], np.arange(len(meant))
    for one in (one for one in UNITS if one in unseen.errors):
        found, stated = unseen.errors[one].select(every)
        as_recorded, _ = recorded.errors[one].select(every)
        measures.append(
            Measure(kind=one, unit=UNITS[one], found=found, stated=stated, recorded=as_recorded)
        )
    calibrated = calibrate_as_named(shown, reference, kind=kind, **settings)
    beside = "the log's own heading" if truth is None else "the heading that was given"
    if truth is not None and truth.source is not None:
        beside = truth.source.name
    return Evaluation(
        calibrated=calibrated,
        samples=meant,
        unseen=unseen,
        recorded=recorded,
        measures=tuple(measures),
        findings=tuple(f for one in measures for f in judge_measure(one)),
        truth=beside if HEADING in unseen.errors else "",
    )


def judge_measure(one: Measure) -> list[Finding]:
    """What a measure tells: an error that was stated too small, readings that were made worse."""
    off = f"on unseen parts of the log the {one.kind} is off by {figure(one.found)}{one.unit} rms"
    told = []
    if one.found > HONEST * one.stated:
        what = f"{off}, where the fits state {figure(one.stated)}{one.unit}"
        move = "look at the parts of the log that differ; trust the found error, not the stated"
        told.append(Finding("stated too small", "check", what, move))
    if one.kind == HEADING and one.found > WORSE * one.recorded:
        what = f"{off}, and by {figure(one.recorded)}{one.unit} without this calibration"
        move = "record a longer log that turns through all directions, away from steel"
        told.append(Finding("worse than recorded", "check", what, move))
    return told
