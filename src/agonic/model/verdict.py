"""The verdict of a fit: a pure function of what is known of it, and its table of limits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.coverage import OPEN_DEG, Coverage
from agonic.health.evidence import (
    HEADING_DOUBTFUL_DEG,
    HEADING_REFUSED_DEG,
    RECORD_LONGER,
    SHIFT_DOUBTFUL,
    Evidence,
)
from agonic.health.examine import examine
from agonic.health.finding import Finding, Severity, describe_moments, figure, sort_findings
from agonic.model.average import EVIDENCE
from agonic.model.posterior import BY_CHANCE, Posterior
from agonic.model.shares import Share
from agonic.model.terms.time import STEP, TIME

SEEN_DEG = 0.2
"""Of heading: nobody looks for what is less."""
PRIOR_SHARE = 0.5
"""Of the variance of a heading: where priors hold more, the log does not determine it."""
UNSEEN_RESIDUALS = 1.3
"""Unseen blocks scatter by so much more than stated where the model is not that of the log: twenty
times what chance makes of 300 rows."""
PRIOR_TOLD = 0.25
"""Of the variance of a bias: what priors hold more of is said to be theirs."""
OPEN_BIAS = 0.035
"""Of the field: a bias that is known less well without priors errs a tilted heading by 2°."""
DRIFT = "bias drift"
OF_TIME = frozenset(term.name for term in (*TIME, STEP))

_PRIOR = (
    "the directions seen do not determine the heading: what is known of it follows from the "
    "assumed prior on soft iron, or from noise"
)


def examine_beside_terms(
    evidence: Evidence, posterior: Posterior | None, *, attitude_aided: bool
) -> tuple[Finding, ...]:
    """What the evidence gives away of the readings, beside the terms that are seen."""
    if posterior is None:
        return examine(evidence, attitude_aided=attitude_aided)
    shares = posterior.shares
    changes = posterior.memory_deg > 0.0 or any(
        one.odds > EVIDENCE and not one.term.unit for one in shares
    )
    left = None if any(one.row is not None for one in shares) else posterior.left
    return examine(evidence, changes, left, attitude_aided=attitude_aided)


def judge(
    posterior: Posterior | None, evidence: Evidence, facts: Sequence[Finding] = ()
) -> tuple[Finding, ...]:
    """The findings of a fit beside the `facts` of its record: where one of these forbids the fit
    there is nothing more to say of it, and what moved the bias is told once."""
    if any(fact.severity == "refuse" for fact in facts):
        return ()
    coverage, unit, radius = evidence.coverage, evidence.unit, evidence.radius
    if posterior is None:
        return tuple(_doubt_heading(coverage, None))
    changed = any(fact.name == STEP.name for fact in facts)
    shown = [
        one
        for one in posterior.shares
        if one.odds > EVIDENCE and not (changed and one.term.name in OF_TIME)
    ]
    terms = {one.name: one for one in _name_terms(shown, unit, radius, evidence.time)}
    for doubt in _doubt_heading(coverage, posterior):  # of one cause the graver is told
        own = terms.get(doubt.name, doubt)
        terms[doubt.name] = replace(sort_findings([doubt, own])[0], moments=own.moments)
    found = _report_once([*terms.values()], changed)
    names = {one.name for one in (*found, *facts) if one.severity != "note"}
    if not names:
        found += _check_unseen(posterior, coverage.heading_sd_deg)
    if not any(one.name == "prior" for one in found):
        found += _name_held_axes(posterior, unit, radius)
    return tuple(found)


def _name_held_axes(posterior: Posterior, unit: str, radius: float) -> Iterator[Finding]:
    """What of the bias follows from the prior, where a level heading does not rest on it."""
    alone, stated = posterior.held.bias_sd, posterior.bias_sd
    open_axes = (alone > OPEN_BIAS) & (stated**2 < (1.0 - PRIOR_TOLD) * alone**2)
    if not open_axes.any():
        return
    axes = [axis for axis, is_open in zip("xyz", open_axes, strict=True) if is_open]
    worst = int(np.argmax(np.where(open_axes, alone, 0.0)))
    yield Finding(
        "prior",
        "note",
        f"the bias along {' and '.join(axes)} follows from the assumed prior on soft iron: "
        f"± {figure(stated[worst] * radius)} {unit} with it, ± {figure(alone[worst] * radius)} "
        f"{unit} without; the heading of a tilted vehicle depends on it",
    )


def _check_unseen(posterior: Posterior, stated_deg: float) -> Iterator[Finding]:
    """Parts of the log that contradict what is stated: their residuals, or by how much the heading
    moves without each (its jackknife error)."""
    residuals, moves, expected, independent = posterior.unseen
    predicted = float(np.hypot(stated_deg, expected))
    most = predicted * np.sqrt(1.0 + BY_CHANCE * np.sqrt(2.0 / max(independent, 1.0)))  # χ²
    if residuals > UNSEEN_RESIDUALS:
        what = f"scatter {figure(residuals)} times as much as the fit states"
    elif moves >= HEADING_DOUBTFUL_DEG and moves > most:
        by = f"by {figure(moves)}°" if moves < OPEN_DEG else "to anywhere"
        what = f"move the heading {by} when they are left out one by one"
    else:
        return
    yield Finding(
        "unseen parts",
        "check",
        f"parts of the log that the fit has not seen {what}",
        "find what changed during the log, and record again",
    )


def check_coverage(coverage: Coverage) -> Finding | None:
    """A heading that the directions visited leave uncertain."""
    return next(_doubt_heading(coverage, None), None)


def _doubt_heading(coverage: Coverage, posterior: Posterior | None) -> Iterator[Finding]:
    """A heading that is not known well enough, by what leaves it uncertain."""
    total = coverage.heading_sd_deg
    held = posterior is not None and posterior.held.share > PRIOR_SHARE
    alone = posterior.held.alone_deg if posterior is not None else 0.0
    if held and alone > HEADING_DOUBTFUL_DEG:
        yield Finding(
            "prior",
            "refuse" if total >= HEADING_REFUSED_DEG else "check",
            f"{_PRIOR}; without it the heading is {_say_uncertain(alone)}",
            coverage.turns or "turn the sensor about all three axes",
        )
        if total < HEADING_REFUSED_DEG:
            return
    if total < HEADING_DOUBTFUL_DEG:
        return
    name, what, move = _find_largest(posterior, coverage)
    yield Finding(name, _judge_deg(total), f"{what} the heading {_say_uncertain(total)}", move)


def _find_largest(posterior: Posterior | None, coverage: Coverage) -> tuple[str, str, str]:
    """What makes most of the heading's error: its name, its words, and what helps."""
    seen = f"the directions visited ({100 * coverage.filled:.0f} % of the {coverage.of}) leave"
    turns = coverage.turns or f"{RECORD_LONGER}, turning slowly about all three axes"
    if posterior is None:
        return "coverage", seen, turns
    term = next(iter(posterior.shares), None)  # the largest first
    shared = max(posterior.considered_deg.values(), default=0.0)
    largest = max(posterior.noise_deg, posterior.memory_deg, shared)
    if term is not None and term.odds > EVIDENCE and term.heading_deg > largest:
        return term.term.name, f"{term.term.what}; this leaves", term.term.move
    if posterior.memory_deg > max(posterior.noise_deg, shared):
        what = "residuals are correlated over time, from an unknown cause: this leaves"
        move = "let the sensor warm up, keep iron and currents unchanged, and record longer"
        return "correlated noise", what, move
    return "coverage", seen, turns


