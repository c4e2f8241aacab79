"""From samples to shots of length one, the prior, and where the search begins."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.errors import AgonicError, CoverageError, LogError
from agonic.inertial.maths.shots import (
    BIAS_A,
    BIAS_M,
    DIP,
    MATRIX_M,
    SHAPE_A,
    SIGHT,
    TARGETS,
    Shots,
    calibrate,
    observe,
)
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation.changes.rest import find_rest
from agonic.maths.estimation.leastsq import inverse
from agonic.maths.rotations.right_angles import right_angles, vertical_misfit
from agonic.maths.rotations.vectors import skew
from agonic.reference import Reference
from agonic.samples import Samples

MIN_ATTITUDES = 12
"""Attitudes without which nothing is fitted."""
MOST_SHOTS = 200
"""More rows with times than this are a recording, whose stretches at rest are the shots."""
LEAST_OF_TARGET = 3
"""Shots at one target that tell anything of the sight."""
CLEARLY_TURNED = 4.0
"""Another mounting by right angles is taken where it leaves so many times less."""
DIP_SD, DIP_CLEAR = np.radians(0.3), np.radians(5.0)
"""How far the dip of a place is from a world model's, and from where on its sign is clear."""
ASTRAY_DEG = 10.0
"""Slope of the sight, by sensors not yet calibrated, that no kept target scatters by."""
FIXED = 1e8
"""Information of what is not to move."""
WIDE = 2.0
"""Standard deviation of the prior on the magnetometer's bias, in units of the field."""
ATTITUDES = (
    "hold it still level, upside down, on either side, nose up and nose down, each towards two "
    "directions a quarter turn apart"
)

EXPECTED_NOISE = np.array([2e-3, 3e-3, np.radians(0.15)])
"""Of a reading of the accelerometer, in g, and the magnetometer, in F, and of pointing, rad."""


@dataclass(frozen=True)
class Settings:
    """The settings of a fit; see `fit_pair`."""

    accelerometer_bias_sd: float = 0.05
    accelerometer_shape_sd: float = 0.02
    soft_iron_sd: float = 0.1
    turn_sd_deg: float = 5.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value > 0:
                raise AgonicError(f"{field.name} is {value}; it has to be above zero")


class Scale(NamedTuple):
    """What was one of the normalised readings: of force, and centre and size of the field's.
    `gravity` is negative where the log has gravity itself instead of the specific force."""

    gravity: float
    centre: Array
    size: float


class Prior(NamedTuple):
    """Mean (q,) and information (q, q) of the unknowns."""

    mean: Array
    information: Array


class Problem(NamedTuple):
    """The shots, their scale, the prior and the start. `rows` are those of the samples that each
    shot came from, `names` what the log calls the targets, and `missed` those among whose shots the
    sight was not kept."""

    shots: Shots
    scale: Scale
    prior: Prior
    start: Array
    rows: tuple[Index, ...] = ()
    names: tuple[float, ...] = ()
    missed: tuple[float, ...] = ()


def pose(samples: Samples, reference: Reference | None, settings: Settings) -> Problem:
    """The problem of the attitudes at rest that samples hold. Raises `LogError` without
    acceleration, `CoverageError` with too few attitudes."""
    rows, force, field = average_shots(samples)
    if len(rows) < MIN_ATTITUDES:
        raise CoverageError(
            f"{len(rows)} attitudes at rest were found and {MIN_ATTITUDES} are needed, better 24",
            undetermined="the matrices of both sensors",
            turns=ATTITUDES,
        )
    target, names, missed = leave_out_targets(force, *number_targets(samples, rows))
    dip = _dip(reference, len(samples))
    problem = _pose_scaled(force, field, target, _find_scale(force, field), settings, dip)
    if dip is not None and dip * problem.start[DIP] < 0 and abs(dip) > DIP_CLEAR:
        turned = problem.scale._replace(gravity=-problem.scale.gravity)
        problem = _pose_scaled(force, field, target, turned, settings, dip)
    return problem._replace(rows=rows, names=names, missed=missed)


