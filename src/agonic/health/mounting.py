"""Whether the axes of the readings are those of roll and pitch, or of the accelerometer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health.evidence import MOST_ROWS
from agonic.health.finding import Fact, Finding, Told, find_first
from agonic.maths.one_pass import find_length, median
from agonic.maths.rotations.right_angles import (
    describe_mounting,
    describe_renaming,
    right_angles,
    vertical_misfit,
)
from agonic.maths.rotations.tilt import down_from_force
from agonic.units import STANDARD_GRAVITY_M_S2

FAR_BETTER = 0.4
"""Another mounting is accepted when it leaves less than this share of the vertical's misfit."""
CROSSTALK = 0.05
"""Of the readings' spread: what talk between axes and a lean that stays leave of a vertical. A
vehicle that keeps level shows nothing else, so there any turn about the vertical may seem best."""
VERTICAL_DOUBTFUL = 0.08
"""Of the field: what a good sensor and 5° of wrong gravity leave of a vertical that is constant."""
RIVAL = 1.5
"""Axes are named when any others leave this much more than the best."""
NEAR_GRAVITY = 0.1
"""Acceleration further off gravity, by this share of it, tells no vertical."""
UPRIGHT_SD = 0.03
"""How well an accelerometer at rest knows the vertical, in radians."""
STEEP = 0.3
"""Of the readings: a vertical that is less may have its sign from iron."""
TALK = 0.1
"""Attitudes good to 0.3° beside axes that talk to each other by 5 %: noise over talk."""
MIRRORED_SHARE = 0.015
"""Of the field: a vertical that varies by less shows nothing, or does not matter."""
MIRRORS = (
    ("pitch seems to have the opposite sign", np.diag([-1.0, 1.0, 1.0])),
    ("roll seems to have the opposite sign", np.diag([1.0, -1.0, 1.0])),
    ("roll and pitch seem exchanged", np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, 1]])),
    (
        "roll and pitch seem exchanged and both of the opposite sign",
        np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]]),
    ),
)
FEWEST_TILTS = 8
"""So many directions of gravity, in steps of about 15°, tell the 48 namings of axes apart."""


class Best(NamedTuple):
    """The turn by right angles that leaves the least variation of the vertical field, whether it is
    clearly the best, and what it leaves and what the named axes leave."""

    turn: Array
    clear: bool
    left: float
    own: float

    @property
    def percent(self) -> dict[str, float]:
        """What either leaves, in hundredths."""
        return {"left": 100 * self.left, "own": 100 * self.own}


def _find_best(misfit: Array) -> Best:
    """The best turn from the misfit of each turn by right angles, (24,)."""
    best, rival = np.argsort(misfit)[:2]
    clear = misfit[best] < min(FAR_BETTER * misfit[0], misfit[rival] / RIVAL)
    return Best(right_angles()[best], bool(clear), float(misfit[best]), float(misfit[0]))


def find_mounting(readings: Array, down: Array, vertical: Array | None = None) -> Array | None:
    """The turn (3, 3) by right angles that the readings are in, where no other comes near it."""
    best = _find_best(vertical_misfit(readings, down, right_angles(), vertical=vertical))
    return best.turn if best.clear and best.own > _find_crosstalk(readings) else None


REVERSED_FIELD = Finding(
    "mounting",
    "refuse",
    "by the attitude of the log the field points the opposite way to the reference, upside down",
    "check the place (the sign of its latitude) and the signs of the sensor's axes",
)
"""A fit that reverses the readings: no gain of a sensor is negative."""


def check_mounting(readings: Array, down: Array, vertical: Array | None = None) -> Finding | None:
    """The finding that the sensor sits in the vehicle by another right angle than its axes say, or
    that roll or pitch is counted the wrong way round."""
    return find_first([MIRRORED, MISPLACED], readings, down, vertical)


def _measure_misplaced(readings: Array, down: Array, vertical: Array | None) -> Told:
    """A vehicle that keeps level tells which axis is upright; where two axes would do as well, what
    moves the readings is something else, and nothing is told."""
    turns = right_angles()
    misfit = vertical_misfit(readings, down, turns, vertical=vertical)
    best = int(np.argmin(misfit))
    if misfit[best] >= FAR_BETTER * misfit[0] or misfit[0] < _find_crosstalk(readings):
        return None
    upright = np.argmax(np.abs(turns[:, 2]), axis=1)
    if misfit[best] * RIVAL > misfit[upright != upright[best]].min():
        return None  # what moves the readings is not the turning of the vehicle
    mounted = describe_mounting(turns[best])
    return {"mounted": mounted, "word": mounted.replace(" points ", " ")}


