"""Which recorded disturbers belong into a fit, and in which form: by readings not fitted.

At the solution without them, residuals r and Jacobian J are linear in what the disturbers add, for
that joins the bias. With the normal equations N_b = JᵀWJ, g_b = JᵀWr of each block of time b, the
fit of all blocks but b, and what it leaves in b, come without another fit:

    δ = (Σ_{a≠b} N_a + P)⁻¹ Σ_{a≠b} g_a,     left_b = r_bᵀWr_b − 2 δᵀg_b + δᵀN_bδ.

A set of sources is better by the mean over the blocks of what it leaves less, with the standard
error of that mean. What only goes with the attitude, as the throttle in a climb, shares its columns
with bias and matrix there, and explains nothing in blocks that were not fitted. Sources are added
one after the other while they are surely better, and the fit is made anew with each. How late they
are recorded is found in the same way.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from agonic.arrays import Array, Mask
from agonic.attitude.fit import estimate_usable, find_usable
from agonic.attitude.problem import find_terms, list_disturbers, normalise
from agonic.attitude.settings import Settings
from agonic.calibration.inputs import list_columns, parse_source
from agonic.health import Finding
from agonic.maths.equation.affine import FREE, SYMMETRIC, expand_covariates
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.leastsq import inverse
from agonic.reference import Reference
from agonic.samples import Samples

BLOCKS = 8
CHANCE = 0.05
"""How often a log without any disturber may have one taken, whatever the number of candidates."""
MATTERS = 0.03
"""Share of what is left that a source has to take away."""
ALIKE = 0.99
"""Correlation beyond which two columns cannot be told apart."""
MOST = 3
"""Sets of sources that are added, one after the other."""
HUBER = 1.345
NORMAL_MEDIAN = 0.6745
DELAYS_S = (-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""How late a source may be recorded: current sensors are filtered, outputs are early."""
MOST_ROWS = 20_000
_ROUNDS = 4
POWER = 1.5
"""Of the duty of a motor, for its current: thrust goes with its square, power with its cube."""


class Trial(NamedTuple):
    """A set of sources, the share of the residuals' squares that it takes away on blocks that were
    not fitted, the standard error of that share, and whether it was taken."""

    sources: tuple[str, ...]
    gain: float
    gain_sd: float
    taken: bool


class SourceChoice(NamedTuple):
    """The sources that were taken, and all that was tried, in order."""

    sources: tuple[str, ...]
    trials: tuple[Trial, ...]

    @property
    def gain(self) -> float:
        """The share of the residuals' squares that those taken take away together."""
        return 1.0 - float(np.prod([1.0 - one.gain for one in self.trials if one.taken]))


def choose_sources(
    samples: Samples, reference: Reference, channels: tuple[str, ...], settings: Settings
) -> SourceChoice:
    """The sources that lower what is left on unseen blocks of time, and all that was tried.

    Parameters as in `fit_channels`; candidates are the disturbers that the samples hold.
    """
    usable = find_usable(samples)
    candidates = list_candidates(samples.select(usable))
    chosen: tuple[str, ...] = ()
    trials: list[Trial] = []
    for _ in range(MOST):
        if not candidates:
            break
        sums = _sum_blocks(samples, reference, channels, settings, usable, chosen, candidates)
        tried = [_try(sums, one) for one in candidates]
        best = max(tried, key=lambda one: one.gain - one.gain_sd)
        surely = float(stdtrit(BLOCKS - 1, 1.0 - CHANCE / len(tried)))
        best = next((one for one in tried if _is_as_good(one, best, surely)), best)
        sure = _is_sure(best, surely)
        trials += [one._replace(taken=sure and one is best) for one in tried]
        if not sure:
            break
        chosen += best.sources
        candidates = [one for one in candidates if not _shares(one, chosen)]
        if samples.time is not None:
            late = _find_delay(samples, reference, channels, settings, usable, chosen, best.sources)
            chosen = tuple(late.get(one, one) for one in chosen)
    return SourceChoice(chosen, tuple(trials))


def _find_delay(
    samples: Samples,
    reference: Reference,
    channels: tuple[str, ...],
    settings: Settings,
    usable: Mask,
    chosen: tuple[str, ...],
    sources: tuple[str, ...],
) -> dict[str, str]:
    """The sources with the delay of their recording, by their names, where it surely shows.

    Delays of a grid are compared on unseen blocks like sources, the best with none; the least of
    the parabola through its neighbours is taken.
    """
    others = tuple(one for one in chosen if one not in sources)
    moved = [tuple(f"{one}@{by:g}" for one in sources) for by in DELAYS_S]
    sums = _sum_blocks(samples, reference, channels, settings, usable, others, moved)
    left = np.stack([np.log(sums.measure((one,))) for one in moved])
    best = int(np.argmin(left.mean(axis=1)))
    better = left[DELAYS_S.index(0.0)] - left[best]
    surely = float(stdtrit(BLOCKS - 1, 1.0 - CHANCE / len(moved)))
    if not better.mean() > surely * better.std(ddof=1) / np.sqrt(BLOCKS):
        return {}
    if not 0 < best < len(moved) - 1:
        return {one: f"{one}@{DELAYS_S[best]:g}" for one in sources}
    before, here, after = left.mean(axis=1)[best - 1 : best + 2]
    step = DELAYS_S[1] - DELAYS_S[0]
    by = DELAYS_S[best] + 0.5 * step * (before - after) / (before - 2 * here + after)
    return {one: f"{one}@{by:.2f}" for one in sources}


