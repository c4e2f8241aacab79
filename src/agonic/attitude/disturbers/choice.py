"""Which recorded disturbers belong into a fit, and in which form; and whether a recording tells
what each of them does.

Every set of sources is a term of the one model (`model.recorded`): it competes with drifts, bends
and noise with memory for the residuals of the fit without it. The set that explains most is added,
in the shape that suits it best, and the fit is made anew, while any explains something.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.attitude.disturbers.shape import (
    Log,
    Shape,
    find_shapes,
    list_timings,
    respell,
    weigh_sources,
)
from agonic.attitude.fit import find_usable
from agonic.attitude.problem import Settings, find_terms
from agonic.calibration.sources import MEMBER, list_columns, list_disturbers, name_sources
from agonic.errors import LogError
from agonic.health import Finding
from agonic.maths.rotations.attitude import down_b, rot_nb
from agonic.model.recorded import Weighed
from agonic.reference import Reference
from agonic.samples import Samples

ALIKE = 0.99
"""Correlation beyond which two columns cannot be told apart."""
MAX_SETS = 3
"""Sets of sources that are added, one after the other."""
SETS_TIMED = 2
"""Sets that are tried once more with time constants, where none is surely better as it is."""
POWER = 1.5
"""Of the duty of a motor, for its current: thrust goes with its square, power with its cube."""


class Trial(NamedTuple):
    """A set of sources, the share of the residuals' squares that it takes away on blocks that were
    not fitted, the standard error of that share, whether it was taken, and the log-odds that it
    disturbs."""

    sources: tuple[str, ...]
    gain: float
    gain_sd: float
    taken: bool
    odds: float


class SourceChoice(NamedTuple):
    """The sources that were taken, all that was tried, in order, the shapes that were found, and
    what cannot be told from those taken, since it moves with them."""

    sources: tuple[str, ...]
    trials: tuple[Trial, ...]
    shapes: tuple[Shape, ...] = ()
    alike: tuple[tuple[str, ...], ...] = ()

    @property
    def gain(self) -> float:
        """The share of the residuals' squares that those taken take away together."""
        return 1.0 - float(np.prod([1.0 - one.gain for one in self.trials if one.taken]))


def choose_sources(samples: Samples, reference: Reference, settings: Settings) -> SourceChoice:
    """The sources that disturb, by the steadiness of the magnitude, and all that was tried. Errors
    of an attitude last and go with it, as a throttle in a climb does: the magnitude has none.
    Parameters as in `fit_channels`; candidates are the disturbers that the samples hold."""
    log = Log(samples, reference, settings, find_usable(samples), {})
    candidates = list_candidates(samples.select(log.usable))
    chosen: tuple[str, ...] = ()
    trials: list[Trial] = []
    shapes: list[Shape] = []
    alike: list[tuple[str, ...]] = []
    for _ in range(MAX_SETS):
        left = [one for one in candidates if {*list_columns(one)}.isdisjoint(list_columns(chosen))]
        told = [one for one in left if _is_alike(log.samples, one, chosen)]
        alike += [one for one in told if one not in alike]
        left = [one for one in left if one not in told]
        tried = _compare(log, chosen, left) if left else []
        trials += tried
        taken = next((one for one in tried if one.taken), None)
        if taken is None:
            break
        shaped, more = find_shapes(log, chosen, taken.sources)
        chosen, shapes = chosen + shaped, shapes + more
    return SourceChoice(chosen, tuple(trials), tuple(shapes), tuple(alike))


def _compare(
    log: Log, chosen: tuple[str, ...], candidates: Sequence[tuple[str, ...]]
) -> list[Trial]:
    """The candidates beside those chosen, that one taken which explains most. Where none explains
    anything, the field may follow what is switched late or slowly: the likeliest are tried once
    more in all their timings."""
    weighed = weigh_sources(log, chosen, candidates)
    if weighed is None:
        return []
    tried = [_make_trial(sources, weighed, i) for i, sources in enumerate(candidates)]
    sure = weighed.find_sure()
    if sure is not None:
        best = candidates[sure]
        alike = [
            i
            for i, one in enumerate(candidates)
            if _is_alike(log.samples, one, best) and _is_alike(log.samples, best, one)
        ]
        # of those that cannot be told apart the first: a current before a throttle that makes it
        first = min(alike, default=sure)
        tried[first] = tried[first]._replace(taken=True)
        return tried
    if log.samples.time is None:
        return tried
    likely = np.argsort(-weighed.odds)[:SETS_TIMED]
    timings = list_timings(log.samples)
    timed = [(i, respell(candidates[i], *one)) for i in likely for one in timings]
    weighed = weigh_sources(log, chosen, [later for _, later in timed])
    sure = None if weighed is None else weighed.find_sure()
    if weighed is not None and sure is not None:
        i = timed[sure][0]
        tried[i] = _make_trial(candidates[i], weighed, sure)._replace(taken=True)
    return tried


def _make_trial(sources: tuple[str, ...], weighed: Weighed, i: int) -> Trial:
    left = weighed.measure_left(i)
    gain = float(1.0 - np.exp(left.mean()))
    sd = (1.0 - gain) * float(left.std(ddof=1)) / np.sqrt(len(left))
    return Trial(sources, gain, float(sd), False, float(weighed.odds[i]))


