"""Heavy tails (Student's t) of a population: how often a regular member lies far out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import fdtr, fdtrc, fdtri

from agonic.arrays import Array
from agonic.maths.one_pass import median

HEAVY = 0.25
"""1/ν of the tail where the members are too few to show theirs: Student's t with ν = 4."""

_INVERSES = np.array([1e-3, 0.02, 0.04, 0.07, 0.1, 0.14, 0.18, 0.22, HEAVY, 0.3, 0.36, 0.43, 0.5])
_SHARES = np.array([0.0, 0.002, 0.005, 0.01, 0.02, 0.04, 0.07, 0.1, 0.14, 0.2])
_SCALES = np.exp(np.linspace(-0.4, 0.4, 33))
_OUTER = 3.0  # scales: nearer, nothing is taken for an outlier
_DROP = 2.0  # of the log-likelihood: one-sided, 98 %


class Tail(NamedTuple):
    """The law of the distances of regular members: (r/scale)²/k follows F(k, dof).

    `share` is that of the members which are not regular.
    """

    scale: float
    dof: float
    dimensions: int
    share: float

    def beyond(self, distance: Array) -> Array:
        """How often a regular member is at least so far out, (n,)."""
        ratio = (distance / self.scale) ** 2 / self.dimensions
        return np.asarray(fdtrc(self.dimensions, self.dof, ratio))


def fit_tail(distance: Array, dimensions: int) -> Tail:
    """The heaviest tail that the members allow, with up to a fifth of them outliers.

    Distances r of a k-variate Student t have (r/c)²/k ~ F(k, ν); outliers are taken as uniform in
    log r beyond 3 c. Scale c, ν and the outliers' share are found by maximum likelihood on a grid;
    then ν is lowered as far as the profile likelihood allows (a drop of 2), yet not below 4
    unless the likelihood itself asks for it. So few members are judged by a heavy tail, many by
    their own; 1/n is added to 1/ν for the scale that was learned from n of them."""
    k, n = dimensions, len(distance)
    typical = median(distance) / np.sqrt(k * fdtri(k, 30.0, 0.5))
    scales = max(typical, 0.05) * _SCALES
    counts, within, outside = _bin(distance, k, scales)
    mixed = (1 - _SHARES[:, None]) * within[:, :, None] + _SHARES[:, None] * outside
    likelihood = np.log(np.maximum(mixed, 1e-300)) @ counts  # (ν, c, share)
    profile = likelihood.max(axis=(1, 2))
    best = int(np.argmax(profile))
    allowed = _INVERSES[profile >= profile[best] - _DROP].max()
    at = int(np.searchsorted(_INVERSES, max(_INVERSES[best], min(allowed, HEAVY))))
    c, share = np.unravel_index(int(np.argmax(likelihood[at])), likelihood[at].shape)
    dof = 1.0 / (float(_INVERSES[at]) + 1.0 / n)
    return Tail(float(scales[c]), dof, k, float(_SHARES[share]))


def _bin(distance: Array, k: int, scales: Array) -> tuple[Array, Array, Array]:
    """Counts (b,) in the bins of log r that are filled, and the shares of regular members (ν, c, b)
    and of others (b,) there.
    """
    first, outer = 0.2 * scales[0], _OUTER * np.sqrt(k) * scales[len(scales) // 2]
    last = max(10.0 * outer, 1.1 * float(np.max(distance, initial=0.0)))
    edges = np.geomspace(first, last, 1 + max(60, int(20 * np.log(last / first))))
    counts = np.histogram(np.clip(distance, first, last), edges)[0].astype(np.float64)
    filled = counts > 0  # the others say nothing, and few members fill few
    ends = np.array([np.append(0.0, edges[1:-1]), np.append(edges[1:-1], np.inf)])[:, filled]
    ratio = (ends[:, None, None] / scales[:, None]) ** 2 / k
    below = fdtr(k, 1.0 / _INVERSES[:, None, None], ratio)
    log = np.log(np.maximum(edges, outer))
    outside = np.diff(log) / (log[-1] - log[0])
    return counts[filled], np.asarray(below[1] - below[0]), outside[filled]
