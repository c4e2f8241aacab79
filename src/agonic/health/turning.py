"""Whether magnetometer, gyro and accelerometer turn together, and what would make them.

A field that stands still turns in the sensor by dv/dt = (v − b) × ω, whatever the calibration does
to its length, and so does gravity in the accelerometer. With the axes of the gyro renamed, or its
unit another one, the same holds for s T ω; so every renaming T and unit s is tried, the bias b free
in each. Of three sensors, the one that goes with neither of the others is the wrong one.
"""

from __future__ import annotations

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from agonic.arrays import Array
from agonic.health.finding import Fact, Finding, Told, figure, find_first
from agonic.maths.one_pass import median
from agonic.maths.rotations.namings import compare_namings
from agonic.maths.rotations.right_angles import describe_renaming, right_angles
from agonic.maths.rotations.turning import measure_left, sum_products
from agonic.samples import Samples

FAR_BETTER = 0.25
"""Of the square that is left: another naming of axes or unit is believed where it leaves less."""
MOST_LEFT = 0.5
"""Of the square of the change: what a right naming leaves at most."""
MIN_LOG_ODDS = 15.0
"""Of the logarithm of the probability of an acceleration: another naming of axes has so much more.
Of 100 clean cars, whose braking says little of their slopes, the worst had 16, unsteadily."""
STEADILY = 2.5
"""Standard errors, by how windows scatter, by which that is above zero, or more is asked for."""
SAME_LOG_ODDS = 3.0
"""Of that logarithm: namings that differ by less are not told apart."""
_MIN_WINDOWS = 3
_DELAYS_S = (0.1, 0.2, 0.35, 0.55, 0.8, 1.1, 1.5, 2.0)
"""An accelerometer is tried to be about so late, or early, beside a gyro."""
MIN_ROWS = 50
"""Readings that can show a turn."""
SMOOTHED_S = (0.3, 1.0, 3.0)
"""A slow turn is seen above the noise by its longer means only."""
_MIN_LENGTHS = 20
"""A log is so many times as long at least: fewer means agree by chance."""
_MOST_BIAS = 20.0
"""Of the size of the readings: a bias about their mean so far off is none."""
_ACCELEROMETER_BIAS = 0.5
"""m/s²: more than an accelerometer reads too much."""
_SPEED_M_S = 50.0
"""Faster than what leans into its turns, or feels them."""
_UNITS = ((1.0, ""), (np.pi / 180, "degrees"), (180 / np.pi, "radians"))


MOST_ROWS = 60_000
"""Of a longer log the stretch of so many rows in which the readings move most: a delay, and
the names of axes, are the same throughout, and so many rows tell them as surely as all."""

_PIECE = 500  # rows, in which a motion shows
_TELLING: WeakKeyDictionary[Samples, Samples] = WeakKeyDictionary()


class Renaming(NamedTuple):
    """The turn (3, 3) from the axes of the gyro to those of another sensor, and the gyro's unit;
    `left` of the change, a share."""

    left: float
    turn: Array
    unit: str


def check_turning(samples: Samples) -> Finding | None:
    """The finding that the gyro turns otherwise than the magnetometer, with what it looks like."""
    return find_first([TURNING], samples)


def _measure_turning(samples: Samples, _: str = "") -> Told:
    if not _can_tell(samples):
        return None
    samples = find_telling(samples)
    found = find_renaming(samples, _UNITS, felt=False)
    if found is None:
        return None
    looks = []
    if found.unit:
        looks.append(f"in {found.unit} a second")
    if np.array_equal(found.turn, -np.eye(3)):
        looks.append("of the opposite sign")
    elif not np.array_equal(found.turn, np.eye(3)):
        looks.append(f"of other axes ({describe_renaming(found.turn)})")
    return {"looks": " and ".join(looks), "move": _tell_which(samples, found)}