def check_axes(
    field: Array,
    acceleration: Array,
    magnitude: float,
    upwards: bool | None = None,
    beside: str = "the accelerometer beside it",
) -> Finding | None:
    """The finding that the axes of the readings are not those of the accelerometer beside them."""
    return find_first([RENAMED], field, acceleration, magnitude, upwards, beside)


def _measure_renamed(
    field: Array, acceleration: Array, magnitude: float, upwards: bool | None, beside: str
) -> Told:
    """The magnitude of the field is the same whatever its axes are called; its vertical part is
    constant for the right ones only. Every exchange and reversal of axes is tried, on readings near
    gravity, each weighed by w = 1/(σ² + (|a|/g − 1)²)."""
    thinned = slice(None, None, -(-len(field) // MOST_ROWS))
    field, acceleration = field[thinned], acceleration[thinned]
    felt = np.sqrt(np.einsum("ni,ni->n", acceleration, acceleration))
    gravity = median(felt)
    if abs(gravity / STANDARD_GRAVITY_M_S2 - 1) > 2 * NEAR_GRAVITY:
        return None
    off = felt / gravity - 1
    calm = np.abs(off) < NEAR_GRAVITY
    down = down_from_force(acceleration[calm])
    if len(np.unique(np.rint(4 * down) @ (81.0, 9.0, 1.0))) < FEWEST_TILTS:
        return None
    weights = 1 / (UPRIGHT_SD**2 + off[calm] ** 2)
    unit = field[calm] / magnitude
    best = _find_best(vertical_misfit(unit, down, right_angles(), weights, centred=True))
    if best.own < VERTICAL_DOUBTFUL or not best.clear:
        return None
    turn = best.turn  # or its reverse: by the field's sign, or that which reverses fewer axes
    reverse = bool(np.count_nonzero(turn < 0) >= 2)
    if upwards is not None:
        reverse = bool((np.einsum("ni,ij,nj->", down, turn, field[calm]) < 0) != upwards)
    named = describe_renaming(0.0 - turn if reverse else turn)
    return {"beside": beside, "named": named, **best.percent}


def _measure_mirrored(readings: Array, down: Array, vertical: Array | None) -> Told:
    """Roll or pitch counted the wrong way round, or the two exchanged. Each is a mirror image of
    the attitude, which no mounting of a sensor is. Soft iron and a misalignment are allowed for: a
    vehicle that tilts by a few degrees shows no more than they do. The vertical field's sign tells
    a mirror image from a sensor upside down."""
    if vertical is None:
        return None
    unit, turns = readings / max(median(find_length(readings)), 1e-300), right_angles()
    best = _find_best(vertical_misfit(unit, down, turns, vertical=vertical, talk=TALK))
    looks = next((said for said, mirror in MIRRORS if np.array_equal(-best.turn, mirror)), None)
    if looks is None or not best.clear or best.own < MIRRORED_SHARE:
        return None
    if find_side(readings, down, -best.turn, vertical) <= 0:
        return None
    return {"looks": looks, **best.percent}


MISPLACED = Fact(
    "mounting",
    _measure_misplaced,
    "refuse",
    "the readings do not follow roll and pitch along the axes they are named for; they would with "
    "the sensor mounted so that {mounted}",
    'say so where it sits like that (agonic calibrate --mounting "{word}"), or correct the '
    "orientation set for this sensor",
)
RENAMED = Fact(
    "axes",
    _measure_renamed,
    "check",
    "the axes are not those of {beside}: {named} (the vertical field is then constant to {left} %, "
    "as named to {own} %)",
    "name the axes of the magnetometer, or those of {beside}, rightly and calibrate again: the "
    "calibration holds for the axes as named, a heading from both would be wrong",
)
MIRRORED = Fact(
    "attitude",
    _measure_mirrored,
    "refuse",
    "{looks} in the attitude beside these readings, or an axis of the magnetometer is reversed: "
    "the vertical field is then constant to {left} %, as recorded to {own} %",
    "correct roll and pitch (right wing down and nose up are positive), or name the axes of the "
    "magnetometer rightly, and calibrate again",
)


def find_side(readings: Array, down: Array, turn: Array, vertical: Array | float) -> int:
    """Whether turned readings (n, 3) show a vertical of the sign of that of the place, (n,) or
    constant: 1, −1 where they show the other, 0 where it is small enough for iron to have made it.
    """
    shown = np.einsum("ni,ij,nj->n", down, turn, readings) * np.sign(vertical)
    share = float(np.mean(shown) / median(find_length(readings)))
    return int(np.sign(share)) if abs(share) > STEEP else 0


def _find_crosstalk(readings: Array) -> float:
    """How much of the vertical may vary where the axes are those they are named for."""
    return CROSSTALK * float(np.linalg.norm(readings.std(axis=0)))
