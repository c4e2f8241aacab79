"""Whether readings are in the unit that they claim, a scalar beside them too, and in steps that are
fine enough for a heading."""

from __future__ import annotations

from functools import partial, reduce

import numpy as np

from agonic.arrays import Array
from agonic.coverage import OPEN_DEG
from agonic.health.evidence import HOLDS, MOST_ROWS
from agonic.health.finding import Finding, Told, figure
from agonic.maths.one_pass import find_length, median
from agonic.samples import Samples
from agonic.units import RAW, STANDARD_GRAVITY_M_S2

LEVELS_DOUBTFUL, LEVELS_REFUSED = 30, 6
"""Levels of an axis across the field below which rounding is to be looked at, and is refused."""

_SOME_STEPS = 200


def find_quantisation(field: Array) -> float | None:
    """The step of quantised readings, in their unit; None where they are finer than noise."""
    size = float(find_steps(field).max())
    return size if size > 0 else None


def find_steps(field: Array) -> Array:
    """The smallest step between distinct readings of each axis, (3,); 0 where there is none. Every
    difference is a multiple of it, and readings repeat."""
    some = field[:: 1 + len(field) // MOST_ROWS]
    return np.array([_find_step(column) for column in some.T])


def find_rounding(field: Array) -> float:
    """What rounding to these steps scatters a reading on an axis, rms over the axes."""
    return float(np.sqrt(np.mean(find_steps(field) ** 2) / 12))


def _find_step(column: Array) -> float:
    near = 1e-9 * float(np.abs(column).max(initial=0.0))
    levels = np.sort(column)
    levels = levels[np.r_[True, np.diff(levels) > near]]  # the same to rounding of a unit
    if len(levels) < 2 or len(levels) > 0.8 * len(column):
        return 0.0
    steps = np.unique(np.diff(levels))
    common = reduce(partial(_find_divisor, least=100 * near), steps[:_SOME_STEPS].tolist())
    for size in (float(steps[0]), common):
        multiples = (levels - levels[0]) / size
        if size > 100 * near and np.abs(multiples - multiples.round()).max() < 0.1:
            return size
    return 0.0


def _find_divisor(a: float, b: float, *, least: float) -> float:
    """The greatest common divisor of two lengths, by Euclid's algorithm, above `least`."""
    while b > least:
        a, b = b, abs(a - b * round(a / b))
    return a


def check_resolution(field: Array, radius: float, unit: str) -> Finding | None:
    """Steps so coarse that few levels lie across the field, of this radius in the raw readings.
    Rounding to so few is no noise that more readings average out.
    """
    steps = find_steps(field)
    levels = 2 * radius / max(float(steps.max()), 1e-300)
    if levels >= LEVELS_DOUBTFUL:
        return None
    axes = [letter for letter, step in zip("xyz", steps, strict=True) if step == steps.max()]
    whose = f"axis {axes[0]} reads" if len(axes) == 1 else f"axes {' and '.join(axes)} read"
    by_rounding = 2 / max(levels, 1e-12) / np.sqrt(12) / np.cos(np.radians(60.0))
    open_deg = float(np.degrees(by_rounding))  # at 60° of dip
    left = f"uncertain by {figure(open_deg)}°" if open_deg < OPEN_DEG else "undetermined"
    return Finding(
        "resolution",
        "refuse" if levels < LEVELS_REFUSED else "check",
        f"{whose} in steps of {figure(float(steps.max()))} {unit}, {int(levels) + 1} across the "
        f"field: one reading leaves the heading {left}",
        "choose a finer range of the sensor, or log all the digits that it has",
    )


GAIN = (0.5, 2.0)
"""A gain outside is no error of a sensor."""
STRETCH = (1 / 3, 3.0)
"""A gain outside, for readings of the right size, is no shield's either: the fit follows noise."""
MAGNITUDES_NT = (1_000.0, 200_000.0)
"""Far outside what the Earth's field, or a coil that makes one like it, ever is."""


def check_scale(gain: float, unit: str, size: float | None = None) -> Finding | None:
    """A gain far from one where both sides are in nT: a wrong unit or a wrong reference. `size` is
    that of the readings as they are, over that of the field: where it is near one, unit and
    reference are right, and it is the fit that stretches what hardly changes.
    """
    if unit != "nT" or GAIN[0] < gain < GAIN[1]:
        return None
    what = f"readings had to be multiplied by {figure(gain)} to reach the stated field"
    move, doubtful = "check the unit of the log and the reference magnitude", True
    if size is not None and GAIN[0] < size < GAIN[1]:
        what = (
            f"the fit multiplies readings by {figure(gain)} that have the size of the stated field "
            "as they are"
        )
        move = (
            "they do not follow the attitude, or the sensor was hardly turned: check roll, pitch "
            "and heading, and turn it through all headings"
        )
        doubtful = STRETCH[0] < gain < STRETCH[1]
    return Finding("scale", "check" if doubtful else "refuse", what, move)


BARE = "no column is named for a magnetometer"
"""How a reader's note on columns x, y and z of nothing begins."""


def measure_gravity(samples: Samples, _: object) -> Told:
    """Whether x, y and z, named for no sensor, may be an accelerometer's. They are of the size of
    gravity about zero, most of them: motion disturbs the others."""
    if samples.unit != RAW or not any(note.startswith(BARE) for note in samples.notes):
        return None
    size = find_length(samples.field)
    middle = median(size)
    turned = float(np.ptp(samples.field, axis=0).max()) > middle / 4
    near = [abs(middle / one - 1) < HOLDS for one in (1.0, STANDARD_GRAVITY_M_S2)]
    if not any(near) or not turned or median(np.abs(size - middle)) > HOLDS * middle:
        return None
    return {"size": figure(middle, 3)}


def check_magnitude(
    magnitude: float | None, unit: str, gain: float | None = None
) -> Finding | None:
    """A magnitude in nT that no compass was ever in: most likely a wrong unit. A coil of any field
    can be stated, then with the `gain` of the fit; but not one that readings without a unit have
    the size of as they are.
    """
    low, high = MAGNITUDES_NT
    if magnitude is None or low < magnitude < high:
        return None
    what, move = (
        f"the field would be {magnitude:.3g} nT",
        ("check the unit of the log; where the field was made by a coil, give it with --field"),
    )
    if gain is not None:
        if unit != RAW or not GAIN[0] < gain < GAIN[1]:
            return None
        what = f"readings without a unit have the size of the stated {magnitude:.3g} nT"
        move = "both are most likely in another unit: say which one (--unit uT, unit='uT')"
    elif unit != "nT":
        return None
    return Finding("scale", "check", f"{what}, where the Earth has 20 000 to 70 000 nT", move)


STUCK_SHARE = 0.1
"""Share of the rows: one value for so long, where it else changes from row to row, is none read."""
COMPUTED_NT = 1e-3
"""A magnitude this near to that of the vector, beside both roundings, was computed from it."""


def check_scalar(samples: Samples) -> Finding | None:
    """Why the scalar column is no reading of the field's magnitude, None where it may be one."""
    scalar, size = samples.scalar, find_length(samples.field)
    assert scalar is not None
    runs = np.diff(np.flatnonzero(np.r_[True, np.diff(scalar) != 0, True]))
    rounding = float(find_steps(scalar[:, None])[0] + np.linalg.norm(find_steps(samples.field))) / 2
    first, what, move = figure(scalar[0], 6), "", ""
    if not (scalar > 0).any():
        what, move = "the scalar instrument reads nothing above zero", "it is off, or not locked"
    elif len(runs) == 1:
        what = f"the scalar instrument reads {first} nT in all {len(scalar)} rows"
        move = f"it is dead, or the number was typed in: --field {first} gives one"
    elif runs.max() > STUCK_SHARE * len(scalar) and median(runs) == 1:
        what = f"the scalar instrument repeats one value in {runs.max()} rows on end"
        move = "it lost its lock there: leave those rows out (--between), or repair it"
    elif samples.unit == "nT" and np.abs(size - scalar).max() < COMPUTED_NT + rounding:
        what = "the scalar column is the magnitude of the vector itself"
        move = "name the column of an instrument of its own"
    elif (off := _find_other_size(samples, median(scalar), size)) is not None:
        what, move = off, "check the unit in its header (F_nT, F_uT), and that it is the magnitude"
    return Finding("scale", "refuse", what, move) if what else None


def _find_other_size(samples: Samples, usual: float, size: Array) -> str | None:
    """What the scalar usually reads, where that is no field, or not that of the vector."""
    read = f"the scalar instrument reads {figure(usual, 3)} nT"
    if samples.unit != "nT":
        within = MAGNITUDES_NT[0] < usual < MAGNITUDES_NT[1]
        return None if within else f"{read}, as no place on Earth has it"
    turned = median(find_length(samples.field - samples.field.mean(axis=0)))
    middle = median(size)
    if any(GAIN[0] < one / usual < GAIN[1] for one in (middle, turned)):
        return None
    off = usual / middle
    times = f"{figure(off)} times too large" if off > 1 else f"{figure(1 / off)} times too small"
    return f"{read} where the vector reads {figure(middle, 3)} nT, {times}"