def list_candidates(samples: Samples) -> list[tuple[str, ...]]:
    """The sets of sources to try, the simplest first.

    Every column alone, as it is and, where it is a duty, as what a motor draws then; columns that
    differ in a number or an axis also as their sum and each for itself. Of columns that always
    move together only the first, or their sum, is a candidate.

    >>> turn = np.random.default_rng(0).normal(size=(2, 50))
    >>> sources = {"motor1_duty": abs(turn[0]), "motor2_duty": abs(turn[1])}
    >>> list_candidates(Samples(field=np.ones((50, 3)), disturbers=sources))[-2]
    ('motor1_duty^1.5', 'motor2_duty^1.5')
    """
    columns = samples.columns()
    families: dict[str, list[str]] = {}
    for name in list_moving(samples):
        families.setdefault(_MEMBER.sub("#", name), []).append(name)
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


_MEMBER = re.compile(r"\d+|(?<=_)[xyz](?=_)")
"""What tells the members of a family apart: motor1_duty, motor2_duty; torquer_x_Am2."""


_PARTS = re.compile(f"({_MEMBER.pattern})")


def is_duty(name: str) -> bool:
    """Whether a column is the duty of a motor, 0…1."""
    return name == "throttle" or name.endswith("_duty")


def _are_apart(columns: Sequence[Array]) -> bool:
    """Whether no column follows from the others."""
    x = np.stack(columns, axis=1)
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    information = np.linalg.inv(x.T @ x / len(x) + 1e-9 * np.eye(x.shape[1]))
    return bool(np.diag(information).max() < 1 / (1 - ALIKE**2))


def _try(sums: BlockSums, sources: tuple[str, ...]) -> Trial:
    """How much less is left of unseen blocks with these sources, by the mean of the logarithms."""
    ratio = np.log(sums.measure((sources,)) / sums.measure(()))
    left, sd = np.exp(ratio.mean()), ratio.std(ddof=1) / np.sqrt(BLOCKS)
    return Trial(sources, float(1.0 - left), float(left * sd), False)


def _is_as_good(one: Trial, best: Trial, surely: float) -> bool:
    """Whether a trial is not surely worse than the best, and itself surely better than nothing."""
    margin = max(MATTERS, best.gain_sd)
    return _is_sure(one, surely) and best.gain - one.gain < margin


def _is_sure(one: Trial, surely: float) -> bool:
    """Whether a trial takes away more than a trifle, and that by so many standard errors."""
    return one.gain > max(MATTERS, surely * one.gain_sd)


def _shares(sources: tuple[str, ...], chosen: tuple[str, ...]) -> bool:
    """Whether sources take a column that is taken."""
    return not set(list_columns(sources)).isdisjoint(list_columns(chosen))


def describe_sources(sources: Sequence[str]) -> str:
    """Sources and what they do, for a sentence: "the current moves".

    >>> describe_sources(("current_A",))
    'the current moves'
    >>> describe_sources(("motor1_duty^1.5", "motor2_duty^1.5", "heater_A"))
    'motor1…2_duty^1.5, heater_A move'
    """
    if tuple(sources) == ("current_A",):
        return "the current moves"
    one = len(sources) == 1 and "+" not in sources[0]
    return f"{name_sources(sources)} {'moves' if one else 'move'}"


def name_sources(sources: Sequence[str]) -> str:
    """Sources by name, those that differ in a number together.

    >>> name_sources(("esc1_A+esc2_A+esc3_A",)), name_sources(("rod_x_Am2", "rod_z_Am2"))
    ('the sum of esc1…3_A', 'rod_x…z_Am2')
    """
    named: list[str] = []
    families: dict[str, list[str]] = {}
    for source in sources:
        if "+" in source:
            columns, form = _split_form(source)
            named.append(f"the sum of {_join_numbers(columns)}{form}")
        else:
            families.setdefault(_MEMBER.sub("#", source), []).append(source)
    return ", ".join([*named, *(_join_numbers(family) for family in families.values())])


def _split_form(source: str) -> tuple[list[str], str]:
    """The columns of a sum, and the form in which they count."""
    columns = list(parse_source(source).columns)
    return columns, source.removeprefix("+".join(columns))


def _join_numbers(family: Sequence[str]) -> str:
    """Names that differ in one number or axis as one: motor1…4_duty, torquer_x…z_Am2."""
    first, last = (_PARTS.split(name) for name in (family[0], family[-1]))
    apart = [k for k, (one, other) in enumerate(zip(first, last, strict=False)) if one != other]
    if len(apart) != 1 or len(first) != len(last):
        return ", ".join(family)
    first[apart[0]] += f"…{last[apart[0]]}"
    return "".join(first)


