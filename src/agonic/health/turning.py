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
_SMOOTHED_S = 0.3
_MOST = 4000
_UNITS = ((1.0, ""), (np.pi / 180, "degrees"), (180 / np.pi, "radians"))


def check_turning(samples: Samples) -> Finding | None:
    """The finding that the gyro turns otherwise than the magnetometer, with what it looks like."""
    time, rate = samples.time, samples.rotation_rate
    if time is None or rate is None or len(time) < FEWEST:
        return None
    turns = np.concatenate([right_angles(), -right_angles()])
    tried = [(misfit, turn, unit) for unit in _UNITS for misfit, turn in _try(samples, turns, unit)]
    own = tried[0][0]
    best, turn, unit = min(tried, key=lambda one: one[0])
    if best > EXPLAINED or best > FAR_BETTER * own:
        return None
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
    return _try(samples, np.eye(3)[None], _UNITS[0])[0][0] < EXPLAINED


def _try(samples: Samples, turns: Array, unit: tuple[float, str]) -> list[tuple[float, Array]]:
    """What is left of the change of the field for each renaming, as a share, with the renaming."""
    time, rate = samples.time, samples.rotation_rate
    assert time is not None
    assert rate is not None
    step = float(np.median(np.diff(time)))
    every = max(1, len(time) // _MOST)
    field, rate = (low_pass(v, step, _SMOOTHED_S) for v in (samples.field, rate))
    # no rate is larger than noise where nothing turns; a gap's change is not that of a row
    change = np.gradient(field, time, axis=0)[::every]
    size = np.sqrt((change**2).sum(axis=1))
    usual = size < 10 * np.median(size) + 1e-12
    field, rate, change = field[::every][usual], rate[::every][usual], change[usual]
    field = field - field.mean(axis=0)
    total = max(float((change**2).sum()), 1e-300)
    found = []
    for turn in turns:
        turned = unit[0] * rate @ turn.T
        by_bias = skew(turned).reshape(-1, 3)  # ω × b = −b × ω
        wanted = (change - np.cross(field, turned)).ravel()
        gram = by_bias.T @ by_bias
        bias = np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ (by_bias.T @ wanted)
        left = wanted - by_bias @ bias
        found.append((float(left @ left) / total, turn))
    return found
