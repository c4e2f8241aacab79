"""Terms of a magnitude that an instrument measured at every row: its offset and its delay."""

from __future__ import annotations

from functools import partial

import numpy as np

from agonic.arrays import Array
from agonic.maths.one_pass import median
from agonic.model.term import Errors, Seen, Term

DELAY_S = 0.1
"""Proton and Overhauser magnetometers count for 0.1 to 1 s, and stamp the begin or the end."""
_TELLS = 5.0
"""Times that the field's rate must exceed what the instrument's noise makes of it."""


def list_reference_terms(
    magnitude: Array, time: Array | None, offset_sd: float, size: float
) -> tuple[Term, ...]:
    """What the measured magnitudes of all rows may be wrong by.

    Parameters: `magnitude` (n,) over their mean `size`, nT; `time` (n,), s; `offset_sd` of an
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
                what="the scalar instrument reads too much by",
                move="compare it with another absolute instrument",
                odds=1.0,
                quantum=size,
                unit="nT",
            )
        )
    rate = None if time is None else find_rate(magnitude, time)
    if rate is not None:
        rms = float(np.sqrt(np.mean(rate**2)))
        terms.append(
            Term(
                name="scalar delay",
                errors=partial(delay, rate=rate / rms),
                scale=DELAY_S * rms,
                source="instruments that count for 0.1 to 1 s",
                what="the scalar instrument is late by",
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


def find_rate(magnitude: Array, time: Array) -> Array | None:
    """dF/dt (n,) by central differences over as many rows as the instrument was slower; None where
    it does not stand out of noise.

    >>> t = np.arange(9.0)
    >>> find_rate(5 + 2 * t, t).tolist()
    [0.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 0.0]
    >>> find_rate(np.random.default_rng(0).normal(size=99), np.arange(99.0)) is None
    True
    """
    bent = np.count_nonzero(np.abs(np.diff(magnitude, 2)) > 1e-12 * magnitude.mean())
    rows = max(round(len(magnitude) / max(bent, 1)), 1) if bent else 1
    if len(magnitude) < 4 * rows + 1:
        return None
    rate = np.zeros(len(magnitude))
    step = time[2 * rows :] - time[: -2 * rows]
    usual = median(step)
    slope = (magnitude[2 * rows :] - magnitude[: -2 * rows]) / step
    rate[rows:-rows] = np.where(step < 2 * usual, slope, 0.0)  # none across a gap
    bend = magnitude[2 * rows :] - 2 * magnitude[rows:-rows] + magnitude[: -2 * rows]
    sd = median(np.abs(bend)) / 0.6745 / np.sqrt(6)
    return rate if np.sqrt(np.mean(rate**2)) > _TELLS * np.sqrt(2) * sd / usual else None
