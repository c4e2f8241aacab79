"""Whether readings are in the unit that they claim, a scalar beside them too, and in steps that are
fine enough for a heading."""

from __future__ import annotations

from functools import partial, reduce

import numpy as np

from agonic.arrays import Array
from agonic.coverage import OPEN_DEG
from agonic.health.evidence import FITTING_NOISE, MOST_ROWS
from agonic.health.finding import Fact, Finding, Limit, Told, figure, find_first
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
    return find_first([RESOLUTION], field, radius, unit)


def _count_levels(field: Array, radius: float, unit: str) -> Told:
    steps = find_steps(field)
    levels = 2 * radius / max(float(steps.max()), 1e-300)
    axes = [letter for letter, step in zip("xyz", steps, strict=True) if step == steps.max()]
    by_rounding = 2 / max(levels, 1e-12) / np.sqrt(12) / np.cos(np.radians(60.0))
    open_deg = float(np.degrees(by_rounding))  # at 60° of dip
    return {
        "value": -levels,
        "whose": f"axis {axes[0]} reads" if len(axes) == 1 else f"axes {' and '.join(axes)} read",
        "step": float(steps.max()),
        "unit": unit,
        "levels": int(min(levels, LEVELS_DOUBTFUL)) + 1,
        "left": f"uncertain by {figure(open_deg)}°" if open_deg < OPEN_DEG else "undetermined",
    }


RESOLUTION = Fact(
    "resolution",
    _count_levels,
    Limit(-LEVELS_DOUBTFUL, -LEVELS_REFUSED),
    "{whose} in steps of {step} {unit}, {levels} across the field: one reading leaves the heading "
    "{left}",
    "choose a finer range of the sensor, or log all the digits that it has",
)

GAIN = (0.5, 2.0)
"""A gain outside is no error of a sensor."""
STRETCH = 3.0
"""A gain larger or smaller by more, for readings of the right size, is no shield's either: the fit
follows noise."""
MAGNITUDES_NT = (1_000.0, 200_000.0)
"""Far outside what the Earth's field, or a coil that makes one like it, ever is."""


def check_scale(gain: float, unit: str, size: float | None = None) -> Finding | None:
    """A gain far from one where both sides are in nT: a wrong unit or a wrong reference. `size` is
    that of the readings as they are, over that of the field: where it is near one, unit and
    reference are right, and it is the fit that stretches what hardly changes.
    """
    if unit != "nT" or GAIN[0] < gain < GAIN[1]:
        return None
    return find_first(STRETCHED, gain, size is not None and GAIN[0] < size < GAIN[1])


STRETCHED = (
    Fact(
        "scale",
        lambda gain, right: None if right else {"gain": gain},
        "check",
        "readings had to be multiplied by {gain} to reach the stated field",
        "check the unit of the log and the reference magnitude",
    ),
    Fact(
        "scale",
        lambda gain, _: {"value": abs(np.log(gain)) if gain > 0 else np.inf, "gain": gain},
        Limit(0.0, np.log(STRETCH)),
        "the fit multiplies readings by {gain} that have the size of the stated field as they are",
        "they do not follow the attitude, or the sensor was hardly turned: check roll, pitch and "
        "heading, and turn it through all headings",
    ),
)
"""Of a gain far from one, and whether the readings have the size of the field as they are."""


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
    near = [abs(middle / one - 1) < FITTING_NOISE for one in (1.0, STANDARD_GRAVITY_M_S2)]
    if not any(near) or not turned or median(np.abs(size - middle)) > FITTING_NOISE * middle:
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
    return find_first(NO_FIELD, f"{magnitude:.3g}", unit, gain)


def _is_without_unit(unit: str, gain: float | None) -> bool:
    return unit == RAW and gain is not None and GAIN[0] < gain < GAIN[1]