def _report_once(found: list[Finding], changed: bool) -> list[Finding]:
    """The first of the gravest findings, the others as notes without a move; all but a refusal as
    notes where it is known that the bias `changed`."""
    told = sort_findings(found)
    first = [one for one in told[:1] if one.severity == "refuse" or not changed]
    return [*first, *(replace(one, severity="note", move="") for one in told[len(first) :])]


def _name_terms(
    shown: Sequence[Share], unit: str, radius: float, time: Array | None
) -> Iterator[Finding]:
    """What residuals show beside the calibration; a check where readings move by too much."""
    steps = [one for one in shown if one.row is not None]
    for one in _join_moves(shown):
        if max(one.heading_deg, one.moves_deg) < SEEN_DEG:
            continue
        rms = "" if one.row is not None else " rms"
        size = f", by {figure(one.size * radius)} {unit}{rms}" if one.size else ""
        severity = _judge_moves(one)
        effect = max(one.heading_deg, one.moves_deg)
        left = f"it leaves the heading uncertain by {figure(effect)}°"
        if one.moves_deg > one.heading_deg:
            left = f"the calibration has its mean; the heading varies by {figure(effect)}° with it"
        moments: tuple[float, ...] = ()
        what = one.term.what
        if one.row is not None:
            rows = np.array(sorted(step.row for step in steps if step.row is not None))
            moments = tuple((rows if time is None else time[rows]).astype(float).tolist())
            what = f"{what} {describe_moments(rows, time)}"
        yield Finding(
            one.term.name,
            severity,
            f"{what}{size}; {left}",
            one.term.move if severity != "note" else "",
            moments,
        )


def _judge_moves(one: Share) -> Severity:
    """What a heading is worth that moves by so much over the log, or a bias by one step.

    A large step is a fact of the record (`check_states`).
    """
    if one.row is not None:
        return "check" if one.size >= SHIFT_DOUBTFUL else "note"
    return _judge_deg(one.moves_deg)


def _judge_deg(heading_deg: float) -> Severity:
    """What a heading is worth that is off by so much."""
    if heading_deg >= HEADING_REFUSED_DEG:
        return "refuse"
    return "check" if heading_deg >= HEADING_DOUBTFUL_DEG else "note"


def _join_moves(shown: Sequence[Share]) -> list[Share]:
    """All steps of the bias as one with the size of the largest, or as part of its drift."""
    others = [one for one in shown if one.term is not STEP]
    steps = [one for one in shown if one.row is not None]
    if not steps:
        return others
    heading = float(np.linalg.norm([one.heading_deg for one in steps]))
    moves = float(np.linalg.norm([one.moves_deg for one in steps]))
    for k, one in enumerate(others):
        if one.term.name == DRIFT and one.size:
            others[k] = one._replace(
                heading_deg=float(np.hypot(one.heading_deg, heading)),
                moves_deg=float(np.hypot(one.moves_deg, moves)),
            )
            return others
    largest = max(steps, key=lambda one: one.size)
    return [largest._replace(heading_deg=heading, moves_deg=moves), *others]


def _say_uncertain(sd_deg: float) -> str:
    """How uncertain a heading is; beyond a quarter of the circle a number says nothing."""
    return f"uncertain by {figure(sd_deg)}°" if sd_deg < OPEN_DEG else "undetermined"
