"""`judge_disturbers`: whether a recording tells what each disturber does, and what to add."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array
from agonic.attitude.disturbers.choice import POWER, is_duty, list_moving
from agonic.attitude.problem import find_terms
from agonic.calibration.sources import name_sources
from agonic.errors import LogError
from agonic.maths.rotations.attitude import down_b, rot_nb
from agonic.samples import Samples

LITTLE = 0.1
"""Share of a column's changes that must be its own: the standard error grows by 1/√share."""
ALIKE = 0.9
"""Correlation from which a column is named as one that moves along."""
NOISE_NT = 300.0


@dataclass(frozen=True, kw_only=True)
class JudgedDisturber:
    """What a recording tells of one source.

    `share` of its changes that neither the others nor the attitude explain, 0…1; `attitude` the
    share that the attitude alone explains; `along` the others that move with it; `sd` the standard
    error, nT per unit, of what it adds to an axis; `move` what to record, "" where nothing is
    missing.
    """

    source: str
    low: float
    high: float
    share: float
    attitude: float
    along: tuple[str, ...]
    sd: float
    move: str


def judge_disturbers(samples: Samples, *, noise: float = NOISE_NT) -> tuple[JudgedDisturber, ...]:
    """Whether the disturbers of a recording can be told apart, from each other and from the iron.

        share = 1 − R²,   sd = noise / (s √(n share))

    with R² of a source on all others and on the attitude, s its standard deviation, n rows. A duty
    counts as the current of a motor does, to the power 1.5.

    Parameters: samples with `disturbers` (or a current, a throttle); `noise` of one reading, nT.
    Raises `LogError` where nothing recorded changes.

    >>> heater = np.tile([0.0, 0.0, 1.0, 1.0], 50)
    >>> turn = np.linspace(0, 6, 200)
    >>> level = np.stack([np.cos(turn), np.sin(turn), np.ones(200)], axis=1)
    >>> one, = judge_disturbers(Samples(field=4e4 * level, disturbers={"heater_A": heater}))
    >>> one.share > 0.9, round(one.sd)
    (True, 42)
    """
    names = list_moving(samples)
    if not names:
        raise LogError(
            f"{samples.name}: nothing that could disturb changes in this log; record the currents, "
            "the duties of the motors, or what is switched on board, and switch it while recording"
        )
    sources = [f"{name}^{POWER:g}" if is_duty(name) else name for name in names]
    x = find_terms(samples, tuple(sources))
    turning = _describe_turning(samples)
    return tuple(_judge(k, sources, x, turning, noise) for k in range(len(sources)))


def _judge(k: int, sources: list[str], x: Array, turning: Array, noise: float) -> JudgedDisturber:
    column, others = x[:, k], np.delete(x, k, axis=1)
    spread = float(column.std())
    attitude = _explain(column, turning)
    share = 1.0 - _explain(column, np.hstack([others, turning]))
    correlation = np.atleast_2d(np.corrcoef(x.T))[k]
    along = tuple(one for j, one in enumerate(sources) if j != k and abs(correlation[j]) > ALIKE)
    apart = max(share, 1e-6)
    return JudgedDisturber(
        source=sources[k],
        low=float(column.min()),
        high=float(column.max()),
        share=share,
        attitude=attitude,
        along=along,
        sd=noise / (spread * np.sqrt(len(x) * apart)),
        move=_advise(share, attitude, along),
    )


def _advise(share: float, attitude: float, along: tuple[str, ...]) -> str:
    """What to record so that a source is told from the rest."""
    if share >= LITTLE:
        return ""
    if along:
        return f"switch it by itself: it moves together with {name_sources(along)}"
    if attitude > 1.0 - LITTLE:
        return "change it while the vehicle keeps its attitude: it only followed the attitude here"
    return "change it alone: in this log the others and the attitude together explain it"


def _explain(column: Array, others: Array) -> float:
    """R² of a column on others (n, m) and a constant."""
    if not others.shape[1]:
        return 0.0
    basis = np.column_stack([np.ones(len(column)), others])
    left = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
    return float(np.clip(1.0 - left.var() / column.var(), 0.0, 1.0))


def _describe_turning(samples: Samples) -> Array:
    """Functions of the attitude (n, m) that bias and matrix could stand for; few without any.

    The field in the body's axes and its products, from roll, pitch and heading; from roll and pitch
    down alone; from the readings where there is no attitude.
    """
    if samples.roll_deg is None or samples.pitch_deg is None:
        of_body = samples.field - samples.field.mean(axis=0)
    elif samples.heading_deg is None:
        of_body = down_b(samples.roll_deg, samples.pitch_deg)
    else:
        turn = rot_nb(samples.roll_deg, samples.pitch_deg, samples.heading_deg)
        of_body = np.concatenate([turn[:, 0], turn[:, 2]], axis=1)
    of_body = of_body / max(float(np.abs(of_body).max()), 1e-300)
    products = [of_body[:, i] * of_body[:, j] for i in range(3) for j in range(i, 3)]
    return np.column_stack([of_body, *products])
