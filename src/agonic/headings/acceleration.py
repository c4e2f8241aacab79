"""How far acceleration may have pulled a vertical that rests on an accelerometer.

At rest the specific force f points up. In motion it is a − g, so the tilt that it tells is wrong by
the level part of a over g. A vehicle that moves ahead at v and turns at ω accelerates by v ω × x̂,
with x̂ its nose; whatever else it does is `the rest`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.earth.geodesy import SEMI_MAJOR_M
from agonic.maths.equation.crowding import choose_evenly
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2

ROWS = 20_000
"""Rows, spread evenly over a log, that tell what is usual in it: a median of them is known to a
hundredth of how they scatter."""
SMOOTHED_S = 3.0
"""Turns last longer; gusts, shocks and the noise of the sensors do not."""
SCALE_SD = 0.01
"""How well an accelerometer knows g: the scale and bias of a common one."""
WITHIN = 0.02
"""Further off g than this share, calm moments of an accelerometer are no calm moments."""
CALM = 0.2
"""The share of a log that is taken to be calm."""
UNSEEN = 0.003
"""A push of this square, in g², may hide in what an accelerometer's scale and bias do not tell."""
FASTEST_M_S = 40.0
"""Prior of a speed of which nothing is known: its square is within the square of this."""


class Speed(NamedTuple):
    """The square of the speed ahead in turns, (m/s)², its sd, and the specific force at rest.

    `trusted` where nothing speaks against it.
    """

    square: float
    square_sd: float
    gravity: float
    trusted: bool = True

    @property
    def taken(self) -> float:
        """The speed to reckon with, m/s; 0 where it does not stand out by two sds."""
        clear = self.trusted and self.square > 2 * self.square_sd
        return float(np.sqrt(self.square)) if clear else 0.0

    @property
    def doubt(self) -> float:
        """How far the speed may be from that, m/s."""
        if self.taken:
            # a vehicle's speed is not the same in all turns
            return float(np.hypot(self.square_sd / (2 * self.taken), 0.05 * self.taken))
        return float(np.sqrt(max(self.square, 0.0) + self.square_sd))


AT_REST = Speed(0.0, 0.0, STANDARD_GRAVITY_M_S2)


def compute_turn_axis(rotation_rate: Array) -> Array:
    """ω × x̂ (n, 3): acceleration in body axes for each m/s ahead, of rates (n, 3) in rad/s."""
    return np.stack(
        [np.zeros(len(rotation_rate)), rotation_rate[:, 2], 0.0 - rotation_rate[:, 1]], 1
    )


def compute_turn_rate(time: Array, specific_force: Array, rotation_rate: Array) -> Array:
    """The rate (n,) of turning about the vertical, rad/s, without gusts: −ω·f/g.

    A level turn leans f by tan φ = v Ω/g, so its size is g/cos φ and ω·f = −Ω g whatever the bank.
    """
    about = np.einsum("ij,ij->i", rotation_rate, specific_force)
    return -smooth(about, count_rows(time, SMOOTHED_S)) / STANDARD_GRAVITY_M_S2


def estimate_speed(samples: Samples, specific_force: Array, rotation_rate: Array) -> Speed:
    """The speed that a log's own turns tell: |f|² = g² + v² Ω², by least squares.

    What accelerates up and down averages out of |f|². Straight legs and turns together tell g and
    v apart; priors (`SCALE_SD`, `FASTEST_M_S`, or the speed of the track) hold what they do not.

    Force (n, 3), m/s², and rates (n, 3), rad/s, are in body axes.
    """
    time = samples.time
    assert time is not None
    width = count_rows(time, SMOOTHED_S)
    felt = smooth((specific_force**2).sum(axis=1), width) - STANDARD_GRAVITY_M_S2**2
    turn = compute_turn_rate(time, specific_force, rotation_rate)
    track = _compute_track_square(samples, turn, width)
    rows = np.stack([np.ones(len(time)), turn**2], axis=1)
    prior = np.array([0.0, track])
    # prior of the square of a speed that positions tell, over it: there is wind, and speeds
    # change
    speed_sd = 0.5 * track if track else FASTEST_M_S**2
    prior_sd = np.array([2 * SCALE_SD * STANDARD_GRAVITY_M_S2**2, speed_sd])
    # what else accelerates a vehicle is another one after this long
    independent = max((time[-1] - time[0]) / 20.0, 1.0)
    variance = float(np.var(felt)) + 1e-6
    for _ in range(3):
        weight = independent / len(time) / variance
        information = rows.T @ rows * weight + np.diag(prior_sd**-2.0)
        found = np.linalg.solve(information, rows.T @ felt * weight + prior / prior_sd**2)
        variance = float(np.mean((felt - rows @ found) ** 2)) + 1e-6
    sd = float(np.sqrt(np.linalg.inv(information)[1, 1]))
    return Speed(float(found[1]), sd, float(np.sqrt(STANDARD_GRAVITY_M_S2**2 + found[0])))


