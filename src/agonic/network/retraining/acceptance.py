"""Whether a candidate replaces what is running, and the reason."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.retraining import RetrainerParams, Window
from agonic.health import figure
from agonic.maths.estimation.noise.residuals import correlation_length, robust_scale
from agonic.network.fit.fit import OUTLIERS_DOUBTFUL
from agonic.network.fit.result import CERTAIN

OUTLIER = 6.0
"""Standard deviations from which on a reading is an outlier."""


class Judgement(NamedTuple):
    """Accepted or not, why, whether the readings are at fault, and unseen rms errors, nT."""

    accepted: bool
    reason: str
    poisoned: bool
    running_rms: float = float("nan")
    candidate_rms: float = float("nan")


class Unseen(NamedTuple):
    """What a judge has of held-out readings: errors (k, o) nT by what runs, None before the first,
    and by the candidate; how far that moves the field, as a share of it; and the noise, nT, of what
    runs while nothing was wrong, where it is known."""

    running: Array | None
    candidate: Array
    moves: float
    strength: float
    noise: float | None


def find_stuck(window: Window) -> str:
    """What is wrong with readings that stay the same, or nothing."""
    still = np.concatenate([[False], (np.diff(window.raw, axis=0) == 0).all(axis=1), [False]])
    edges = np.flatnonzero(still[1:] != still[:-1])
    longest = int((edges[1::2] - edges[::2]).max(initial=0)) + 1
    # a reading that stays the same for so much of a window is that of a stuck sensor
    if longest < max(20, 0.1 * len(window)):
        return ""
    return f"the sensor is stuck: {longest} of {len(window)} readings are one and the same"


def has_changed(errors: Array, noise: float | None, params: RetrainerParams) -> bool:
    """Whether errors (k, o) since an alarm are so large that it is another sensor now.

    Where they are less, it had not been learned well, and what was seen before still counts.
    """
    return noise is None or _rms(errors) > params.misfit * noise


def judge(unseen: Unseen, params: RetrainerParams, *others: tuple[Array, Array]) -> Judgement:
    """The judgement on a candidate; what is running wins ties.

    `others` are errors of the candidate and of what is running on other readings, as those of the
    reservoir, that count alike.
    """
    candidate, running = unseen.candidate, unseen.running
    fitting = _select_fitting(candidate, running)
    outliers = 1.0 - float(fitting.mean())
    if outliers > OUTLIERS_DOUBTFUL:
        return Judgement(
            False,
            f"outliers: {figure(100 * outliers)} % of the unseen readings fit neither the "
            "candidate nor what is running",
            True,
        )
    made = _rms(candidate[fitting])
    before = float("nan") if running is None else _rms(running[fitting])
    wrong = _doubt_reference(unseen, made, params)
    if wrong:
        return Judgement(False, wrong, True, before, made)
    errors, accepted = f"{figure(made, 3)} nT (rms)", True
    if running is not None:
        errors = f"{figure(made, 3)} nT with the candidate, {figure(before, 3)} nT without (rms)"
        accepted = is_better((candidate[fitting], running[fitting]), *others)
    said = f"{describe_outcome(accepted, before, made)}: the error of unseen readings is {errors}"
    return Judgement(accepted, said, False, before, made)


def describe_outcome(accepted: bool, running_rms: float, candidate_rms: float) -> str:
    """What the held-out readings say of a candidate; the rms errors are those of a `Judgement`."""
    if np.isnan(running_rms):
        return "there was nothing before"
    if accepted:
        return "the candidate is better"
    if candidate_rms < 0.95 * running_rms:
        return "the candidate gains no more than chance may"
    return f"the candidate is {'no better' if candidate_rms < 1.05 * running_rms else 'worse'}"


def is_better(*parts: tuple[Array, Array]) -> bool:
    """Whether errors (k, o) are clearly smaller than others of the same readings, in parts that
    count alike."""
    mean, variance = 0.0, 0.0
    for errors, than in parts:
        gained = (than**2 - errors**2).sum(axis=1)
        away = gained - gained.mean()
        length = correlation_length(away, np.ones(len(away)))
        mean += float(gained.mean())
        variance += float(np.mean(away**2) * length / max(len(away) - 1, 1))
    return bool(mean > CERTAIN * np.sqrt(variance))


def choose_best(errors: Sequence[Array]) -> int:
    """The number of the best of candidates, by their errors (k, o); an earlier one wins ties."""
    best = 0
    for later in range(1, len(errors)):
        rows = _select_fitting(errors[later], errors[best])
        if rows.any() and is_better((errors[later][rows], errors[best][rows])):
            best = later
    return best


def estimate_noise(errors: Array) -> tuple[float, float]:
    """Standard deviation on an axis, nT, and how many successive rows count as one."""
    sd = max(robust_scale(errors.ravel()), 1e-6)
    kept: Array = np.asarray((np.abs(errors) < OUTLIER * sd).all(axis=1), dtype=np.float64)
    return sd, max(correlation_length(column, kept) for column in errors.T)


def _select_fitting(candidate: Array, running: Array | None) -> Mask:
    """Rows that fit the candidate or what is running, to a few times the candidate's noise."""
    limit = OUTLIER * max(robust_scale(candidate.ravel()), 1e-6)
    fits = (np.abs(candidate) < limit).all(axis=1)
    if running is not None:
        fits |= (np.abs(running) < limit).all(axis=1)
    return np.asarray(fits)


def _doubt_reference(unseen: Unseen, made: float, params: RetrainerParams) -> str:
    """What speaks against the reference, or nothing."""
    off = f"the best candidate is off by {figure(made)} nT on unseen readings"
    if unseen.moves > params.furthest:
        return (
            f"wrong reference: the candidate moves the field by {figure(100 * unseen.moves)} % of "
            f"it, more than the {figure(100 * params.furthest)} % that a sensor may change by; "
            "look at unit, axes and date of the reference"
        )
    if unseen.noise is not None and made > params.misfit * unseen.noise:
        left = f"{figure(unseen.noise)} nT were left before"
        return f"wrong reference, or a disturbance: {off}, and {left}"
    if made > params.furthest * unseen.strength:
        return f"wrong reference: {off}, in a field of {figure(unseen.strength)} nT"
    return ""


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))
