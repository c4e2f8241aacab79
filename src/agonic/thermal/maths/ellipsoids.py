"""Bias and matrix at each temperature by itself, from the mean readings of turned stations.

The published way (Nikolaev et al. 2023): twelve means at one temperature lie on an ellipsoid. All
temperatures are solved at once, each by Gauss–Newton from a start near enough. Points are centred
and scaled to about one, the field has magnitude one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.equation import temperature_model
from agonic.maths.equation.affine import model_basis, split

FEWEST = 9
"""Stations below which nine coefficients are not determined."""

_ROUNDS = 8
_LEAST = 1e-10  # smallest eigenvalue of the scaled information that still counts as determined
_DAMPING = 1e-12


class Coefficients(NamedTuple):
    """Nine coefficients at each temperature (t, 9), their covariance (t, 9, 9), and which hold."""

    values: Array
    covariance: Array
    determined: Mask


def fit_ellipsoids(points: Array, covariance: Array, there: Mask, start: Array) -> Coefficients:
    """bias x y z and matrix xx yy zz xy xz yz at each temperature, by maximum likelihood.

    Parameters: points (t, k, 3) and their covariance (t, k, 3, 3), which of them are there (t, k),
    and a start (t, 9).
    """
    basis = model_basis("full")
    t, k, _ = points.shape
    params, information = start.copy(), np.zeros((t, 9, 9))
    determined = there.sum(axis=1) >= FEWEST
    flat = points.reshape(-1, 3)
    for _ in range(_ROUNDS):
        bias, matrix = split(np.repeat(params @ basis.T, k, axis=0))
        r, jacobian = temperature_model.size_residual(flat, bias, matrix, np.ones(len(flat)))
        s = jacobian[:, :3]
        spread = np.einsum("ni,nij,nj->n", s, covariance.reshape(-1, 3, 3), s)
        weight = np.where(there.ravel(), 1 / np.sqrt(spread), 0.0)
        z = (r * weight).reshape(t, k)
        rows = (jacobian @ basis * weight[:, None]).reshape(t, k, 9)
        information = np.swapaxes(rows, 1, 2) @ rows
        size = np.sqrt(np.maximum(np.einsum("tii->ti", information), 1e-300))
        scaled = information / (size[:, :, None] * size[:, None, :])
        determined &= np.linalg.eigvalsh(scaled)[:, 0] > _LEAST
        scaled[~determined] = np.eye(9)
        scaled += _DAMPING * np.eye(9)
        gradient = np.einsum("tki,tk->ti", rows, z) / size
        step = np.linalg.solve(scaled, gradient[:, :, None])[:, :, 0] / size
        params = np.where(determined[:, None], params - step, params)
    found = np.linalg.inv(scaled) / (size[:, :, None] * size[:, None, :])
    return Coefficients(params, found, determined)
