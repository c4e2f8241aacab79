"""Terms of a magnitude that an instrument measured at every row: its offset and its delay."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.filters.whittaker import FEWEST, Smoothed, smooth
from agonic.maths.one_pass import median
from agonic.model.term import Errors, Seen, Term

DELAY_S = 0.1
"""Proton and Overhauser magnetometers count for 0.1 to 1 s, and stamp the begin or the end."""
_SEEN = 3.0
"""Times that the course must exceed what noise leaves in it."""
_GAP = 3.0
"""Usual steps of time: what lies farther apart is smoothed apart."""


def list_reference_terms(rate: Array | None, offset_sd: float, size: float) -> tuple[Term, ...]:
    """What the measured magnitudes of all rows may be wrong by.

    Parameters: `rate` (n,) of the magnitudes over their mean `size`, nT, 1/s; `offset_sd` of an
    offset of the instrument over the mean, the prior of which is Gaussian.
    """
    terms = []
    if offset_sd > 0.0:
        terms.append(
            Term(
                name="scalar offset",
                errors=offset,
                scale=offset_sd,
                source="the stated error of the reference",
                what="the offset of the scalar instrument is",
                move="compare it with another absolute instrument",
                odds=1.0,
                quantum=size,
                unit="nT",
            )
        )
    if rate is not None:
        rms = float(np.sqrt(np.mean(rate**2)))
        terms.append(
            Term(
                name="scalar delay",
                errors=partial(delay, rate=rate / rms),
                scale=DELAY_S * rms,
                source="instruments that count for 0.1 to 1 s",
                what="the delay of the scalar instrument is",
                move="correct its time tags",
                odds=0.3,
                quantum=1e3 / rms,
                unit="ms",
            )
        )
    return tuple(terms)


def offset(seen: Seen) -> Errors:
    """A magnitude that is too large by one is a reading that is too short by one."""
    return Errors(-seen.unit.T[None], apart=False)


def delay(seen: Seen, *, rate: Array) -> Errors:
    """A late magnitude lacks what the field has changed by: F(t − τ) = F − τ dF/dt."""
    return Errors((rate[seen.rows] * seen.unit.T)[None], apart=False)


class Course(NamedTuple):
    """Measured magnitudes (n,) without the instrument's noise, the standard deviation of that, and
    dF/dt (n,) where times are known."""

    values: Array
    noise: float
    rate: Array | None


def follow_magnitude(magnitude: Array, time: Array | None) -> Course:
    """The course of magnitudes that were measured at every row, between gaps as smooth as they
    allow; their mean where nothing but noise is seen of a course.

    Noise that stays in them is in the columns of terms and in what terms explain: gain, offset and
    saturation differ by the course alone, and would fit it."""
    t = np.arange(float(len(magnitude))) if time is None else time
    steps = np.diff(t)
    gaps = np.flatnonzero(steps > _GAP * median(steps)) + 1
    parts = [_smooth(part) for part in np.split(magnitude, gaps)]
    values = np.concatenate([part.values for part in parts])
    left = float(np.mean(np.concatenate([np.full(len(p.values), p.freedom) for p in parts])))
    noise = float(np.std(magnitude - values) / np.sqrt(max(1.0 - left, 1.0 / len(t))))
    if np.std(values) < _SEEN * np.sqrt(left) * noise:
        return Course(np.full(len(t), magnitude.mean()), float(magnitude.std()), None)
    slopes = [
        np.gradient(part.values, one) if len(one) > 1 else np.zeros(1)
        for part, one in zip(parts, np.split(t, gaps), strict=True)
    ]
    return Course(values, noise, None if time is None else np.concatenate(slopes))


def _smooth(part: Array) -> Smoothed:
    return smooth(part) if len(part) >= FEWEST else Smoothed(part, 1.0)
