"""How noisy each sensor is, told by the residuals of a fit: restricted maximum likelihood.

Residuals in blocks, one a shot, have the variance V = Σ θ_k V_k. With the unknowns under a prior of
information W, P = V⁻¹ − V⁻¹ J (JᵀV⁻¹J + W)⁻¹ JᵀV⁻¹ and z = V⁻¹ r at the most probable unknowns,

    θ_k ← θ_k √[(zᵀ V_k z + ν θ₀/θ_k²) / (tr P V_k + ν/θ_k)]

never makes them less probable; ν and θ₀ are of a weak prior, for what few residuals tell little of.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.estimation.leastsq import inverse

PRIOR_COUNT = 1.0
"""ν: the noise that is expected counts as much as one residual."""
_ROUNDS = 60
_STEADY = 3e-3


class Linear(NamedTuple):
    """Residuals (n, c), Jacobian (n, c, q), variances (k, n, c, c) of unit noise, what is there.
    `prior` (q, q) is the information of the prior, and `pull` (q,) what it adds to the gradient."""

    residuals: Array
    jacobian: Array
    variances: Array
    there: Mask
    prior: Array
    pull: Array

    def select(self, rows: Index | Mask) -> Linear:
        """Some of the blocks."""
        return self._replace(
            residuals=self.residuals[rows],
            jacobian=self.jacobian[rows],
            variances=self.variances[:, rows],
            there=self.there[rows],
        )


class Weighted(NamedTuple):
    """The step to the most probable unknowns (q,), their covariance (q, q), z (n, c) there. `free`
    (n, c, c) are the blocks of P, `freedom` how many residuals the unknowns do not take;
    `information` (q, q) is that of the residuals alone."""

    step: Array
    covariance: Array
    information: Array
    whitened: Array
    free: Array
    freedom: float


def weigh(linear: Linear, theta: Array) -> Weighted:
    """The estimate with noise of variances `theta` (k,); what is not `there` counts nothing."""
    there, weights = linear.there, _invert(linear, theta)
    weighted = weights @ linear.jacobian
    information = np.einsum("nij,nik->jk", linear.jacobian, weighted)
    covariance = inverse(information + linear.prior)
    step = -covariance @ (np.einsum("nij,ni->j", weighted, linear.residuals) + linear.pull)
    left = linear.residuals + linear.jacobian @ step
    whitened = np.einsum("nij,nj->ni", weights, left)
    free = weights - weighted @ covariance @ np.swapaxes(weighted, 1, 2)
    taken = float(np.einsum("ij,ji->", information, covariance))
    return Weighted(step, covariance, information, whitened, free, float(there.sum()) - taken)


def _invert(linear: Linear, theta: Array) -> Array:
    """The blocks of V⁻¹, zero where nothing is there."""
    there = linear.there
    total = np.einsum("k,knij->nij", theta, linear.variances)
    total[:, range(there.shape[1]), range(there.shape[1])] += ~there
    return np.asarray(np.linalg.inv(total) * (there[:, :, None] & there[:, None, :]))


def estimate_variances(
    linear: Linear, theta: Array, expected: Array, rounds: int = _ROUNDS
) -> Array:
    """The variances (k,) of the kinds of noise, from a start; `expected` (k,) are θ₀. Source: H.
    Zhou, L. Hu, J. Zhou, K. Lange, MM algorithms for variance components models, Journal of
    Computational and Graphical Statistics 28, 2019."""
    seen = linear.variances.any(axis=(1, 2, 3))
    for _ in range(rounds):
        found = weigh(linear, theta)
        square = np.einsum("ni,knij,nj->k", found.whitened, linear.variances, found.whitened)
        trace = np.einsum("nij,knji->k", found.free, linear.variances)
        ratio = (square + PRIOR_COUNT * expected / theta**2) / (trace + PRIOR_COUNT / theta)
        updated = np.where(seen, theta * np.sqrt(np.maximum(ratio, 1e-6)), theta)
        if np.abs(np.log(updated / theta)).max() < _STEADY:
            return updated
        theta = updated
    return theta


def adjust_covariance(linear: Linear, theta: Array) -> Array:
    """The covariance (q, q) of the unknowns with what is not known of the noise.

        C + 2 C Σ_kl w_kl (Q_kl − P_k C P_l) C,

    w the covariance of the variances, P_k = −JᵀV⁻¹V_kV⁻¹J, Q_kl = JᵀV⁻¹V_kV⁻¹V_lV⁻¹J. Source: M. G.
    Kenward, J. H. Roger, Small sample inference for fixed effects from restricted maximum
    likelihood, Biometrics 53, 1997.
    """
    found, kinds = weigh(linear, theta), np.flatnonzero(linear.variances.any(axis=(1, 2, 3)))
    weights = _invert(linear, theta)
    parts = [weights @ linear.variances[k] for k in kinds]
    white, c = weights @ linear.jacobian, found.covariance
    single = [-np.einsum("nij,nik->jk", linear.jacobian, part @ white) for part in parts]
    double = [
        [np.einsum("nij,nik->jk", linear.jacobian, a @ (b @ white)) for b in parts] for a in parts
    ]
    count = len(kinds)
    information = np.empty((count, count))
    for k in range(count):
        for j in range(count):
            trace = np.einsum("nij,nji->", parts[k], parts[j])
            trace += np.trace(c @ single[k] @ c @ single[j]) - 2 * np.trace(c @ double[k][j])
            information[k, j] = trace / 2
    information += np.diag(PRIOR_COUNT / (2 * theta[kinds] ** 2))
    spread = inverse((information + information.T) / 2)
    inner = np.zeros_like(c)
    for k in range(count):
        for j in range(count):
            inner += spread[k, j] * (double[k][j] - single[k] @ c @ single[j])
    return np.asarray(c + 2 * c @ ((inner + inner.T) / 2) @ c)
