"""`fit_map`: the field of a region from readings at known places."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, fdtri

from agonic.arrays import Array, Index, Mask
from agonic.errors import AgonicError, CoverageError
from agonic.health import Finding, figure
from agonic.region.maths.equivalent_sources import (
    KNOWN_TO,
    Process,
    Readings,
    fit_process,
    make_features,
    predict,
    project,
)
from agonic.region.result import FieldMap

CITATIONS = ("solin-2018", "dampney-1969", "patterson-thompson-1971")
DISTANCES = tuple(np.geomspace(0.15, 1.2, 5))
"""Distances of the sources over half the longest side of the readings' box: nearer ones make a
field that readings of a room do not resolve, farther ones one that is linear in it."""
MAX_READINGS = 500
"""That are fitted as they are; of more, those that lie together are averaged."""
MIN_PLACES = 8
"""24 numbers for uniform field and gradient, 8 unknowns, noise, distance, amplitude."""
BY_CHANCE = 0.003
"""Chance that a reading is left out of a map whose readings are all right: 3 σ of a normal one."""
TAIL_FREEDOM = 6.0
"""Degrees of freedom of what readings left out differ by: a source near one makes more of it than a
Gaussian process has. Of 40 simulated rooms whose readings are right (tests/region), at most one has
a reading left out."""


def fit_map(
    position: ArrayLike,
    field: ArrayLike,
    *,
    noise: float | None = None,
    position_sd_m: float = 0.0,
    measure_next: int = 5,
    name: str = "region",
) -> FieldMap:
    """Direction, strength and gradient of the field of a region, from readings at known places.

        f(x) = u + Σⱼ T(x − sⱼ) wⱼ,   wⱼ ~ N(0, a² 1)

    A Gaussian process of dipoles on a box around the readings, so that the field has neither curl
    nor divergence; u is uniform and free. Distance of the dipoles, amplitude and noise are those of
    the restricted likelihood, averaged over the distances that are likely. A reading that
    contradicts all others by far, as one at a wrong place does, is left out and named.

    Parameters
    ----------
    position : (n, 3) where the readings were taken, m, in axes that stand still.
    field : (n, 3) calibrated readings along the same axes, nT.
    noise : standard deviation of a reading on an axis, nT, where it is known to some 20 %; readings
        that contradict it are believed, and that is said.
    position_sd_m : standard deviation of each coordinate of a place.
    measure_next : how many places to name where readings would tell most.
    name : of the region.

    Returns a `FieldMap`; `.at(places)` gives field, gradient and their standard errors. Raises
    `CoverageError` where there are fewer than eight readings or all lie in one place, `AgonicError`
    where rows do not match or are no numbers.

    Source: Solin, Kok, Wahlström, Schön & Särkkä (2018); equivalent sources: Dampney (1969);
    restricted likelihood: Patterson & Thompson (1971).

    >>> rng = np.random.default_rng(1)
    >>> places = rng.uniform(0, 2, (60, 3))
    >>> truth = [18e3, 0, 44e3] + 500 * places @ np.diag([1, 1, -2])
    >>> made = fit_map(places, truth + rng.normal(0, 20, (60, 3)))
    >>> here = made.at([[1.0, 1.0, 1.0]])
    >>> bool((abs(here.field - [18_500, 500, 43_000]) < 4 * here.sd).all()), made.verdict
    (True, 'good')
    """
    at, values = _check(position, field)
    prior, kept = noise, np.ones(len(at), dtype=bool)
    while True:
        readings, members = _average_near(at[kept], values[kept])
        processes, weights, surprise = _fit_all(readings, prior, position_sd_m)
        best = processes[int(np.argmax(weights))]
        noise_sd = _estimate_noise_sd(best, readings)
        said = _object_to_noise(best.noise**0.5, noise_sd, prior)
        if said:  # the readings are believed
            prior = None
            continue
        worst = find_contradiction(readings, best, surprise, prior)
        if worst is None or (~kept).sum() >= len(at) // 10:
            break
        kept[np.flatnonzero(kept)[members == worst]] = False
    if prior != noise:
        said = _object_to_noise(best.noise**0.5, noise_sd, noise)
    elif worst is not None:
        said = "more than a tenth of the readings contradict the others"
    low, high = readings.box
    return FieldMap(
        name=name,
        readings=readings,
        processes=tuple(processes),
        weights=weights,
        low=low,
        high=high,
        noise=best.noise**0.5,
        noise_sd=noise_sd,
        distance=best.distance,
        left_out=~kept,
        next_places=choose_next(best, readings.box, measure_next),
        surprise=float(surprise.mean() / 3),
        findings=_judge(at, kept, said),
    )


def _check(position: ArrayLike, field: ArrayLike) -> tuple[Array, Array]:
    """Places and readings (n, 3) that a map can be made of."""
    at, values = (np.asarray(one, dtype=np.float64) for one in (position, field))
    if at.shape != values.shape or at.ndim != 2 or at.shape[1] != 3:
        raise AgonicError(
            f"places have the shape {at.shape} and readings {values.shape}; both need (n, 3)"
        )
    if not (np.isfinite(at).all() and np.isfinite(values).all()):
        raise AgonicError("places or readings are not numbers in some rows; leave those out")
    if len(np.unique(at, axis=0)) < MIN_PLACES or not np.ptp(at, axis=0).max() > 0:
        raise CoverageError(
            f"{len(np.unique(at, axis=0))} different places are too few for a map; measure at "
            f"{MIN_PLACES} or more, all over the region",
        )
    return at, values


def _average_near(at: Array, values: Array) -> tuple[Readings, Index]:
    """The readings, or of many the means of those in one cell, and the cell of each (n,)."""
    members, size = np.arange(len(at)), float(np.ptp(at, axis=0).max()) / len(at)
    while members.max() >= MAX_READINGS:
        cells = np.floor((at - at.min(axis=0)) / size)
        members = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
        size *= 1.1
    counts = np.bincount(members).astype(float)
    sums = [np.bincount(members, one) for one in np.concatenate([at, values], axis=1).T]
    means = np.stack(sums, axis=1) / counts[:, None]
    return Readings(means[:, :3], means[:, 3:], counts), members


def _fit_all(
    readings: Readings, noise: float | None, position_sd_m: float
) -> tuple[list[Process], Array, Array]:
    """The processes that are likely, their weights, and χ² of each reading by the best."""
    box = readings.box
    half = float((box[1] - box[0]).max()) / 2
    made = [fit_process(readings, box, half * one, noise) for one in DISTANCES]
    best, _ = min(made, key=lambda one: one[0].cost)
    if position_sd_m > 0:
        tried = _list_weights(readings, best, position_sd_m)
        every = [(fit_process(one, box, best.distance, noise), one) for one in tried]
        likeliest, readings = min(every, key=lambda one: one[0][0].cost + one[1].weighing)
        made = [likeliest]
    for finer in (0.77, 0.88, 1.14, 1.3):
        made.append(fit_process(readings, box, best.distance * finer, noise))
    made.sort(key=lambda one: one[0].cost)
    costs = np.array([process.cost for process, _ in made])
    weights = np.exp(-0.5 * (costs - costs[0]))[costs < costs[0] + 8.0]  # 2 % of the best's
    likely = [process for process, _ in made[: len(weights)]]
    return likely, weights / weights.sum(), made[0][1]


def _list_weights(readings: Readings, process: Process, position_sd_m: float) -> Iterator[Readings]:
    """The readings with the weights that errors of their places leave them beside a noise: that of
    a process which took all for noise, and halves of it."""
    gradient = predict(process, readings.position)[0][:, 3:]
    moved = position_sd_m**2 * np.square(gradient).sum(axis=1) / 3
    for halved in 0.5 ** np.arange(7):
        weight = readings.weight / (1 + moved / (process.noise * halved**2))
        yield readings._replace(weight=weight)


def find_contradiction(
    readings: Readings, process: Process, surprise: Array, noise: float | None = None
) -> int | None:
    """The reading that contradicts all others beyond chance, None without any.

    Judged by a process that is fitted to the others alone, for a wrong place makes the noise larger
    too: the χ² of a reading is beyond the tail, or beyond that of a normal distribution and the
    noise falls by three standard errors without it.
    """
    chance = 1 - BY_CHANCE / len(surprise)
    normal, tail = float(chdtri(3, 1 - chance)), 3 * float(fdtri(3, TAIL_FREEDOM, chance))
    fall = 1 + 3 * _estimate_noise_sd(process, readings) / process.noise**0.5
    found = []
    for k in np.argsort(-surprise)[:4].tolist():  # one wrong place makes others look wrong too
        others = Readings(*(np.delete(column, k, axis=0) for column in readings))
        without, _ = fit_process(others, readings.box, process.distance, noise)
        there, covariance = predict(without, readings.position[[k]])
        spread = covariance[0, :3, :3] + without.noise / readings.weight[k] * np.eye(3)
        error = readings.field[k] - there[0, :3]
        square = float(error @ np.linalg.solve(spread, error))
        falls = process.noise > without.noise * fall**2
        if square > tail or (square > normal and falls):
            gain = process.cost - without.cost - float(np.linalg.slogdet(spread)[1])
            found.append((gain, k))
    return max(found)[1] if found else None


def _estimate_noise_sd(process: Process, readings: Readings) -> float:
    """Standard error of the noise, by the degrees of freedom that the process leaves, nT."""
    left = 3 * len(readings.field) - 3 - float(process.share.sum())
    return float(np.sqrt(process.noise / (2 * max(left, 1.0))))


def choose_next(process: Process, box: tuple[Array, Array], many: int) -> Array:
    """The places (k, 3) of a grid over a box where a reading would tell most: each lowers the
    variance over the whole box most, once those before it are measured (Cohn 1996)."""
    sides = box[1] - box[0]
    step = max(float(sides.max()) / 8, 1e-9)
    axes = [np.linspace(a, b, round((b - a) / step) + 1) for a, b in zip(*box, strict=True)]
    at = np.array(list(product(*axes)))
    features = make_features(at, process.sources, process.scale) - process.mean[1]
    spread = project(process, features.reshape(1, 3 * len(at), -1))[1][0]
    chosen, each = [], np.arange(len(at))
    for _ in range(many):
        of_places = spread.reshape(len(at), 3, -1)
        across = of_places @ of_places.swapaxes(1, 2)  # the blocks on the diagonal of its square
        own = spread.reshape(len(at), 3, len(at), 3)[each, :, each]
        told = np.linalg.solve(own + process.noise * np.eye(3), across)
        k = int(np.argmax(np.trace(told, axis1=1, axis2=2)))
        rows = slice(3 * k, 3 * k + 3)
        gain = np.linalg.solve(spread[rows, rows] + process.noise * np.eye(3), spread[rows])
        spread = spread - spread[:, rows] @ gain
        chosen.append(at[k])
    return np.reshape(chosen, (-1, 3))


def _judge(at: Array, kept: Mask, said: str) -> tuple[Finding, ...]:
    """What is wrong with the readings; of their noise it is `said`."""
    findings = []
    if not kept.all():
        where = "; ".join(f"({x:.2f}, {y:.2f}, {z:.2f}) m" for x, y, z in at[~kept][:5])
        findings.append(
            Finding(
                "outliers",
                "check",
                f"{(~kept).sum()} of {len(at)} readings contradict all others and were left out: "
                f"at {where}",
                "check where they were taken, and what stood beside the sensor; measure them again",
            )
        )
    if said:
        findings.append(
            Finding(
                "noise",
                "check",
                said,
                "check the places and the time of the readings: they may be worse known than "
                "stated, something magnetic may stand among them, or the field changed meanwhile",
            )
        )
    return tuple(findings)


def _object_to_noise(found: float, sd: float, stated: float | None) -> str:
    """What is wrong with the noise that readings show, "" where nothing is."""
    if stated is not None and abs(np.log(found / stated)) > 3 * np.hypot(sd / found, KNOWN_TO):
        return (
            f"readings scatter by {figure(found)} ± {figure(sd)} nT about the map, and "
            f"{figure(stated)} nT are stated"
        )
    return ""