def describe_gain(choice: SourceChoice) -> Finding | None:
    """What the sources are good for, on readings that were not fitted."""
    if not choice.sources:
        return None
    return Finding(
        "disturbers",
        "note",
        f"the readings move with {name_sources(choice.sources)}: with that, unseen parts of the "
        f"log leave {100 * choice.gain:.0f} % less in squares",
    )


class BlockSums(NamedTuple):
    """Normal equations of each block of time: information (B, p, p), scores (B, p), squares (B,).

    `prior` (p, p); `of` names the set of sources that each parameter belongs to, () for those of
    the fit itself.
    """

    information: Array
    scores: Array
    squares: Array
    prior: Array
    of: tuple[tuple[str, ...], ...]

    def measure(self, sets: Sequence[tuple[str, ...]]) -> Array:
        """What is left in each block, (B,), by the fits of the others with sets of sources."""
        keep = np.array([not own or own in sets for own in self.of])
        information, scores = self.information[:, keep][:, :, keep], self.scores[:, keep]
        prior = self.prior[np.ix_(keep, keep)]
        left = np.empty(len(scores))
        for b in range(len(scores)):
            others = np.arange(len(scores)) != b
            whole = information[others].sum(axis=0) + prior
            step = inverse(whole) @ scores[others].sum(axis=0)
            left[b] = self.squares[b] - 2 * step @ scores[b] + step @ information[b] @ step
        return left


def _sum_blocks(
    samples: Samples,
    reference: Reference,
    channels: tuple[str, ...],
    settings: Settings,
    usable: Mask,
    chosen: tuple[str, ...],
    candidates: Sequence[tuple[str, ...]],
) -> BlockSums:
    """The normal equations of a fit with the chosen sources, and of what candidates would add."""
    gauge: str = settings.gauge
    if gauge == "auto":
        gauge = SYMMETRIC if "dip" not in channels else FREE
    problem, _ = normalise(samples, reference, channels, gauge, replace(settings, sources=chosen))
    found = estimate_usable(problem, usable, settings)
    rows = np.flatnonzero(usable)
    rows = rows[:: -(-len(rows) // MOST_ROWS)]
    x = np.hstack([find_terms(samples, one)[rows] for one in candidates])
    terms = (x - x.mean(axis=0)) / np.maximum(x.std(axis=0), 1e-300)
    of = tuple(one for one in candidates for _ in one)
    return _add_up(problem.subset(rows), found, terms, of)


def _add_up(
    part: Problem, found: Estimate, terms: Array, of: tuple[tuple[str, ...], ...]
) -> BlockSums:
    """The sums of the blocks of the rows of a problem, with terms (n, k) that it does not have."""
    params, own = found.solution.params, len(found.solution.params)
    n, sides = len(part.points), []
    for channel in part.channels:
        given = zip(*pieces(part, channel)(params), strict=True)
        r, jacobian = (np.concatenate(side) for side in given)
        added = expand_covariates(jacobian[:, :3], terms)
        sides.append((r, np.hstack([jacobian, added])))
    sides = _weigh(sides)
    block = np.arange(n) * BLOCKS // n
    size = own + 3 * terms.shape[1]
    information, scores = np.zeros((BLOCKS, size, size)), np.zeros((BLOCKS, size))
    squares = np.zeros(BLOCKS)
    for r, jacobian in sides:
        for b in range(BLOCKS):
            here, by = r[block == b], jacobian[block == b]
            information[b] += by.T @ by
            scores[b] -= by.T @ here
            squares[b] += here @ here
    prior = np.zeros((size, size))
    held = part.prior(part.soft_iron_sd)
    if held is not None:
        _, by = held(params)
        prior[:own, :own] = by.T @ by
    prior[np.arange(own, size), np.arange(own, size)] += 1e-9 * n
    return BlockSums(information, scores, squares, prior, ((),) * own + of * 3)


def _weigh(sides: Sequence[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """Residuals and Jacobians over the noise, each row at its weight, by Huber's loss.

    The weights are those of a fit with everything in it, for what a disturber does stands out of a
    fit without it like an outlier. Of each channel the noise is that which the others leave it.
    """
    sizes = [_spread(r) for r, _ in sides]
    weights = [np.ones(len(r)) for r, _ in sides]
    for _ in range(_ROUNDS):
        scaled = [
            (r * np.sqrt(w) / sd, j * (np.sqrt(w) / sd)[:, None])
            for (r, j), w, sd in zip(sides, weights, sizes, strict=True)
        ]
        information = sum((j.T @ j for _, j in scaled), np.zeros(()))
        step = inverse(np.asarray(information)) @ sum((j.T @ r for r, j in scaled), np.zeros(()))
        left = [r - j @ step for r, j in sides]
        sizes = [_spread(one) for one in left]
        weights = [
            np.minimum(1.0, HUBER * sd / np.maximum(np.abs(one), 1e-300))
            for one, sd in zip(left, sizes, strict=True)
        ]
    return scaled


def _spread(residuals: Array) -> float:
    """The standard deviation by the median of the sizes."""
    return max(float(np.median(np.abs(residuals))) / NORMAL_MEDIAN, 1e-12)