def _compute_track_square(samples: Samples, turn: Array, width: int) -> float:
    """The square of the speed over ground, (m/s)², weighted by the square of the rate of turn (n,);
    0 where the samples hold no positions, or none that move."""
    latitude, longitude, time = samples.latitude_deg, samples.longitude_deg, samples.time
    if latitude is None or longitude is None or time is None or len(time) < 3:
        return 0.0
    level = np.stack([np.radians(latitude), np.unwrap(np.radians(longitude))], axis=1)
    level[:, 1] *= np.cos(level[:, 0])
    moved = np.gradient(smooth(level, width) * SEMI_MAJOR_M, time, axis=0)
    weight = turn**2 + 1e-12
    square = float((weight * (moved**2).sum(axis=1)).sum() / weight.sum())
    return square if square > 0.01 else 0.0


def estimate_shaking(
    time: Array, force: Array, rotation_rate: Array | None, speed: Speed, window_s: float
) -> tuple[Array, Array]:
    """How far the specific force itself is from upright: sd about the axis ahead and across, rad.

    A turn leans it by v Ω/g sideways. Of the rest its size tells: up and down it shows as it is,
    and the level axes are shaken as much (water in waves moves in circles); what only pushes along
    the ground shows as the mean of |f|²/g² − 1, g being what is felt in calm moments.

    It is averaged over `window_s`; `force` and `rotation_rate` (n, 3) are in body axes.
    """
    width = count_rows(time, window_s)
    size = np.sqrt((force**2).sum(axis=1))
    turn = np.zeros(len(size))
    if rotation_rate is not None:
        turn = np.abs(compute_turn_rate(time, force, rotation_rate)) / STANDARD_GRAVITY_M_S2
    leaning = speed.taken * turn
    square = (size / STANDARD_GRAVITY_M_S2) ** 2 - leaning**2
    average = smooth(square, width)
    likely = np.abs(average - 1.0) < 0.5
    low, calm = np.quantile(average[likely] if likely.any() else average, (CALM / 4, CALM))
    g_square = np.clip(2 * calm - low, (1 - WITHIN) ** 2, (1 + WITHIN) ** 2)
    rest = square / g_square - 1.0
    bobbing = smooth(rest**2, width) / 4.0
    pushed = np.maximum(average / g_square - 1.0, 0.0) / 2.0
    unseen = min(float(pushed.mean()), UNSEEN)
    other = np.maximum(np.maximum(bobbing, pushed), unseen)
    roll = np.arctan(np.sqrt(leaning**2 + (speed.doubt * turn) ** 2 + other))
    return roll, np.arctan(np.sqrt(other))


def smooth(values: Array, width: int) -> Array:
    """The moving average over `width` rows, of each column by itself."""
    from scipy.ndimage import uniform_filter1d  # slow to load

    return np.asarray(uniform_filter1d(values, width, axis=0, mode="nearest"))


def count_rows(time: Array, duration_s: float) -> int:
    """How many rows last so long."""
    if len(time) < 2:
        return 1
    some = choose_evenly(len(time) - 1, ROWS)
    return max(round(duration_s / float(np.median(time[some + 1] - time[some]))), 1)
