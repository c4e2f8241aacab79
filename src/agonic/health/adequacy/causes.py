"""`list_causes`: every cause that can be written as an error of the readings, with its columns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import reduce
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health.adequacy.fitted import ResidualsAtFeet, Work, level_readings
from agonic.health.adequacy.ripples import find_ripples
from agonic.maths.equation import unmodelled
from agonic.maths.estimation.inference.linearised import Linearised

TURNS_SHOWN = 0.5
"""Of what goes with how fast a vehicle turns: about so much directions of the field tell, which do
not see how it turns about the field."""
LIKELY = 0.2
"""Of the field: a sensor bends by less at the size of the field, and what goes with bank or pitch
is less for a vehicle turned by a right angle."""
DRIFTS = 0.05
"""Of the field: by so much at most, about, a bias drifts in a log; what a log hardly tells from a
current, or from its bias before it turned, would else be of any size."""
UNEVEN = 0.03
"""Of the reading: by so much gains may differ between positive and negative readings."""


class Cause(NamedTuple):
    """A cause: its columns over unit noise, what noise does to them and has in common with the
    residuals, and the error itself.

    `at_rest` is false for an error that only a turning sensor has, `alone` true for a test with a
    level of its own, beside the family of all others; `likely` how large its terms are at most,
    about, as a share of the field; `trials` among how many of its kind it was picked; `told` what
    share of its size the columns tell.
    """

    name: str
    columns: Array
    noise: Array | None
    shared: Array | None
    error: Callable[[Array], Array]
    level: Callable[[Array], Array] | None
    at_rest: bool
    alone: bool
    likely: float
    trials: int
    told: float

    def seen_by(self, fit: Linearised) -> tuple[Array, Array | None, Array | None]:
        """Columns, their noise and what they share, of a fit to all kinds or the magnitude alone,
        which comes first."""
        n = len(fit.residuals)
        noise = None if self.noise is None else self.noise[:n]
        return self.columns[:n], noise, self.shared if fit.shared is not None else None


def list_causes(work: Work) -> Iterator[Cause]:
    """Every cause that can be written as an error of the readings."""
    n, rows, time = len(work.fitted.readings), work.rows, work.fitted.time
    t = (rows + 0.5) / n if time is None else (time[rows] - time[0]) / max(np.ptp(time), 1e-9)
    centre = work.fitted.calibration.bias / work.radius
    apart = np.r_[True, np.diff(rows) != 1]
    yield _make_cause(work, "non-linear", unmodelled.non_linearity, static=True, likely=LIKELY)
    yield _make_cause(work, "non-linear", unmodelled.gain_by_sign, static=True, likely=UNEVEN)
    by_magnitude = work.fitted.look is None
    if by_magnitude:  # six unknowns hide a small bend among chance; what all axes share is one
        yield _make_cause(
            work, "non-linear", unmodelled.common_bend, static=True, alone=True, likely=LIKELY
        )
        yield _make_cause(work, "non-linear", unmodelled.cross_talk, static=True, likely=LIKELY)
    yield _make_cause(
        work, "compressed", unmodelled.compression, static=True, alone=by_magnitude, likely=LIKELY
    )
    ripples = find_ripples(work)
    if ripples is not None:
        yield _make_cause(
            work,
            "non-linear",
            lambda x: unmodelled.ripples(x, ripples.frequencies),
            static=True,
            moved=False,
            likely=LIKELY,
            trials=ripples.trials,
        )
    yield _make_cause(
        work,
        "follows turns",
        lambda x: unmodelled.turning(x - centre, apart),
        at_rest=False,
        likely=LIKELY,
        told=TURNS_SHOWN,
    )
    yield _make_cause(work, "late", lambda x: unmodelled.lag(x, apart), at_rest=False)
    yield _make_cause(work, "memory", lambda x: unmodelled.memory(x - centre))
    yield _make_cause(
        work, "bias drift", lambda x: unmodelled.drift(t, 1), moved=False, likely=DRIFTS
    )
    yield _make_cause(
        work, "bias drift", lambda x: unmodelled.drift(t, 4), moved=False, likely=DRIFTS
    )
    yield _make_cause(work, "gain drift", lambda x: unmodelled.gain_drift(x - centre, t))
    yield _make_cause(work, "alternating", lambda x: unmodelled.alternation(rows), moved=False)
    for name in work.seen.signals:
        yield _make_cause(work, name, moved=False, at_rest=False, likely=LIKELY)


def _make_cause(
    work: Work,
    name: str,
    terms: unmodelled.Terms | None = None,
    *,
    static: bool = False,
    moved: bool = True,
    at_rest: bool = True,
    alone: bool = False,
    likely: float = np.inf,
    trials: int = 1,
    told: float = 1.0,
) -> Cause:
    """A cause from its terms at the feet, or a bias that goes with the signals of that name.

    `static` where the terms are a function of one reading, `moved` where its noise enters them.
    """

    def errors_at(feet: Array, signals: Mapping[str, Array]) -> unmodelled.Errors:
        return unmodelled.proportional(signals[name]) if terms is None else terms(feet)

    errors, compared = errors_at(work.seen.feet, work.seen.signals), work.fitted.look is not None
    columns = errors.show(work.seen.by_reading)

    def change(again: ResidualsAtFeet) -> Array:
        same = terms is not None and again.feet is work.seen.feet
        moved = errors if same else errors_at(again.feet, again.signals)
        return moved.show(again.by_reading) - columns

    changes = [change(again) for again in work.again] if moved or compared else []
    noise = np.sum(changes, axis=0) if moved else None
    shared = None
    if compared:
        moves = [(again.residuals - work.seen.residuals)[:, None] for again in work.again]
        shared = reduce(np.add, map(np.multiply, changes, moves))

    def error(size: Array) -> Array:
        return errors_at(work.feet, work.seen.signals).add_up(size) * work.radius

    def level(size: Array) -> Array:
        return errors_at(level_readings(work) / work.radius, {}).add_up(size) * work.radius

    at = level if static else None
    return Cause(name, columns, noise, shared, error, at, at_rest, alone, likely, trials, told)
