"""Which of the two compasses changed: what both measure of the field together tells."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.monitoring import LASTING, TAILS
from agonic.headings.monitor.baseline import Q, R, S, State, V


def weigh(
    size: float, state: State, covariance: Array, errors: Array, change: Array, within: Mask
) -> Array:
    """Log odds (…, 2) that compass 1 changed and not 2, of r and q.

    A change β of r = f₁ − f₂ moves the mean of both magnitudes by ½ f̂·β where compass 1 changed,
    and by −½ f̂·β where 2 did; that of both vertical intensities, less what such magnitudes explain,
    by ±½ (down − f̂ sin dip)·β. One ε of q = down₁ − down₂ moves it by ±½ f·ε. With e what a
    block's residual does not share with the one before, eₖ − ρ eₖ₋₁, a the same of the signature,
    and w the variance:

        log odds = Σ (ν + 1)/2 · log[(1 + (e + a)²/νw) / (1 + (e − a)²/νw)]

    Parameters: size of the field, errors (…, k, 4, 3) of the last blocks, changes (…, 2, 3) of r
    and q, and which blocks are within (…, 2, k) the changes.
    """
    field, down = state.regressor[..., S, 1:], state.regressor[..., Q, 1:]
    sine = (field * down).sum(axis=-1, keepdims=True)
    level, across = (field - sine * down) * size, down - sine * field
    of_field, of_tilt = change[..., None, 0, :], change[..., None, 1, :]
    leaning = (down[..., :2] * of_tilt[..., :2]).sum(axis=-1)
    fallen = -leaning / np.maximum(down[..., 2], 0.1)
    by_tilt = (level[..., :2] * of_tilt[..., :2]).sum(axis=-1) + level[..., 2] * fallen
    signatures = (
        (R, S, (field * of_field).sum(axis=-1)),
        (R, V, (across * of_field).sum(axis=-1)),
        (Q, V, by_tilt),
    )
    odds = np.zeros(change.shape[:-1])
    for cause, group, signature in signatures:
        moved = np.where(within[..., cause, :], signature / 2, 0.0)
        odds[..., cause] += _compare(state, covariance, errors, group, moved)
    return odds


def _compare(state: State, covariance: Array, errors: Array, group: int, moved: Array) -> Array:
    """The log odds (…,) by one group of common residuals, of signatures (…, k) of a change."""
    there = state.regressor[..., group, 0] > 0.0
    after = there[..., 1:] & there[..., :-1]
    power, following = np.moveaxis(state.power[..., group, :], -1, 0)
    usual = power / state.weight[..., group]
    # ρ, how much of a block's residual is that of the block before
    kept = np.where(after, np.clip(following / power, 0.0, LASTING)[..., None], 0.0)
    told = moved[..., 1:] - kept * moved[..., :-1]
    error = errors[..., 1:, group, 0] - kept * errors[..., :-1, group, 0]
    x = state.regressor[..., group, :]
    x = x[..., 1:, :] - kept[..., None] * x[..., :-1, :]
    unknown = np.einsum("...ki,...ij,...kj->...k", x, covariance[..., group, :, :], x)
    wide = TAILS * ((1.0 - kept**2) * usual[..., None] + unknown)
    odds = np.log1p((error + told) ** 2 / wide) - np.log1p((error - told) ** 2 / wide)
    return np.asarray((TAILS + 1.0) / 2.0 * np.where(there[..., 1:], odds, 0.0).sum(axis=-1))
