"""Causes that can be written as an error of the readings, chosen one by one (Rao's score test)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agonic.arrays import Array
from agonic.health.adequacy.causes import Cause, list_causes
from agonic.health.adequacy.fitted import (
    ModelError,
    Work,
    field_per_degree,
    make_error,
    moved_field,
)
from agonic.maths.equation.coverage import level_directions
from agonic.maths.estimation.inference.linearised import (
    Linearised,
    find_batches_beside,
    with_columns,
)
from agonic.maths.estimation.inference.score_test import Score, Terms, score_tests

SIGNIFICANT = 1e-3
"""Of a family of tests together (Bonferroni): clean logs alarm more rarely than this."""

MOST_CAUSES = 3

LASTING = ("bias drift", "gain drift", "follows turns")
"""Causes whose errors last: they make residuals go together."""

POSSIBLE = 1e-2
"""What is not significant but rarer than this by chance may be there all the same."""

PROBABLE = 0.1
"""The odds that a sensor bends by enough to be seen, before its readings are."""

UNSEEN = 0.02
"""Of the field: by as much at most, about, sensors bend whose residuals do not show it."""


def find_terms(work: Work) -> list[ModelError]:
    """Causes with terms, chosen one by one by how much they explain, each beside those before; and
    bends that are not significant, by how probable they are."""
    causes, found = list(list_causes(work)), list[ModelError]()
    fits = [work.whole, work.even, work.linear]
    fits = [fit for k, fit in enumerate(fits) if not any(fit is other for other in fits[:k])]
    at_most = POSSIBLE if work.fitted.look is None else SIGNIFICANT
    family = sum(not cause.alone for cause in causes)  # fits to the same readings say the same
    while causes and len(found) < MOST_CAUSES:
        by_fit = [_test_all(fit, causes, at_most) for fit in fits]
        scores = [
            (tested[k], cause, fit.square)
            for k, cause in enumerate(causes)
            for tested, fit in zip(by_fit, fits, strict=True)
        ]
        telling = [
            (s, c, square)
            for s, c, square in scores
            if s and s.p_value < SIGNIFICANT / (1 if c.alone else family)
        ]
        if not telling:
            return [*found, *_find_possible(work, [(s, c) for s, c, _ in scores[:: len(fits)]])]
        score, cause, _ = max(telling, key=lambda found: _rank(*found))
        found.append(_model_error(work, cause, score))
        fits = [_add_beside(fit, cause) for fit in fits]
        causes = [other for other in causes if other.name != cause.name]
    return found


def _rank(score: Score, cause: Cause, square: float) -> float:
    """The share of the squares that a cause explains beyond what so many terms do (AIC)."""
    return float((score.gain - 2 * cause.columns.shape[1]) / square)


def _find_possible(work: Work, tried: list[tuple[Score | None, Cause]]) -> list[ModelError]:
    """Bends that are not significant and may be there all the same, by how probable they are.

    Of any size about which nothing is known but its score q = γᵀV⁻¹γ of k terms one is, against
    none, as likely as B = (q/k)^(−k/2) exp((q − k)/2) where q > k. Its size is then γ (1 − k/q), of
    covariance V (1 − k/q), and its square γγᵀ (1 − k/q) along γ (see `average_over_term`), unless
    sensors hardly bend by so much. They explain the same residuals, so that one excludes another.
    """
    from scipy.special import chdtri  # here, so that what only reads a log loads no SciPy

    bends = [(score, cause) for score, cause in tried if cause.level is not None]
    if work.fitted.look is not None:  # directions show a bend
        return []
    found = []
    for score, cause in bends:
        if score is None or score.p_value > POSSIBLE:
            continue
        k = cause.columns.shape[1]
        q = float(chdtri(k, max(score.p_value, SIGNIFICANT / 100)))
        if q > k:
            odds = PROBABLE * float(np.exp((q - k - k * np.log(q / k)) / 2))
            plain = score._replace(spread=0.0 * score.spread, unseen=0.0 * score.unseen)
            error = _model_error(work, cause, plain)
            most = min(UNSEEN * work.radius / max(error.size, 1e-300), 1.0)
            found.append((error, odds, (1 - k / q) * most**2))
    total = 1 + sum(odds for _, odds, _ in found)
    return [error.weigh(odds / total * left) for error, odds, left in found]


def _test_all(fit: Linearised, causes: Sequence[Cause], at_most: float) -> list[Score | None]:
    """The score tests, but those whose p-value is above `at_most`.

    What lasts is not to hide as noise with a long memory; errors of the attitude may last as long
    as the log.
    """
    scores = score_tests(fit, [_list_terms(fit, cause) for cause in causes], at_most)
    return [
        score and score._replace(p_value=min(score.p_value * cause.trials, 1.0))
        for score, cause in zip(scores, causes, strict=True)
    ]


def _list_terms(fit: Linearised, cause: Cause) -> Terms:
    columns, noise, shared = cause.seen_by(fit)
    alone = cause.name in LASTING and fit.shared is None
    batches = find_batches_beside(fit, columns) if alone else None
    return Terms(columns, noise, shared, noise is None, cause.likely, batches)


def _add_beside(fit: Linearised, cause: Cause) -> Linearised:
    columns, _, shared = cause.seen_by(fit)
    return with_columns(fit, columns, shared)


def _model_error(work: Work, cause: Cause, score: Score) -> ModelError:
    """The error in the readings, the heading and the covariance, by the mean square of its size."""
    fitted, size = work.fitted, score.size / cause.told
    square = np.outer(size, size) + score.spread / cause.told**2
    if cause.level is not None:
        square += score.unseen * _mean_square(size, score.unseen)
    moves = np.linalg.solve(work.whole.information, work.whole.weighted @ cause.columns)
    moves = moves[: len(work.scale)] * work.scale[:, None]
    growth = moves @ square @ moves.T
    errors = cause.error(size)
    rms = float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))
    if cause.level is None and cause.at_rest:
        growth[:3, :3] += errors.T @ errors / len(errors)
    elif cause.level is not None:
        left = np.stack(
            [
                _level_error(work, cause, *one)
                for one in zip(moves.T, np.eye(len(size)), strict=True)
            ]
        )
        total = float(np.sum((left @ left.T) * square)) / left.shape[1]
        by_move = work.fitted.heading_deg(growth) * field_per_degree(work)
        growth[:3, :3] += np.eye(3) * max(total - by_move**2, 0.0) / fitted.gain**2
    return make_error(work, cause.name, score.p_value, rms, growth)


def _mean_square(size: Array, unseen: Array) -> float:
    """Of one of the combinations that rows show: others of the same cause are likely as large.

    What a bend of one axis by another does to the magnitude, a bend of the other by the product of
    both does as well, and not to the heading.
    """
    return float(size @ size) / max(len(size) - float(np.trace(unseen)), 1.0)


def _level_error(work: Work, cause: Cause, move: Array, size: Array) -> Array:
    """What a term of this size leaves across a level field at even headings (36,), by its own error
    and by how it moves the calibration."""
    assert cause.level is not None
    own = cause.level(size) @ work.fitted.calibration.matrix.T
    _, across = level_directions(work.fitted.inclination_deg)
    return np.asarray(np.sum((moved_field(work, move) - own) * across, axis=1))
