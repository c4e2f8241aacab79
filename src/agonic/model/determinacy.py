"""What the orientations that were seen determine, without priors and without the noise's help."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.model.average import Base, Prior
from agonic.model.feet import join_pieces
from agonic.model.rows import Rows

BY_CHANCE = 3.0
"""Standard deviations by which the noise's help may be more than it is on the average."""
_FLOOR = 1e-12


class Held(NamedTuple):
    """The share of priors in the variance of a level heading, its standard error without them,
    degrees, and that of the bias along each axis, (3,), over the radius."""

    share: float
    alone_deg: float
    bias_sd: Array


def find_held(
    rows: Rows, estimate: Estimate, channels: Sequence[str], base: Base, prior: Prior, level: Array
) -> Held:
    """What holds the heading where readings do not.

    With the information M = G + P, P that of priors and N what noise pretends to, the share is
    hᵀM⁻¹(P + N)M⁻¹h/hᵀM⁻¹h, and the error alone that of G − N. In circles and planes G is of full
    rank by noise only. N is found for white noise, of J at feet that a further draw of noise moves
    along the surface less J at feet, beside the same of J; its part in G = LLᵀ is the same where
    noise has a memory: L L_w⁻¹ N_w L_w⁻ᵀ Lᵀ.

    Parameters: `level` (h, m) derivatives of the heading.
    """
    m = len(prior.pull)
    inverse = base.inverse[:m, :m]
    whole = np.linalg.inv(inverse)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(whole), 1e-300))
    both = np.outer(scale, scale)
    seen, by_noise = _add_up_white(rows, estimate, channels)
    chance = 1.0 + BY_CHANCE / np.sqrt(max(len(rows.weights), 1))
    held = prior.information * both
    told = whole * both - held
    turned = _root(told) @ np.linalg.pinv(_root(seen * both), rcond=_FLOOR)
    held = held + turned @ (by_noise * both) @ turned.T * chance
    values, axes = np.linalg.eigh(whole * both - held)
    alone = (axes / np.maximum(values, _FLOOR * values[-1])) @ axes.T
    ways = level * scale
    moved = np.linalg.solve(whole * both, ways.T)
    share = float(np.sum((held @ moved) * moved)) / max(float(np.sum(ways.T * moved)), 1e-300)
    variance = float(np.einsum("hi,ij,hj->", ways, alone, ways)) / len(level)
    bias_sd = np.sqrt(np.maximum(np.diag(alone)[:3], 0.0)) * scale[:3] / rows.radius
    return Held(min(share, 1.0), float(np.sqrt(max(variance, 0.0))), bias_sd)


def _root(information: Array) -> Array:
    """A root of information that may be singular, by its axes."""
    values, axes = np.linalg.eigh(information)
    return np.asarray((axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T)


def _add_up_white(rows: Rows, estimate: Estimate, channels: Sequence[str]) -> tuple[Array, Array]:
    """Information (m, m) of the feet for white noise, and that which noise pretends to."""
    params, points = estimate.solution.params, rows.feet.points
    blur = estimate.noise["magnitude"].sd * np.random.default_rng(0).normal(size=points.shape)
    at_feet = {one: join_pieces(rows.feet, one, params)[1] for one in channels}
    normal = at_feet["magnitude"][:, :3]
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    blur -= normal * np.sum(blur * normal, axis=1, keepdims=True)
    blurred = rows.feet._replace(points=points + blur)
    seen, by_noise = np.zeros((len(params), len(params))), np.zeros((len(params), len(params)))
    for channel, standing in at_feet.items():
        weights = rows.weights / estimate.noise[channel].sd ** 2
        change = join_pieces(blurred, channel, params)[1] - standing
        seen += (standing.T * weights) @ standing
        by_noise += (change.T * weights) @ change
    return seen, by_noise
