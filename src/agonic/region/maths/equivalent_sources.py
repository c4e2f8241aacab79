"""A Gaussian process without curl and divergence: dipoles at random on a box around the readings.

    f(x) = u + Σⱼ T(x − sⱼ) wⱼ,   wⱼ ~ N(0, a² 1)

T is the tensor of a dipole, so f is the gradient of a harmonic potential whatever u and w are, and
its covariance a² Σⱼ T(x − sⱼ) T(x′ − sⱼ)ᵀ is one of harmonic fields: equivalent sources (Dampney
1969) as a Gaussian process. Solin et al. (2018) take the gradient of a scalar potential of squared
exponential covariance, which has no curl but a divergence. The distance d of the sources from the
readings is the length of the process; u is any. The likelihood is the restricted one, in which u
takes its degrees of freedom.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from agonic.arrays import Array
from agonic.maths.magnetostatics import dipole_gradient, dipole_tensor

KNOWN_TO = 0.2
"""Of itself, how well a stated noise is thought to be known: a factor of two is objected to."""


class Readings(NamedTuple):
    """Readings `field` (n, 3), nT, at `position` (n, 3), m; the noise of each has the variance
    σ²/`weight` (n,)."""

    position: Array
    field: Array
    weight: Array

    @property
    def box(self) -> tuple[Array, Array]:
        """The lowest and the highest coordinates (3,) of the places, m."""
        return self.position.min(axis=0), self.position.max(axis=0)

    @property
    def weighing(self) -> float:
        """What the weights add to −2 times the restricted likelihood."""
        return float(3 * np.log(self.weight.sum()) - 3 * np.log(self.weight).sum())


class Process(NamedTuple):
    """The process of one `distance` (m), and what readings tell of it, as far as they see it.

    Of `sources` (m, 3) the directions `seen` (3m, r) of w, in units of `scale`, have the posterior
    variance a² σ²/(σ² + a² dᵢ) with d the `strength` (r,), and the mean `middle` (r,); all others
    keep a². `mean` is the weighted mean of the readings (3,) and of the features (3, 3m), `total`
    the sum of weights. `noise` σ² and `amplitude` a² maximise the restricted likelihood, `cost` is
    −2 times its logarithm.
    """

    distance: float
    sources: Array
    scale: float
    seen: Array
    strength: Array
    middle: Array
    mean: tuple[Array, Array]
    total: float
    noise: float
    amplitude: float
    cost: float

    @property
    def share(self) -> Array:
        """How much of each direction (r,) the readings tell, 0…1."""
        return self.amplitude * self.strength / (self.noise + self.amplitude * self.strength)


def lay_sources(low: Array, high: Array, distance: float) -> Array:
    """Places (m, 3) on the faces of a box at a distance outside of another, at most three quarters
    of it apart: what is between them then is smooth to exp(−2π 4/3) = 0.0002."""
    low, high = low - distance, high + distance
    counts = np.ceil((high - low) / (0.75 * distance)).astype(int) + 1
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    outside = (np.isclose(grid, low) | np.isclose(grid, high)).any(axis=1)
    return np.asarray(grid[outside])


def make_features(at: Array, sources: Array, scale: float) -> Array:
    """The field (n, 3, 3m) at places (n, 3) of a unit of every component of every source."""
    tensors = scale * dipole_tensor(at[:, None] - sources)
    return np.asarray(tensors.swapaxes(1, 2).reshape(len(at), 3, -1))


def fit_process(
    readings: Readings, box: tuple[Array, Array], distance: float, noise: float | None = None
) -> tuple[Process, Array]:
    """The process of sources at a distance, m, with noise and amplitude of the largest restricted
    likelihood, and how unlikely each reading (n,) is by all others, χ² of 3.

    With y and Φ the readings and features less their weighted means, d the eigenvalues of Φ Φᵀ and
    z the readings along its eigenvectors, λ = σ²/a², N = 3 n − 3,

        −2 ln L = Σ ln(1 + d/λ) + N ln σ² + (Σ z²/(1 + d/λ) + rest)/σ²

    where `rest` is what of y no eigenvector has. `noise`, nT, has the conjugate prior, an inverse
    gamma distribution of σ², as if it were known from 1/(2 `KNOWN_TO`²) numbers.
    """
    n, root = len(readings.field), np.sqrt(readings.weight)[:, None]
    sources = lay_sources(*box, distance)
    scale = distance**3
    features = make_features(readings.position, sources, scale)
    mean = (
        np.average(readings.field, axis=0, weights=readings.weight),
        np.average(features, axis=0, weights=readings.weight),
    )
    y = root * (readings.field - mean[0])
    phi = (root[..., None] * (features - mean[1])).reshape(3 * n, -1)
    strength, seen = _find_directions(phi)
    rows = phi @ seen  # orthogonal, of squares `strength`
    pull = rows.T @ y.ravel()
    along = pull**2 / strength
    many, rest = 3.0 * n - 3, max(float(np.square(y).sum() - along.sum()), 0.0)
    ratios = float(strength.max()) * np.geomspace(1e-10, 1e2, 61)
    shrunk = 1 + strength / ratios[:, None]
    squares = (along / shrunk).sum(axis=1) + rest
    if noise is not None:
        known = 1 / (2 * KNOWN_TO**2)
        squares, many = squares + known * noise**2, many + known
    variance = squares / many
    costs = np.log(shrunk).sum(axis=1) + many * np.log(variance) + many
    best = int(np.argmin(costs))
    process = Process(
        distance,
        sources,
        scale,
        seen,
        strength,
        pull / (strength + ratios[best]),
        mean,
        float(readings.weight.sum()),
        float(variance[best]),
        float(variance[best] / ratios[best]),
        float(costs[best]),
    )
    return process, _leave_out(process, rows, y, root[:, 0])


def _find_directions(phi: Array) -> tuple[Array, Array]:
    """Eigenvalues (r,) of Φ Φᵀ that count, and orthonormal directions (3m, r) of the weights."""
    wide = phi.shape[1] > phi.shape[0]
    strength, axes = eigh(phi @ phi.T if wide else phi.T @ phi, driver="evd")
    kept = strength > 1e-13 * strength[-1]  # beyond, double precision leaves nothing
    strength, axes = strength[kept], axes[:, kept]
    return strength, phi.T @ axes / np.sqrt(strength) if wide else axes


def _leave_out(process: Process, rows: Array, y: Array, root: Array) -> Array:
    """χ² (n,) of each reading's three components by the process and all other readings.

    With P the inverse covariance of the readings once their mean is taken out, the error of a
    reading left out is Pᵢᵢ⁻¹ (P y)ᵢ with covariance Pᵢᵢ⁻¹.
    """
    n = len(y)
    less = process.share / process.strength
    blocks = rows.reshape(n, 3, -1)
    p_y = (y.ravel() - rows @ (less * (rows.T @ y.ravel()))).reshape(n, 3)
    own = 1 - root**2 / process.total
    p = own[:, None, None] * np.eye(3) - np.einsum("nir,r,njr->nij", blocks, less, blocks)
    p = p + 1e-12 * np.eye(3)
    return np.asarray(
        np.einsum("ni,ni->n", p_y, np.linalg.solve(p, p_y[..., None])[..., 0]) / process.noise
    )


def predict(process: Process, at: Array) -> tuple[Array, Array]:
    """The field and its gradient (n, 12) at places (n, 3), m, and their covariance (n, 12, 12): the
    three components, nT, then ∂field_i/∂x_k row by row, nT/m."""
    field = make_features(at, process.sources, process.scale) - process.mean[1]
    gradients = process.scale * dipole_gradient(at[:, None] - process.sources)
    gradients = np.einsum("nsijk->niksj", gradients).reshape(len(at), 9, -1)  # j the component of w
    made, spread = project(process, np.concatenate([field, gradients], axis=1))
    made[:, :3] += process.mean[0]
    spread[:, :3, :3] += process.noise / process.total * np.eye(3)
    return made, spread


def project(process: Process, features: Array) -> tuple[Array, Array]:
    """What features (n, c, 3m) make of the weights (n, c), and its covariance (n, c, c)."""
    seen = features @ process.seen
    prior = features @ features.swapaxes(1, 2)
    spread = process.amplitude * (prior - (seen * process.share) @ seen.swapaxes(1, 2))
    return seen @ process.middle, spread