def _measure_gravity_turning(samples: Samples, _: str = "") -> Told:
    """The opposite sign of gravity turns alike: of P and −P, which cannot be told apart, the one
    that reverses fewer axes is told first."""
    if samples.acceleration is None or not _can_tell(samples):
        return None
    samples = find_telling(samples)
    turn = _find_probable_naming(samples)
    if turn is None:
        found = find_renaming(samples, _UNITS[:1], felt=True)
        turn = None if found is None else found.turn
    if turn is None:
        return None
    late_s = _find_late(samples, turn)
    if late_s:
        looks = f"about {figure(abs(late_s))} s {'late' if late_s > 0 else 'early'}"
        return {"looks": looks, "move": "bring the clocks of accelerometer and gyro together"}
    back = turn.T  # from the axes of the accelerometer to those of the gyro, or −1 times it
    one, other = sorted((back, -back), key=lambda turn: int(np.count_nonzero(turn < 0)))
    return {
        "looks": f"of other axes ({describe_renaming(one)}, or with gravity's sign the other way "
        f"{describe_renaming(other)})",
        "move": "name the axes of accelerometer and gyro alike, and look which of the two is wrong",
    }


TURNING = Fact(
    "inertial unit",
    _measure_turning,
    "refuse",
    "the gyro does not turn as the magnetometer does; it would if the gyro were {looks}",
    "{move}",
)
GRAVITY_TURNING = Fact(
    "inertial unit",
    _measure_gravity_turning,
    "refuse",
    "gravity does not turn in the accelerometer as the gyro does; it would if the accelerometer "
    "were {looks}",
    "{move}",
)


