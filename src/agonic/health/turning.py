"""Whether magnetometer and gyro turn together, and what would make them.

A field that stands still turns in the sensor by dv/dt = (v − b) × ω, whatever the calibration does
to its length. With the axes of the gyro renamed, or its unit another one, the same holds for s T ω;
so every renaming T and unit s is tried, the bias b free in each.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.health import Finding, figure
from agonic.maths.rotations.low_pass import low_pass
from agonic.maths.rotations.mounting import describe_renaming, right_angles
from agonic.maths.rotations.vectors import skew
from agonic.samples import Samples

FAR_BETTER = 0.25
"""Of the square that is left: another naming of axes or unit is believed where it leaves less."""
EXPLAINED = 0.5
"""Of the square of the change: what a right naming leaves at most."""
PINNED = 0.02
"""Of the rows at the largest rate: fewer are chance."""
FEWEST = 50
"""Readings that can show a turn."""
_SMOOTHED_S = (0.3, 1.0, 3.0)
"""A slow turn is seen above the noise by its longer means only."""
_LENGTHS = 20
"""A log is so many times as long at least: fewer means agree by chance."""
_MOST = 4000
_FARTHEST = 20.0
"""Of the size of the readings: a bias about their mean so far off is none. Without that, a bias of
57 fields would explain any small turns by a gyro in the wrong unit."""
_LEVI_CIVITA = skew(np.eye(3)).swapaxes(1, 2)
_UNITS = ((1.0, ""), (np.pi / 180, "degrees"), (180 / np.pi, "radians"))


def check_turning(samples: Samples) -> Finding | None:
    """The finding that the gyro turns otherwise than the magnetometer, with what it looks like."""
    time, rate = samples.time, samples.rotation_rate
    if time is None or rate is None or len(time) < FEWEST:
        return None
    turns = np.concatenate([right_angles(), -right_angles()])
    size, found = _measure_size(samples), []
    for smoothed_s in _SMOOTHED_S:
        if smoothed_s > _SMOOTHED_S[0] and _LENGTHS * smoothed_s > time[-1] - time[0]:
            break
        products = _sum_products(samples, smoothed_s)
        tried = [
            (_measure_left(products, unit[0] * turn, size), turn, unit)
            for unit in _UNITS
            for turn in turns
        ]
        best, turn, unit = min(tried, key=lambda one: one[0])
        if best <= min(EXPLAINED, FAR_BETTER * tried[0][0]):
            found.append((best, turn, unit))
    if not found:
        return None
    _, turn, unit = min(found, key=lambda one: one[0])
    looks = []
    if unit[1]:
        looks.append(f"in {unit[1]} a second")
    if np.array_equal(turn, -np.eye(3)):
        looks.append("of the opposite sign")
    elif not np.array_equal(turn, np.eye(3)):
        looks.append(f"of other axes ({describe_renaming(turn.T)})")
    return Finding(
        "inertial unit",
        "refuse",
        "the gyro does not turn as the magnetometer does; it would if the gyro were "
        + " and ".join(looks),
        "name units and axes of gyro and magnetometer alike, and look which of the two is wrong",
    )


def check_clipping(samples: Samples) -> Finding | None:
    """The finding that the gyro reads one largest rate again and again: it turned faster.

    Not where readings repeat anyway, as those of a coarse gyro do.

    >>> time = np.arange(200) / 10
    >>> rate = np.clip(np.stack([0.0 * time, 0.0 * time, 2.0 * np.sin(time)], axis=1), -1.0, 1.0)
    >>> clipped = Samples(time=time, field=np.ones((200, 3)), rotation_rate=rate)
    >>> check_clipping(clipped).what
    'the gyro never reads more than 57°/s about z, and just that in 66 % of the rows: it clips'
    """
    rate = samples.rotation_rate
    if rate is None or len(rate) < FEWEST:
        return None
    for name, axis in zip("xyz", np.abs(rate).T, strict=True):
        most, pinned = float(axis.max()), axis == axis.max()
        free = axis[~pinned]
        share = float(pinned.mean())
        if share < PINNED or len(free) < FEWEST or (np.diff(free) == 0).mean() > PINNED:
            continue
        top = figure(float(np.degrees(most)))
        return Finding(
            "inertial unit",
            "check",
            f"the gyro never reads more than {top}°/s about {name}, and just that in "
            f"{100 * share:.0f} % of the rows: it clips",
            "set a wider range of the gyro, or turn more slowly",
        )
    return None


def leave_out_wrong_gyro(samples: Samples) -> tuple[Samples, Finding | None]:
    """The samples without a gyro that turns otherwise than the magnetometer, and the finding.

    A fit that needs no gyro goes on without it; a delay beside it would be any.

    >>> turning = np.radians(np.linspace(0, 360, 100))
    >>> field = np.stack([np.cos(turning), -np.sin(turning), np.ones(100)], axis=1)
    >>> rate_deg_s = [[0, 0, 3.6]] * 100
    >>> s = Samples(time=np.linspace(0, 100, 100), field=field, rotation_rate=rate_deg_s)
    >>> leave_out_wrong_gyro(s)[0].rotation_rate is None
    True
    """
    found = check_turning(samples)
    if found is None:
        return samples, None
    told = replace(found, severity="check", what=f"{found.what}; it was left out")
    return samples.with_columns(rotation_rate=None), told


def explains_change(samples: Samples) -> bool:
    """Whether the gyro turns as the magnetometer does: it leaves less than half of its change.

    False too where hardly anything turns, or the field itself changes more.
    """
    if samples.time is None or samples.rotation_rate is None or len(samples) < FEWEST:
        return False
    products = _sum_products(samples, _SMOOTHED_S[0])
    return _measure_left(products, np.eye(3), _measure_size(samples)) < EXPLAINED


def _measure_size(samples: Samples) -> float:
    return max(float(np.sqrt((samples.field**2).sum(axis=1).mean())), 1e-300)


def _sum_products(samples: Samples, smoothed_s: float) -> Array:
    """Sums over the rows of products of what the residual of any renaming is made of, (19, 19).

    With f the field about its mean, the change c − f × ω' − ω' × b of a row under a rate ω' = s T ω
    is a sum of the change c itself, of the nine f × e_k ω_j, times s T_kj, and of the nine e_c ω_j:
    all renamings have their squares and best biases from these sums, and no row is seen again.
    """
    time, rate = samples.time, samples.rotation_rate
    assert time is not None
    assert rate is not None
    step = float(np.median(np.diff(time)))
    every = max(1, len(time) // _MOST)
    field, rate = (low_pass(v, step, smoothed_s) for v in (samples.field, rate))
    # no rate is larger than noise where nothing turns; a gap's change is not that of a row
    change = np.gradient(field, time, axis=0)[::every]
    size = np.sqrt((change**2).sum(axis=1))
    usual = size < 10 * np.median(size) + 1e-12
    field, rate, change = field[::every][usual], rate[::every][usual], change[usual]
    crossed = skew(field - field.mean(axis=0)).swapaxes(1, 2)  # (n, k, 3): f × e_k
    turned = (crossed[:, :, None] * rate[:, None, :, None]).reshape(-1, 9, 3)
    moved = (np.eye(3)[:, None] * rate[:, None, :, None]).reshape(-1, 9, 3)
    parts = np.concatenate([change[:, None], turned, moved], axis=1).swapaxes(1, 2).reshape(-1, 19)
    return np.asarray(parts.T @ parts)


def _measure_left(products: Array, turn: Array, size: float) -> float:
    """What is left of the change of the field with a turn and unit (3, 3) of the gyro, as a share.

    Parameters: the sums of `_sum_products`, and the size of the readings.
    """
    wanted = np.r_[1.0, -turn.ravel(), np.zeros(9)]
    by_bias = np.zeros((3, 19))  # ω' × e_b, of which e_c holds ε_kbc ω'_k
    by_bias[:, 10:] = np.einsum("kbc,kj->bcj", _LEVI_CIVITA, turn).reshape(3, 9)
    gram, along = by_bias @ products @ by_bias.T, by_bias @ products @ wanted
    gram = gram + products[0, 0] / (_FARTHEST * size) ** 2 * np.eye(3)
    bias = np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ along
    left = wanted - bias @ by_bias
    far = float(bias @ bias) / (_FARTHEST * size) ** 2
    return far + float(left @ products @ left) / max(float(products[0, 0]), 1e-300)