def _pose_scaled(
    force: Array,
    field: Array,
    target: Index,
    scale: Scale,
    settings: Settings,
    dip: float | None,
) -> Problem:
    shots = Shots(force / scale.gravity, (field - scale.centre) / scale.size, target)
    mounting = find_mounting(shots)
    start = begin(shots, mounting, find_sight(force, target))
    return Problem(shots, scale, make_prior(start, mounting, settings, dip), start)


def average_shots(samples: Samples) -> tuple[tuple[Index, ...], Array, Array]:
    """The rows of each attitude at rest, and the mean force and field (n, 3) in it. Raises
    `LogError` without acceleration."""
    if samples.acceleration is None:
        raise LogError(
            f"{samples.name} was logged without acceleration; record the accelerometer with every "
            "shot (acc_x_m_s2 …)"
        )
    rows, columns = find_shots(samples), (samples.acceleration, samples.field)
    force, field = (np.array([one[own].mean(axis=0) for own in rows]) for one in columns)
    return rows, force, field


def find_shots(samples: Samples) -> tuple[Index, ...]:
    """The rows of each attitude at rest: of a station, of a stretch at rest, or each row."""
    n = len(samples)
    if samples.station is not None:
        number = samples.station.astype(np.intp)
    elif samples.time is not None and n > MOST_SHOTS:
        assert samples.acceleration is not None
        number = find_rest(samples.time, samples.acceleration, samples.field)
    else:
        number = np.arange(n)
    return tuple(np.flatnonzero(number == k) for k in np.unique(number[number >= 0]))


def number_targets(samples: Samples, rows: tuple[Index, ...]) -> tuple[Index, tuple[float, ...]]:
    """The target of each shot, counted from 0, −1 for none; and what the log calls them."""
    none = np.full(len(rows), -1)
    if samples.target is None:
        return none, ()
    named = np.array([samples.target[own[0]] for own in rows])
    counted = [(name, int((named == name).sum())) for name in np.unique(named[named > 0])]
    names = tuple(float(name) for name, count in counted if count >= LEAST_OF_TARGET)
    for k, name in enumerate(names):
        none[named == name] = k
    return none, names


def _find_scale(force: Array, field: Array) -> Scale:
    """The median force, and the sphere of least squares through the readings of the field."""
    middle = field.mean(axis=0)
    size = float(np.sqrt(((field - middle) ** 2).sum(axis=1).mean()))
    unit = (field - middle) / max(size, np.finfo(float).tiny)
    table = np.column_stack([2 * unit, np.ones(len(unit))])
    found = np.linalg.lstsq(table, (unit**2).sum(axis=1), rcond=1e-6)[0]
    radius = float(np.sqrt(max(found[3] + found[:3] @ found[:3], 0.01)))
    gravity = float(np.median(np.linalg.norm(force, axis=1)))
    if gravity == 0.0 or size == 0.0:
        raise LogError("the readings do not change from shot to shot; which no working sensor does")
    return Scale(gravity, middle + size * found[:3], size * radius)


def find_mounting(shots: Shots) -> Array:
    """The turn by right angles from the magnetometer's axes to the accelerometer's, (3, 3)."""
    up = shots.force / np.linalg.norm(shots.force, axis=1, keepdims=True)
    turns = right_angles()
    left = vertical_misfit(shots.field, up, turns, centred=True)
    best = int(np.argmin(left))
    return np.asarray(turns[best] if left[best] * CLEARLY_TURNED < left[0] else turns[0])


