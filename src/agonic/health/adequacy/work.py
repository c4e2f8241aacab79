"""A fit and the rows on which it is tested, seen as the tests want it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Index
from agonic.health.adequacy.fitted import (
    FEWEST_ROWS,
    Fitted,
    Residuals,
    ResidualsAtFeet,
    View,
    Views,
    Work,
)
from agonic.health.adequacy.foot_points import find_feet
from agonic.health.adequacy.rows import choose_rows
from agonic.maths.equation.affine import magnitude_residual, model_basis
from agonic.maths.estimation.inference.linearised import Linearised, batches_of, find_captured

UNEVEN = 3.0
"""Correlation lengths of two kinds of residuals that differ by this factor weigh the kinds."""
WORST_CONDITION = 1e12
"""Of the information over the scales: beyond it the fit itself is undetermined."""


def prepare(fitted: Fitted) -> Work | None:
    """The rows to test and what they see; None where they are too few, or the fit is open."""
    n = len(fitted.readings)
    gain = fitted.gain
    radius = fitted.magnitude / gain
    if n < FEWEST_ROWS or not 0 < fitted.noise < 0.2 * radius:
        return None
    rows = choose_rows(fitted.readings, radius)
    readings = fitted.readings[rows]
    wanted = fitted.wanted if len(fitted.wanted) == 1 else fitted.wanted[rows]
    at = (fitted.calibration.bias, fitted.calibration.matrix, wanted)
    residuals, _ = magnitude_residual(readings, *at, fitted.noise)
    feet, normals = find_feet(fitted.calibration, readings, residuals)
    onto = model_basis("full", fitted.calibration.gauge)
    scale = np.r_[np.full(3, radius), np.full(onto.shape[1] - 3, gain)]

    def jacobian_at(points: Array) -> Array:
        _, local = magnitude_residual(points, *at)
        return np.asarray((local @ onto) * (scale / fitted.noise))

    linear = Linearised(
        residuals / fitted.noise,
        jacobian_at(feet),
        fitted.weights[rows],
        fitted.prior * np.outer(scale, scale),
        batches_of(len(rows), fitted.correlation),
    )
    if np.linalg.cond(linear.information) > WORST_CONDITION:
        return None
    seen, again, whole, even = _look(fitted, rows, linear, (feet / radius, normals), scale)
    blurred = jacobian_at(again[0].feet * radius) - linear.jacobian
    return Work(
        fitted=fitted,
        rows=rows,
        normals=normals,
        feet=feet / radius,
        radius=radius,
        scale=scale,
        onto=onto,
        linear=linear,
        by_noise=(blurred.T * linear.weights) @ blurred,
        whole=whole,
        even=even,
        seen=seen,
        again=again,
    )


def _look(
    fitted: Fitted, rows: Index, linear: Linearised, at: tuple[Array, Array], scale: Array
) -> tuple[ResidualsAtFeet, tuple[ResidualsAtFeet, ...], Linearised, Linearised]:
    """What the residuals of these rows see, the same with other draws of noise, the fit to all
    kinds of residuals, and that with even weights; by the magnitude alone there is one kind.

    Parameters: `at` feet and normals (n, 3); `linear` the fit to the magnitude.
    """
    if fitted.look is None:
        feet, normals = at
        signals = {name: values[rows] for name, values in fitted.signals.items()}
        by_reading = normals * (fitted.magnitude / fitted.gain / fitted.noise)
        seen = ResidualsAtFeet(feet, by_reading, linear.residuals, signals)
        return seen, (_blur(fitted, seen, normals),), linear, linear
    views = fitted.look(rows)
    seen, blurred, tilted = (_see(one, fitted) for one in views)
    again = blurred, tilted._replace(feet=seen.feet)  # an error of the attitude moves no reading
    whole = _stack(views, fitted, rows, scale)
    return seen, again, whole, _even_weights(views.own.kinds, whole)


def _blur(fitted: Fitted, seen: ResidualsAtFeet, normals: Array) -> ResidualsAtFeet:
    """Feet with a further draw of noise across the normals, which the residuals do not have."""
    radius = fitted.magnitude / fitted.gain
    blur = fitted.noise / radius * np.random.default_rng(0).normal(size=normals.shape)
    blur -= np.sum(blur * normals, axis=1, keepdims=True) * normals
    return seen._replace(feet=seen.feet + blur)


def _even_weights(kinds: tuple[Residuals, ...], whole: Linearised) -> Linearised:
    """The same with weights that do not go by how residuals of a kind go together in time."""
    lengths = [kind.correlation for kind in kinds]
    if max(lengths) < UNEVEN * min(lengths):
        return whole
    weights = whole.weights * np.repeat(lengths, len(whole.weights) // len(lengths))
    return replace(whole, weights=weights)


def _see(view: View, fitted: Fitted) -> ResidualsAtFeet:
    """What all kinds see: feet on the ellipsoid, normals over the noise, residuals."""
    first, *others = view.kinds
    radius, length = fitted.magnitude / fitted.gain, np.linalg.norm(first.by_reading, axis=1)
    feet, normals = find_feet(fitted.calibration, view.readings, first.residuals / length)
    by_reading = np.vstack([normals * length[:, None], *(kind.by_reading for kind in others)])
    residuals = np.concatenate([kind.residuals for kind in view.kinds])
    return ResidualsAtFeet(feet / radius, by_reading * radius, residuals, view.signals)


def _stack(views: Views, fitted: Fitted, rows: Index, scale: Array) -> Linearised:
    """All kinds of residuals of some rows as one; those that go together in time count less."""
    kinds, by_attitude = views.own.kinds, views.tilted.kinds
    more = np.r_[scale, np.ones(kinds[0].jacobian.shape[1] - len(scale))]
    weights = fitted.weights[rows]
    longest = max(kind.correlation for kind in kinds)
    batch = batches_of(len(rows), longest)
    residuals = np.concatenate([kind.residuals for kind in kinds])
    jacobian = np.vstack([kind.jacobian for kind in kinds])
    moved = np.vstack([kind.jacobian for kind in by_attitude]) - jacobian
    turned = np.concatenate([kind.residuals for kind in by_attitude]) - residuals
    return Linearised(
        residuals,
        jacobian * more,
        np.concatenate([weights / kind.correlation for kind in kinds]),
        fitted.own_prior * np.outer(more, more),
        np.tile(batch, len(kinds)),
        moved * more * turned[:, None],
        find_captured(batch, longest),
    )