def list_candidates(samples: Samples) -> list[tuple[str, ...]]:
    """The sets of sources to try, the simplest first. Every column alone, as it is and, where it is
    a duty, as what a motor draws then; columns that differ in a number or an axis also as their sum
    and each for itself. Of columns that always move together only the first, or their sum, is a
    candidate."""
    columns = samples.columns()
    families: dict[str, list[str]] = {}
    for name in list_moving(samples):
        families.setdefault(MEMBER.sub("#", name), []).append(name)
    found: list[tuple[str, ...]] = []
    for family in families.values():
        forms = (f"^{POWER:g}", "") if is_duty(family[0]) else ("",)
        apart = _are_apart([columns[name] for name in family])
        for form in forms:
            found.append((f"{'+'.join(family)}{form}",))
        if len(family) > 1 and apart:
            found += [tuple(f"{name}{form}" for name in family) for form in forms]
    return found


def list_moving(samples: Samples) -> list[str]:
    """The disturbers of the samples that change."""
    columns = samples.columns()
    names = [name for name in list_disturbers(samples) if name != "second"]
    return [name for name in names if float(np.ptp(columns[name])) > 0.0]


def is_duty(name: str) -> bool:
    """Whether a column is the duty of a motor, 0…1."""
    return name == "throttle" or name.endswith("_duty")


def _are_apart(columns: Sequence[Array]) -> bool:
    """Whether no column follows from the others."""
    x = np.stack(columns, axis=1)
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    information = np.linalg.inv(x.T @ x / len(x) + 1e-9 * np.eye(x.shape[1]))
    return bool(np.diag(information).max() < 1 / (1 - ALIKE**2))


def _is_alike(samples: Samples, sources: tuple[str, ...], chosen: tuple[str, ...]) -> bool:
    """Whether those chosen tell all of these sources, so that the two cannot be told apart."""
    basis = np.column_stack([np.ones(len(samples)), find_terms(samples, chosen)])
    x = find_terms(samples, sources)
    left = x - basis @ np.linalg.lstsq(basis, x, rcond=None)[0]
    return bool((left.var(axis=0) < (1 - ALIKE**2) * x.var(axis=0)).all())


def describe_gain(choice: SourceChoice) -> Finding | None:
    """What the sources are good for, on readings that were not fitted."""
    if not choice.sources:
        return None
    shaped = [f"; {one.describe()}" for one in choice.shapes]
    names = dict.fromkeys(name for one in choice.alike for name in list_columns(one))
    if names:
        shaped.append(
            f"; {', '.join(names)} changed together with it and cannot be separated from it"
        )
    less = ""
    if choice.gain > 0.01:
        less = f": that reduces the variance of held-out residuals by {100 * choice.gain:.0f} %"
    what = f"the readings move with {name_sources(choice.sources)}{less}{''.join(shaped)}"
    return Finding("disturbers", "note", what)


MIN_OWN_SHARE = 0.1
"""Share of a column's changes that must be its own: the standard error grows by 1/√share."""
MIN_ALONG = 0.9
"""Correlation from which a column is named as one that moves along."""
NOISE_NT = 300.0


@dataclass(frozen=True, kw_only=True)
class JudgedDisturber:
    """What a recording tells of one source. `share` of its changes that neither the others nor the
    attitude explain, 0…1; `attitude` the share that the attitude alone explains; `along` the others
    that move with it; `sd` the standard error, nT per unit, of what it adds to an axis; `move` what
    to record, "" where nothing is missing."""

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
    beside = zip(sources, np.abs(correlation) > MIN_ALONG, strict=True)
    along = tuple(one for j, (one, moves) in enumerate(beside) if j != k and moves)
    apart, move = max(share, 1e-6), ""
    if share < MIN_OWN_SHARE and along:
        move = f"switch it by itself: it moves together with {name_sources(along)}"
    elif share < MIN_OWN_SHARE:
        move = "change it alone: in this log the others and the attitude together explain it"
        if attitude > 1.0 - MIN_OWN_SHARE:
            move = (
                "change it while the vehicle keeps its attitude: it only followed the attitude here"
            )
    return JudgedDisturber(
        source=sources[k],
        low=float(column.min()),
        high=float(column.max()),
        share=share,
        attitude=attitude,
        along=along,
        sd=noise / (spread * np.sqrt(len(x) * apart)),
        move=move,
    )


def _explain(column: Array, others: Array) -> float:
    """R² of a column on others (n, m) and a constant."""
    if not others.shape[1]:
        return 0.0
    basis = np.column_stack([np.ones(len(column)), others])
    left = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
    return float(np.clip(1.0 - left.var() / column.var(), 0.0, 1.0))


def _describe_turning(samples: Samples) -> Array:
    """Functions of the attitude (n, m) that bias and matrix could stand for; few without any. The
    field in the body's axes and its products, from roll, pitch and heading; from roll and pitch
    down alone; from the readings where there is no attitude."""
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