def find_telling(samples: Samples) -> Samples:
    """The samples, or the stretch of `MOST_ROWS` of them in which most of the time most moves."""
    n = len(samples)
    if n <= MOST_ROWS:
        return samples
    if samples not in _TELLING:
        starts = np.linspace(0, n - MOST_ROWS, -(-n // MOST_ROWS)).astype(int)
        moves = []
        for start in starts:
            pieces = samples.field[start : start + MOST_ROWS].reshape(-1, _PIECE, 3)
            moves.append(float(np.median(pieces.std(axis=1).max(axis=1))))
        start = int(starts[int(np.argmax(moves))])
        _TELLING[samples] = samples.select(np.arange(start, start + MOST_ROWS))
    return _TELLING[samples]


def find_renaming(
    samples: Samples, units: tuple[tuple[float, str], ...], *, felt: bool
) -> Renaming | None:
    """What the gyro has to be renamed by to turn as another sensor does; `None` where it does, or
    nothing else comes far nearer."""
    time = samples.time
    assert time is not None
    turns, found = np.concatenate([right_angles(), -right_angles()]), []
    tried = np.concatenate([factor * turns for factor, _ in units])
    for smoothed_s in SMOOTHED_S:
        if smoothed_s > SMOOTHED_S[0] and _MIN_LENGTHS * smoothed_s > time[-1] - time[0]:
            break
        products, farthest = _sum(samples, smoothed_s, felt=felt)
        own = float(measure_left(products, np.eye(3), farthest))
        if own < FAR_BETTER * MOST_LEFT:
            continue  # as named it is right
        left = measure_left(products, tried, farthest)
        unit, turn = divmod(int(np.argmin(left)), len(turns))
        if left.min() <= min(MOST_LEFT, FAR_BETTER * own):
            found.append(Renaming(float(left.min()), turns[turn], units[unit][1]))
    return min(found, key=lambda one: one.left) if found else None


def _find_probable_naming(samples: Samples) -> Array | None:
    """The turn (3, 3) from the axes of the gyro to those of an accelerometer that reads as if its
    axes were others; `None` where its own names are as probable. Other namings have to be more
    probable in most windows, not in a few: what accelerates a vehicle may follow its attitude by
    chance. Of those that hardly differ none is told by which the gyro explains far less of the
    change."""
    time, rate, force = samples.time, samples.rotation_rate, samples.acceleration
    if time is None or rate is None or force is None or not explains_change(samples):
        return None
    turns = right_angles()  # the opposite of each is as probable
    each = compare_namings(force, rate, time, turns)
    more = each - each[0]
    sums, windows = more.sum(axis=1), each.shape[1]
    if windows < _MIN_WINDOWS or sums.max() < MIN_LOG_ODDS:
        return None
    best = int(np.argmax(sums))
    steady = float(sums[best] / (np.sqrt(windows) * more[best].std(ddof=1)))
    if sums[best] < MIN_LOG_ODDS * max(1.0, (STEADILY / steady) ** 2):
        return None
    likely = np.flatnonzero(sums > sums[best] - SAME_LOG_ODDS)
    products, farthest = _sum(samples, SMOOTHED_S[0], felt=True)
    left = measure_left(products, turns[likely], farthest)
    likely = likely[left <= left.min() / FAR_BETTER]
    return np.asarray(turns[likely[np.argmax(sums[likely])]])


def _find_late(samples: Samples, turn: Array) -> float:
    """How late an accelerometer that seems of other axes is beside the gyro, s, where that makes
    what it reads more probable than those axes; else 0."""
    time, rate, force = samples.time, samples.rotation_rate, samples.acceleration
    assert time is not None
    assert rate is not None
    assert force is not None
    step = median(np.diff(time))
    later = np.unique(np.round(np.array(_DELAYS_S) / step).astype(int))
    shifts, own = np.concatenate([-later, later]), np.eye(3)[None]
    # by whole rows: between them noise would be less
    moved = np.clip(np.arange(len(time)) + shifts[:, None], 0, len(time) - 1)
    probable = compare_namings(force[moved], rate, time, own).sum(axis=(1, 2))
    renamed = compare_namings(force, rate, time, turn[None]).sum()
    best = int(np.argmax(probable))
    return float(shifts[best] * step) if probable[best] > renamed + MIN_LOG_ODDS else 0.0


def explains_change(samples: Samples) -> bool:
    """Whether the gyro turns as the magnetometer does: it leaves less than half of its change.
    False too where hardly anything turns, or the field itself changes more."""
    if not _can_tell(samples):
        return False
    products, farthest = _sum(find_telling(samples), SMOOTHED_S[0], felt=False)
    return bool(measure_left(products, np.eye(3), farthest) < MOST_LEFT)


def _tell_which(samples: Samples, found: Renaming) -> str:
    """Which of gyro and magnetometer is wrong, where the accelerometer goes with one of them."""
    if samples.acceleration is not None:
        for smoothed_s in SMOOTHED_S[:2]:
            products, farthest = _sum(samples, smoothed_s, felt=True)
            factor = next(factor for factor, unit in _UNITS if unit == found.unit)
            either = np.stack([np.eye(3), factor * found.turn])
            own, renamed = measure_left(products, either, farthest).tolist()
            if own <= min(MOST_LEFT, FAR_BETTER * renamed):
                return (
                    "look at the magnetometer's axes: gyro and accelerometer agree with each other"
                )
            if renamed <= min(MOST_LEFT, FAR_BETTER * own):
                return "correct the gyro: magnetometer and accelerometer agree with each other"
    return "name units and axes of gyro and magnetometer alike, and look which of the two is wrong"


def _can_tell(samples: Samples) -> bool:
    time, rate = samples.time, samples.rotation_rate
    return time is not None and rate is not None and len(time) >= MIN_ROWS


def _sum(samples: Samples, smoothed_s: float, *, felt: bool) -> tuple[Array, Array]:
    """`sum_products` of the readings, or of the acceleration that is `felt`, smoothed over so many
    seconds; and how far off a bias may be."""
    time, rate = samples.time, samples.rotation_rate
    values = samples.acceleration if felt else samples.field
    assert time is not None
    assert rate is not None
    assert values is not None
    farthest = np.repeat([_ACCELEROMETER_BIAS, _SPEED_M_S], 3)
    if not felt:
        size = max(float(np.sqrt((values**2).sum(axis=1).mean())), 1e-300)
        farthest = np.full(3, _MOST_BIAS * size)
    return sum_products(values, rate, time, smoothed_s, felt=felt), farthest