def begin(shots: Shots, mounting: Array, sight: Array) -> Array:
    """Unknowns (q,) of two sensors without errors, with dip and targets as they then are."""
    start = np.zeros(TARGETS + 2 * shots.targets)
    start[SHAPE_A][:3] = 1.0
    start[MATRIX_M] = mounting.ravel()
    start[SIGHT] = sight
    values = observe(*calibrate(shots, start), start[SIGHT]).values
    start[DIP] = np.median(values[:, 2])
    for k in range(shots.targets):
        own = values[shots.target == k]
        start[TARGETS + 2 * k] = np.median(own[:, 3])
        start[TARGETS + 2 * k + 1] = np.angle(np.median(np.exp(1j * own[:, 4])))
    return start


def find_sight(force: Array, target: Index) -> Array:
    """The direction (3,) about which gravity turns while the sight is kept on a target. Its sign is
    the one that leads along an axis. Without targets it is the first axis."""
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    sets = [up[target == k] for k in range(int(target.max(initial=-1)) + 1)]
    if not sets:
        return np.array([1.0, 0.0, 0.0])
    apart = np.concatenate([own - own.mean(axis=0) for own in sets])
    sight = np.linalg.eigh(apart.T @ apart)[1][:, 0]
    return np.asarray(sight * np.sign(sight[np.argmax(np.abs(sight))]))


def leave_out_targets(
    force: Array, target: Index, names: tuple[float, ...]
) -> tuple[Index, tuple[float, ...], tuple[float, ...]]:
    """Targets without those on which the sight was not kept, by far, and the names of these."""
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    missed: list[float] = []
    while names:
        height = np.degrees(np.arcsin(np.clip(up @ find_sight(force, target), -1, 1)))
        spread = [float(np.std(height[target == k])) for k in range(len(names))]
        worst = int(np.argmax(spread))
        if spread[worst] < ASTRAY_DEG:
            break
        missed.append(names[worst])
        target = np.where(target == worst, -1, target - (target > worst))
        names = names[:worst] + names[worst + 1 :]
    return target, names, tuple(missed)


def _dip(reference: Reference | None, n: int) -> float | None:
    """The dip, rad, where the reference tells it."""
    if reference is None or reference.kind not in ("horizontal-vertical", "vector"):
        return None
    level, down = reference.horizontal_and_vertical(n).T
    return float(np.arctan2(np.mean(down), np.mean(level)))


def make_prior(start: Array, mounting: Array, settings: Settings, dip: float | None) -> Prior:
    """What is known of the unknowns before any shot."""
    q = len(start)
    mean, information = np.zeros(q), np.zeros((q, q))
    mean[SHAPE_A][:3] = 1.0
    information[BIAS_A, BIAS_A] = np.eye(3) / settings.accelerometer_bias_sd**2
    information[SHAPE_A, SHAPE_A] = np.eye(6) / settings.accelerometer_shape_sd**2
    information[BIAS_M, BIAS_M] = np.eye(3) / WIDE**2
    mean[MATRIX_M] = mounting.ravel()
    # of M = (1 + [w]× + S) mounting, w a small turn and S symmetric, by the rows of M
    back = np.kron(np.eye(3), mounting.T)  # ravel(M mountingᵀ) = (1 ⊗ mounting) ravel(M)
    turn = np.array([skew(axis).ravel() for axis in np.eye(3)]).T * np.radians(settings.turn_sd_deg)
    six = unpack_symmetric(settings.soft_iron_sd * np.eye(6)).reshape(6, 9).T
    parts = np.hstack([turn, six])
    information[MATRIX_M, MATRIX_M] = back @ inverse(parts @ parts.T) @ back.T
    if dip is not None:
        mean[DIP], information[DIP, DIP] = dip, 1 / DIP_SD**2
    return Prior(mean, information)


def hold_sight(unknowns: Array) -> Array:
    """The information (q, q) that keeps the sight's length, or all of it where no target tells."""
    information = np.zeros((len(unknowns), len(unknowns)))
    sight = unknowns[SIGHT]
    held = np.outer(sight, sight) if len(unknowns) > TARGETS else np.eye(3)
    information[SIGHT, SIGHT] = FIXED * held
    return information
