"""What loggers do to whole numbers, each with its inverse.

An inverse takes the numbers (n,) of one axis and gives them as they were measured, NaN where a
reading is lost; or None where this cannot have happened to them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health.evidence import MIN_READINGS
from agonic.maths.one_pass import median

GROSS = 10_000
"""Times the size of most readings: beyond every range that a sensor has."""
MARKERS = (-4096.0, -32768.0, 32767.0, 65535.0, 0.0, -1.0)
"""What HMC5883L, a 16-bit register at its ends and a transfer that failed give for no reading."""
BYTE = 256
WORD = BYTE * BYTE
FILLED = 0.85
"""Of its period: a range that wraps is filled to both ends by so much at least."""
NEAR_POWER = 0.03
"""Of a power of two: a period that jumps show to be so near is that."""


class Kind(NamedTuple):
    """A fault: the word that asks for its inverse, "" where readings are lost by it; the inverse,
    and what happened, in words. Where its inverse `shifts` readings by a row, an axis that is read
    a little late is on a better ellipsoid by it too: the path alone shows the fault."""

    word: str
    undo: Callable[[Array], Array | None]
    what: str
    shifts: bool = False


def drop_gross(numbers: Array) -> Array | None:
    """Without those of a size that no sensor gives."""
    far = np.abs(numbers) > GROSS * max(median(np.abs(numbers)), 1.0)
    return np.where(far, np.nan, numbers) if far.any() else None


def drop_markers(numbers: Array) -> Array | None:
    """Without known markers, and without the number at an end of their range that stands alone."""
    levels = np.unique(numbers)
    if len(levels) < MIN_READINGS:
        return None
    reach = levels[-2] - levels[1]
    ends = (levels[0], levels[1] - levels[0]), (levels[-1], levels[-1] - levels[-2])
    alone = [level for level, gap in ends if gap > reach / 2]
    marked = np.isin(numbers, [*MARKERS, *alone])
    return np.where(marked, np.nan, numbers) if marked.any() else None


def sign(numbers: Array) -> Array | None:
    """Sixteen bits with a sign that were printed without."""
    high = numbers >= WORD // 2
    possible = numbers.min() >= 0 and numbers.max() < WORD and high.any()
    return numbers - WORD * high if possible else None


def unwrap(numbers: Array) -> Array | None:
    """Numbers that go on at the other end of their range; their middle near zero."""
    steps, reach = np.diff(numbers), float(np.ptp(numbers))
    jumps = np.abs(steps) > reach / 2
    beside = (np.r_[0.0, steps[:-1]] + np.r_[steps[1:], 0.0]) / 2
    own = jumps & (np.abs(beside) < reach / 4)  # a spike goes there and back
    if not own.any() or reach < BYTE / 2:
        return None
    period = median(np.abs(steps - beside)[own])
    power = float(2.0 ** np.round(np.log2(period)))
    if abs(period / power - 1) < NEAR_POWER:
        period = power
    between = (np.abs(steps) > period / 4) & (np.abs(steps) < 3 * period / 4)
    if not FILLED * period < reach < 1.01 * period or between.sum() > jumps.sum() / 4:
        return None
    whole = np.unwrap(numbers, period=period)
    return np.asarray(whole - period * np.round((whole.max() + whole.min()) / 2 / period))


def exchange_bytes(numbers: Array) -> Array | None:
    """Sixteen bits with a sign whose bytes were exchanged."""
    if numbers.min() < -WORD // 2 or numbers.max() >= WORD:
        return None
    high, low = np.divmod(numbers % WORD, BYTE)
    exchanged = low * BYTE + high
    return np.asarray(exchanged - WORD * (exchanged >= WORD // 2))


def drop_extended(numbers: Array) -> Array | None:
    """Without those that a low byte with a sign made −128 to −1; others have one below 128."""
    lost = (numbers >= -BYTE // 2) & (numbers < 0)
    others = numbers[~lost]
    possible = lost.sum() >= MIN_READINGS and (np.abs(others) > BYTE).sum() >= MIN_READINGS
    if not possible or (others % BYTE >= BYTE // 2).any():
        return None
    return np.where(lost, np.nan, numbers)


def advance(numbers: Array, *, low_byte: bool) -> Array | None:
    """Numbers with the low, or high, byte of the one before; that of the last is not known."""
    low = numbers % BYTE
    high = numbers - low
    return np.append(high[:-1] + low[1:] if low_byte else high[1:] + low[:-1], np.nan)


KINDS = (
    Kind("", drop_gross, f"over {GROSS} times as large as most, which no sensor gives"),
    Kind("int16", sign, "signed numbers were printed as unsigned"),
    Kind("swapped", exchange_bytes, "the two bytes of each number were exchanged"),
    Kind(
        "carried", lambda n: n + BYTE * (n % BYTE >= BYTE // 2), "the low byte was read as signed"
    ),
    Kind(
        "",
        drop_extended,
        "readings of which the sign of the low byte was extended over the high byte",
    ),
    Kind(
        "advanced",
        partial(advance, low_byte=True),
        "the low byte is that of the reading before",
        True,
    ),
    Kind(
        "caught-up",
        partial(advance, low_byte=False),
        "the high byte is that of the reading before",
        True,
    ),
    Kind("unwrapped", unwrap, "numbers wrap at the end of their range, or were cut to fewer bits"),
    Kind("", drop_markers, "a marker that stands for no reading"),
)
"""The first of those that explain the readings equally well is taken."""
WORDS = tuple(kind.word for kind in KINDS if kind.word)
"""What `--as` takes: how the numbers of a log are to be read."""
