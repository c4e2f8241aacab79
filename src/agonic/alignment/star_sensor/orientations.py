"""Which orientations determine most, and the words for what none has determined."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agonic.alignment.maths import two_frames as kernel
from agonic.alignment.maths.two_frames import GROUPS, Measured, Unknowns
from agonic.arrays import Array
from agonic.health import figure
from agonic.maths.rotations.frames import rot_cn

Orientation = tuple[float, float, float]

ELEVATIONS_DEG = (90.0, 65.0, 40.0)
STEP_DEG = 45.0
_SHARE = 0.05
"""A group that has less than this share of a combination is not named."""


def list_candidates(lowest_deg: float = 40.0) -> list[Orientation]:
    """Azimuth, elevation and roll of a star sensor that sees no horizon, degrees."""
    turns = np.arange(0.0, 360.0, STEP_DEG)
    heights = [e for e in ELEVATIONS_DEG if e > lowest_deg] + [lowest_deg]
    return [
        (float(azimuth), float(height), float(roll))
        for height in heights
        for azimuth in (turns if height < 90.0 else (0.0,))
        for roll in turns
    ]


def compute_information(at: Unknowns, like: Measured, chosen: list[Orientation]) -> Array:
    """What one more orientation each would tell, JᵀC⁻¹J (j, 18, 18), as noisy as those before."""
    attitude = rot_cn(*np.array(chosen).T)
    count = len(chosen)
    reference = np.broadcast_to(like.reference.mean(axis=0), (count, 3))
    one = Measured(
        field=reference,
        reference=reference,
        rot_cn=attitude,
        attitude_covariance=np.broadcast_to(
            np.median(like.attitude_covariance, axis=0), (count, 3, 3)
        ),
        noise=np.full(count, np.median(like.noise)),
        reference_noise=np.full(count, np.median(like.reference_noise)),
    )
    expected = kernel.predict_field_c(at, one) @ at.rot_mc.T
    field = expected @ np.linalg.inv(at.matrix).T + at.bias
    made = one._replace(field=field)
    _, jacobian = kernel.compute_residual(at, made)
    white = kernel.compute_whitener(at, made) @ jacobian
    return np.asarray(np.einsum("jir,jis->jrs", white, white))


def choose_additions(
    information: Array,
    each: Array,
    chosen: list[Orientation],
    prior: Array,
    magnitude: float,
    enough: Callable[[list[int], float], bool],
) -> list[int]:
    """Which of `chosen` to add one after the other, each the one that shrinks the worst most.

    `information` (18, 18) and `prior` (18,) are what is known already, `enough(added, worst)`
    says when to stop, the worst being the largest standard error, nT, of a combination of the free
    unknowns.
    """
    free = np.isfinite(prior)
    units = kernel.find_unit_sizes(magnitude)[free]
    scale = np.outer(units, units)
    known = (information[np.ix_(free, free)] + np.diag(prior[free])) / scale
    parts = each[:, free][:, :, free] / scale
    added: list[int] = []
    while True:
        worst = float(1 / np.sqrt(max(np.linalg.eigvalsh(known)[0], 1e-30)))
        if enough(added, worst):
            return added
        tried = known + parts
        floor = 1e-12 * np.trace(known + parts.mean(axis=0)) * np.eye(len(known))
        volume = np.trace(np.linalg.inv(tried + floor), axis1=1, axis2=2)
        if len(set(added)) < len(chosen):  # none twice before all were taken
            volume[list(set(added))] = np.inf
        best = int(np.argmin(volume))
        added.append(best)
        known = known + parts[best]


def describe_combination(combination: Array, at: Unknowns, like: Measured) -> str:
    """A combination (18,) of the unknowns in words, the groups with the largest shares first."""
    field_n = at.rot_nr @ like.reference.mean(axis=0)
    along_n = field_n / np.linalg.norm(field_n)
    shares = {g: float((combination[rows] ** 2).sum()) for g, rows in GROUPS.items()}
    named = sorted((g for g in shares if shares[g] > _SHARE), key=lambda g: -shares[g])
    return " together with ".join(
        _words(group, combination[GROUPS[group]], along_n, like) for group in named
    )


def _words(group: str, part: Array, along_n: Array, like: Measured) -> str:
    """One group's part of a combination."""
    if group == "matrix":
        gain = abs(part[:3].sum()) / np.sqrt(3) / np.linalg.norm(part)
        return "the common gain of the magnetometer" if gain > 0.9 else "the magnetometer's matrix"
    unit = part / np.linalg.norm(part)
    if group in ("reference", "pier"):
        what = "a turn of the reference about" if group == "reference" else "the pier offset along"
        if abs(unit @ along_n) > 0.99:
            return f"{what} the field"
        return f"{what} {_direction(unit, ('north', 'east', 'down'))}"
    mean = like.field.mean(axis=0)
    fixed = np.linalg.norm(mean) > 0.9 * np.linalg.norm(like.field, axis=1).mean()
    what = "the turn of the alignment about" if group == "alignment" else "the bias along"
    if fixed and abs(unit @ mean) > 0.98 * np.linalg.norm(mean):
        return f"{what} the field, which is the same in all orientations"
    return f"{what} {_direction(unit, ('x', 'y', 'z'))}"


def _direction(unit: Array, axes: tuple[str, str, str]) -> str:
    """A direction by its components along named axes; up to its sign."""
    unit = unit * np.sign(unit[np.argmax(np.abs(unit))])
    parts = [
        f"{figure(float(c))} {axis}" for c, axis in zip(unit, axes, strict=True) if abs(c) > 0.1
    ]
    return axes[int(np.argmax(unit))] if unit.max() > 0.99 else "(" + ", ".join(parts) + ")"