NO_FIELD = (
    Fact(
        "scale",
        lambda size, unit, gain: {"size": size} if gain is None and unit == "nT" else None,
        "check",
        "the field would be {size} nT, where the Earth has 20 000 to 70 000 nT",
        "check the unit of the log; where the field was made by a coil, give it with --field",
    ),
    Fact(
        "scale",
        lambda size, unit, gain: {"size": size} if _is_without_unit(unit, gain) else None,
        "check",
        "readings without a unit have the size of the stated {size} nT, where the Earth has 20 000 "
        "to 70 000 nT",
        "both are most likely in another unit: say which one (--unit uT, unit='uT')",
    ),
)
"""Of a magnitude that no compass was ever in, the unit of the readings, and a stated field's gain.
"""


STUCK_SHARE = 0.1
"""Share of the rows: one value for so long, where it else changes from row to row, is none read."""
COMPUTED_NT = 1e-3
"""A magnitude this near to that of the vector, beside both roundings, was computed from it."""


def check_scalar(samples: Samples) -> Finding | None:
    """Why the scalar column is no reading of the field's magnitude, None where it may be one."""
    scalar, size = samples.scalar, find_length(samples.field)
    return find_first(NO_SCALAR, samples, scalar, size)


def _measure_constant(samples: Samples, scalar: Array, _: Array) -> Told:
    if np.any(scalar != scalar[0]):
        return None
    return {"first": figure(scalar[0], 6), "count": len(scalar)}


def _measure_lost_lock(samples: Samples, scalar: Array, _: Array) -> Told:
    runs = np.diff(np.flatnonzero(np.r_[True, np.diff(scalar) != 0, True]))
    lost = runs.max() > STUCK_SHARE * len(scalar) and median(runs) == 1
    return {"count": int(runs.max())} if lost else None


def _measure_computed(samples: Samples, scalar: Array, size: Array) -> Told:
    rounding = float(find_steps(scalar[:, None])[0] + np.linalg.norm(find_steps(samples.field))) / 2
    near = np.abs(size - scalar).max() < COMPUTED_NT + rounding
    return {} if samples.unit == "nT" and near else None


def _measure_other_size(samples: Samples, scalar: Array, size: Array) -> Told:
    """What the scalar usually reads, where that is no field, or not that of the vector."""
    usual = median(scalar)
    told = {"usual": figure(usual, 3)}
    if samples.unit != "nT":
        within = MAGNITUDES_NT[0] < usual < MAGNITUDES_NT[1]
        return None if within else {**told, "beside": ", as no place on Earth has it"}
    turned = median(find_length(samples.field - samples.field.mean(axis=0)))
    middle = median(size)
    if any(GAIN[0] < one / usual < GAIN[1] for one in (middle, turned)):
        return None
    off = usual / middle
    times = f"{figure(off)} times too large" if off > 1 else f"{figure(1 / off)} times too small"
    return {**told, "beside": f" where the vector reads {figure(middle, 3)} nT, {times}"}


NO_SCALAR = tuple(
    Fact("scale", measure, "refuse", what, move)
    for measure, what, move in (
        (
            lambda _, scalar, __: None if (scalar > 0).any() else {},
            "the scalar instrument reads nothing above zero",
            "it is off, or not locked",
        ),
        (
            _measure_constant,
            "the scalar instrument reads {first} nT in all {count} rows",
            "it is dead, or the number was typed in: --field {first} gives one",
        ),
        (
            _measure_lost_lock,
            "the scalar instrument repeats one value in {count} rows on end",
            "it lost its lock there: leave those rows out (--between), or repair it",
        ),
        (
            _measure_computed,
            "the scalar column is the magnitude of the vector itself",
            "name the column of an instrument of its own",
        ),
        (
            _measure_other_size,
            "the scalar instrument reads {usual} nT{beside}",
            "check the unit in its header (F_nT, F_uT), and that it is the magnitude",
        ),
    )
)
"""Of samples, their scalar column (n,), and the size (n,) of their vectors: why it is none."""
