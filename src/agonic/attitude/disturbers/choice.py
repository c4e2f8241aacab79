"""Which recorded disturbers belong into a fit, and in which form: by readings not fitted.

At the solution without them, residuals r and Jacobian J are linear in what the disturbers add, for
that joins the bias. With the normal equations N_b = JᵀWJ, g_b = JᵀWr of each block of time b, the
fit of all blocks but b, and what it leaves in b, come without another fit:

    δ = (Σ_{a≠b} N_a + P)⁻¹ Σ_{a≠b} g_a,     left_b = r_bᵀWr_b − 2 δᵀg_b + δᵀN_bδ.

A set of sources is better by the mean over the blocks of what it leaves less, with the standard
error of that mean. What only goes with the attitude, as the throttle in a climb, shares its columns
with bias and matrix there, and explains nothing in blocks that were not fitted. Sources are added
one after the other while they are surely better, and the fit is made anew with each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from agonic.arrays import Array
from agonic.attitude.disturbers.block_sums import BLOCKS, BlockSums, Log, sum_blocks
from agonic.attitude.disturbers.shape import Shape, find_shapes, list_followed
from agonic.attitude.fit import find_usable
from agonic.attitude.problem import find_terms
from agonic.attitude.settings import Settings
from agonic.calibration.inputs import list_disturbers
from agonic.calibration.sources import MEMBER, list_columns, name_sources
from agonic.health import FEWEST, Finding
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.reference import Reference
from agonic.samples import Samples

CHANCE = 0.05
"""How often a log without any disturber may have one taken, whatever the number of candidates."""
MATTERS = 0.03
"""Share of what is left that a source has to take away."""
ALIKE = 0.99
"""Correlation beyond which two columns cannot be told apart."""
MOST = 3
"""Sets of sources that are added, one after the other."""
LIKELY = 2
"""Sets that are tried once more with time constants, where none is surely better as it is."""
POWER = 1.5
"""Of the duty of a motor, for its current: thrust goes with its square, power with its cube."""


class Trial(NamedTuple):
    """A set of sources, the share of the residuals' squares that it takes away on blocks that were
    not fitted, the standard error of that share, and whether it was taken; `followed` where the
    field followed it slowly."""

    sources: tuple[str, ...]
    gain: float
    gain_sd: float
    taken: bool
    followed: bool = False


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


def choose_sources(
    samples: Samples,
    reference: Reference,
    channels: tuple[str, ...],
    settings: Settings,
    estimates: dict[tuple[str, ...], Estimate] | None = None,
) -> SourceChoice:
    """The sources that lower what is left on unseen blocks of time, and all that was tried.

    Parameters as in `fit_channels`; candidates are the disturbers that the samples hold, and
    `estimates` takes the estimate with each set of sources that was a fit on the way.
    """
    kept = {} if estimates is None else estimates
    log = Log(samples, reference, channels, settings, find_usable(samples), kept)
    candidates = list_candidates(samples.select(log.usable))
    chosen: tuple[str, ...] = ()
    trials: list[Trial] = []
    shapes: list[Shape] = []
    alike: list[tuple[str, ...]] = []
    for _ in range(MOST):
        if not candidates:
            break
        tried = _compare(log, chosen, candidates)
        trials += tried
        taken = next((one for one in tried if one.taken), None)
        if taken is None:
            break
        shaped, found = find_shapes(log, chosen, taken.sources)
        if taken.followed and not any(one.what == "time constant" for one in found):
            trials[-1] = taken._replace(taken=False)
            break
        chosen, shapes = chosen + shaped, shapes + found
        left = [one for one in candidates if not _shares(one, chosen)]
        candidates = [one for one in left if not _is_alike(samples, one, chosen)]
        alike += [one for one in left if one not in candidates]
    return SourceChoice(chosen, tuple(trials), tuple(shapes), tuple(alike))


def _compare(
    log: Log, chosen: tuple[str, ...], candidates: Sequence[tuple[str, ...]]
) -> list[Trial]:
    """The candidates beside those chosen, one of them taken where one is surely better.

    Where none is, the field may follow what is switched so slowly that only a filter shows it: the
    likeliest are tried once more with several time constants.
    """
    sums = sum_blocks(log, chosen, candidates)
    tried = [_try(sums, one) for one in candidates]
    surely = _find_surely(len(tried))
    best = max(tried, key=lambda one: one.gain - one.gain_sd)
    best = next((one for one in tried if _is_as_good(one, best, surely)), best)
    if _is_sure(best, surely):
        return [one._replace(taken=one is best) for one in tried]
    likely = sorted(tried, key=lambda one: -one.gain)[:LIKELY]
    if log.samples.time is None or len(log.samples) < FEWEST:
        return tried
    followed = {
        later: one.sources for one in likely for later in list_followed(log.samples, one.sources)
    }
    sums = sum_blocks(log, chosen, list(followed))
    best = max((_try(sums, one) for one in followed), key=lambda one: one.gain - one.gain_sd)
    if _is_sure(best, _find_surely(len(tried) + len(followed))):
        tried.append(best._replace(sources=followed[best.sources], taken=True, followed=True))
    return tried


def _find_surely(count: int) -> float:
    """By how many standard errors the best of so many has to be better."""
    return float(stdtrit(BLOCKS - 1, 1.0 - CHANCE / count))


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


def _is_alike(samples: Samples, sources: tuple[str, ...], chosen: tuple[str, ...]) -> bool:
    """Whether those chosen tell all of these sources, so that the two cannot be told apart."""
    basis = np.column_stack([np.ones(len(samples)), find_terms(samples, chosen)])
    x = find_terms(samples, sources)
    left = x - basis @ np.linalg.lstsq(basis, x, rcond=None)[0]
    return bool((left.var(axis=0) < (1 - ALIKE**2) * x.var(axis=0)).all())


def _shares(sources: tuple[str, ...], chosen: tuple[str, ...]) -> bool:
    """Whether sources take a column that is taken."""
    return not set(list_columns(sources)).isdisjoint(list_columns(chosen))


def describe_gain(choice: SourceChoice) -> Finding | None:
    """What the sources are good for, on readings that were not fitted."""
    if not choice.sources:
        return None
    shaped = [f"; {one.describe()}" for one in choice.shapes]
    names = dict.fromkeys(name for one in choice.alike for name in list_columns(one))
    if names:
        shaped.append(f"; {', '.join(names)} moved with that and cannot be told from it")
    return Finding(
        "disturbers",
        "note",
        f"the readings move with {name_sources(choice.sources)}: with that, unseen parts of the "
        f"log leave {100 * choice.gain:.0f} % less in squares{''.join(shaped)}",
    )
