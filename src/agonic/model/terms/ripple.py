"""A wave along the readings of an axis, as of a converter that skips codes or repeats an error."""

from __future__ import annotations

from functools import partial

import numpy as np

from agonic.arrays import Array
from agonic.model.term import Errors, Seen, Term

BINS = 4096
FEWEST_WAVES = 10
"""Waves across the readings; fewer are a bend, or errors by direction."""
FINEST = 4
"""Bins of the shortest wave."""
FINER = 4
"""Frequencies a wave: between two of them no more than a tenth of a wave's size is lost."""
ROUNDING = 0.05
"""Of a frequency: a wave so near to that of the steps of the readings is theirs."""
STANDS_OUT = 8.0
"""In log-likelihood, beyond that of all frequencies tried, before a wave is looked at."""


def find_ripple(seen: Seen, residuals: Array, bias: Array, step: float) -> Term | None:
    """The term of the waves that residuals (n,) over their noise show most along each axis.

    A wave of an axis shows by the columns `bias` (3, n) of the residuals:
    |Σ b r exp(2πi f x)|²/Σ b², for all frequencies f by a Fourier transform of sums over narrow
    bins of x, is exponential by chance. A converter's error has a mean that no wave shows, about as
    large. Rounding to a known `step` of the readings is noise.
    """
    low, width = seen.x.min(axis=0), float(np.ptp(seen.x, axis=0).max())
    if not width > 0.0:
        return None
    order = np.arange(FINER * BINS // 2 + 1) / FINER
    shows = order / width * seen.blur < 0.5  # waves: beyond, one only shows across the field
    allowed = (order >= FEWEST_WAVES) & (order <= BINS / FINEST) & shows
    if not allowed.any():
        return None
    found, powers = np.zeros(3), np.zeros(3)
    for axis, column in enumerate(bias):
        bins = np.minimum((seen.x[:, axis] - low[axis]) / width * BINS, BINS - 1).astype(np.intp)
        waves = np.fft.rfft(np.bincount(bins, column * residuals, BINS), FINER * BINS)
        power = np.where(allowed, np.abs(waves) ** 2, 0.0) / max(float(column @ column), 1e-300)
        best = int(np.argmax(power))
        found[axis], powers[axis] = order[best] / width, power[best]
    tries = np.log(3 * np.count_nonzero(allowed))
    rounds = abs(found[int(np.argmax(powers))] * step - 1.0) < ROUNDING
    if rounds or powers.max() < STANDS_OUT + tries:
        return None
    return Term(
        name="ripple",
        errors=partial(ripple, frequencies=found),
        scale=2e-3,
        source="differential non-linearity of one step of 16 bits across ± 8 G",
        what="the error of an axis repeats along its range, as with a converter that skips codes",
        move="check whether the converter skips codes; choose a finer range, or another sensor",
        odds=float(0.1 * np.exp(-tries)),
        at_rest=True,
        sideways=1.0,
    )


def ripple(seen: Seen, *, frequencies: Array) -> Errors:
    """A wave along the readings of each axis, of these frequencies (3,) over the radius.

    Noise along the field blurs it: what a foot shows is the mean over where the reading may be.
    """
    turn = 2 * np.pi * frequencies[:, None]
    kept, phase = np.exp(-((turn * seen.blur * seen.unit.T) ** 2) / 2), turn * seen.x.T
    return Errors(kept * np.stack([np.cos(phase), np.sin(phase)]))
