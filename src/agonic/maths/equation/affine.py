"""The one equation, field = matrix @ (raw − bias), its residuals and their Jacobians.

A calibration has twelve local numbers: bias (3), then matrix row by row (9). Every residual
returns its Jacobian with respect to those twelve; a linear map (`model_basis`) reduces them to
the parameters of a model and gauge, and `expand_covariates` spreads them over a basis of
covariates.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array

SYMMETRIC = "symmetric"
FREE = "free"
ELLIPSE = "ellipse"

_UPPER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx yy zz xy xz yz
_LOWER = ((1, 0), (2, 0), (2, 1))  # yx zx zy

Derivatives = bool | Literal["bias"]
"""Which a residual is asked for: all twelve, none, or the three by the bias."""


class AttitudeShare(NamedTuple):
    """Which part of a residual's variance errors of the attitude make.

    `whole`: of errors that turn the field alike about any axis; `level`: of further ones about the
    vertical. `gain` is that of the matrix, near enough.
    """

    whole: float = 0.0
    level: float = 0.0
    gain: float = 1.0


NO_SHARE = AttitudeShare()


def correct(raw: Array, bias: Array, matrix: Array) -> Array:
    """Apply the calibration, field = matrix @ (raw − bias); broadcasts over leading axes."""
    return np.asarray((raw - bias) @ np.swapaxes(matrix, -1, -2))


@lru_cache(maxsize=16)
def model_basis(model: str, gauge: str = SYMMETRIC) -> Array:
    """The map from a model's parameters to the twelve local numbers, (12, m).

    `ellipse` has what two axes show, the entries xx yy xy of the matrix, beside the bias; zz is the
    mean of xx and yy. `sphere` has bias and one gain, `diagonal` bias and three gains, `full` bias
    and the six entries xx yy zz xy xz yz of a matrix that is symmetric or upper triangular (z axis
    kept); in the gauge `free` all nine, yx zx zy last.
    """
    columns = [np.eye(12)[:, :3]]
    chosen = _UPPER + (_LOWER if gauge == FREE else ())
    entries = np.zeros((12, len(chosen)))
    for k, (i, j) in enumerate(chosen):
        entries[3 + 3 * i + j, k] = 1.0
        if gauge == SYMMETRIC:
            entries[3 + 3 * j + i, k] = 1.0
    if model == ELLIPSE:
        columns.append(entries[:, [0, 1, 3]] + 0.5 * np.outer(entries[:, 2], [1, 1, 0]))
    elif model == "sphere":
        columns.append(entries[:, :3].sum(axis=1, keepdims=True))
    else:
        columns.append(entries[:, :3] if model == "diagonal" else entries)
    basis = np.hstack(columns)
    basis.flags.writeable = False  # all who ask for it share it
    return basis


def split(local: Array) -> tuple[Array, Array]:
    """Bias (…, 3) and matrix (…, 3, 3) of the twelve local numbers (…, 12)."""
    return local[..., :3], local[..., 3:].reshape(*local.shape[:-1], 3, 3)


def join(bias: Array, matrix: Array) -> Array:
    """The twelve local numbers of a bias and a matrix."""
    return np.concatenate([bias, matrix.reshape(*matrix.shape[:-2], 9)], axis=-1)


def magnitude_residual(
    raw: Array,
    bias: Array,
    matrix: Array,
    magnitude: Array | float,
    noise_sd: float = 0.0,
    *,
    differentiate: Derivatives = True,
) -> tuple[Array, Array]:
    """How far each reading lies from the ellipsoid, as a distance in raw space, and its Jacobian.

    With d = raw − bias, u = W d, û = u/|u|, s = Wᵀû:

        r = (|u| − F) / |s|,   ∂r/∂bias = −Wᵀa,   ∂r/∂W = a dᵀ − (r/|s|) û nᵀ,
        n = s/|s|,  p = (I − ûûᵀ) W n,  a = (û − r p/|u|) / |s|.

    The denominator turns a difference of magnitudes into a distance, so that equal noise on the
    three raw axes gives equal noise on every residual.

    `noise_sd` takes out, to second order, what noise alone does to r and to its correlation with
    its own Jacobian on a curved surface: E[J r] = J σ² ½ (tr H − 4 nᵀHn)/|s| with
    H = Wᵀ(I − ûûᵀ)W/|u|; on a sphere this is the familiar σ²/F. Without it the error of the fit
    stops shrinking at some tens of thousands of samples.

    Parameters: raw (n, 3), bias (3,), matrix (3, 3) or one for each reading (n, 3, 3), magnitude
    (n,) or scalar, noise_sd in raw units. Returns r (n,) in raw units and its Jacobian (n, 12),
    (n, 0) where it was not to `differentiate`, (n, 3) where by the bias only.
    """
    d, u = _correct_by_component(raw, bias, matrix)
    size = np.maximum(np.sqrt(_dot(u, u)), np.finfo(float).tiny)
    unit = u / size

    def bent(v: Array) -> Array:
        return (v - unit * _dot(unit, v)) / size

    def trace() -> Array:
        turned = _apply(np.swapaxes(matrix, -1, -2), unit)
        return np.asarray((np.sum(matrix**2, axis=(-2, -1)) - _square(turned)) / size)

    g = size - magnitude
    return _distance(d, matrix, g, unit, bent, trace, noise_sd, None, differentiate)


def dip_residual(
    raw: Array,
    bias: Array,
    matrix: Array,
    down: Array,
    horizontal: Array | float,
    vertical: Array | float,
    noise_sd: float = 0.0,
    share: AttitudeShare = NO_SHARE,
    *,
    differentiate: Derivatives = True,
) -> tuple[Array, Array]:
    """How far the field of each reading is from the dip it should have, and the Jacobian.

    With u = W (raw − bias), z = u·d along the down direction d, h = |u − z d|, and the intensities
    H, Z and F = √(H² + Z²) that they should be:

        g = (H z − Z h)/F,   r = g/|Wᵀe|,   e = ∂g/∂u = (H d − Z ĥ)/F,

    a distance in raw space as in `magnitude_residual`, across it. The two together hold what the
    pair z − Z and h − H holds, but an error of roll or pitch enters this one only.

    Such an error stands in d, so in r and in its Jacobian alike, and the mean of Σ J r is not zero:
    a sensor that lay still for nine tenths of a log was off by five standard errors. The part of r
    that it makes is taken as an angle, r (|s| F/(gain |u|))^share with s = Wᵀe, whose derivative
    turns with the reading and not with d.

    Parameters: as in `magnitude_residual`, and down (n, 3) unit vectors, horizontal and vertical
    (n,) or scalar. Returns r (n,) in raw units and its Jacobian (n, 12).
    """
    d, u = _correct_by_component(raw, bias, matrix)
    below = down.T
    f = np.hypot(horizontal, vertical)
    z = _dot(below, u)
    level = u - below * z
    h = np.maximum(np.sqrt(_dot(level, level)), np.finfo(float).tiny)
    level /= h
    e = (below * horizontal - level * vertical) / f
    bend = -vertical / (f * h)

    def bent(v: Array) -> Array:
        return (v - below * _dot(below, v) - level * _dot(level, v)) * bend

    def trace() -> Array:
        free = np.sum(matrix**2) - _square(matrix.T @ below) - _square(matrix.T @ level)
        return np.asarray(free * bend)

    g = (horizontal * z - vertical * h) / f
    angle = _make_angle(u, f, share)
    return _distance(d, matrix, g, e, bent, trace, noise_sd, angle, differentiate)


def azimuth_residual(
    raw: Array,
    bias: Array,
    matrix: Array,
    across: Array,
    dip: tuple[Array, Array | float, Array | float] | None = None,
    share: AttitudeShare = NO_SHARE,
    *,
    differentiate: Derivatives = True,
) -> tuple[Array, Array]:
    """How far the field of each reading is from the azimuth it should have, and the Jacobian.

    With u = W (raw − bias) and `across` (n, 3) the horizontal unit vector square to the direction
    of the field: r = u·across/|Wᵀ across|, a distance in raw space as in `magnitude_residual`. It
    is the only one of the three that an error of the known heading enters. With `dip` (down,
    horizontal and vertical intensity) a `share` is taken as an angle, as in `dip_residual`: of the
    whole field, and of its horizontal part.
    """
    d, u = _correct_by_component(raw, bias, matrix)
    e, none = across.T, np.zeros(len(raw))
    angle = None
    if dip is not None:
        down, horizontal, vertical = dip
        level = u - down.T * _dot(down.T, u)
        angle = _make_angle(u, np.hypot(horizontal, vertical), share, level, horizontal)
    g, bent = _dot(u, e), np.zeros_like
    return _distance(d, matrix, g, e, bent, lambda: none, 0.0, angle, differentiate)


class _Angle(NamedTuple):
    """What makes part of a distance an angle: the power of |s|, the rest of the factor (n,), and
    the gradient of its logarithm along u (3, n)."""

    power: float
    factor: Array
    gradient: Array


def _make_angle(
    u: Array,
    magnitude: Array | float,
    share: AttitudeShare,
    level: Array | None = None,
    horizontal: Array | float = 1.0,
) -> _Angle | None:
    """(|s| F/(gain |u|))^whole (|s| H/(gain |h|))^level, of which |s| is left to `_distance`."""
    power = share.whole + share.level
    if not power:
        return None
    square = np.maximum(_square(u), np.finfo(float).tiny)
    factor = (magnitude / (share.gain * np.sqrt(square))) ** share.whole
    gradient = -share.whole * u / square
    if level is not None and share.level:
        square = np.maximum(_square(level), np.finfo(float).tiny)
        factor = factor * (horizontal / (share.gain * np.sqrt(square))) ** share.level
        gradient -= share.level * level / square
    return _Angle(power, factor, gradient)


def _correct_by_component(raw: Array, bias: Array, matrix: Array) -> tuple[Array, Array]:
    """d = raw − bias and u = W d, (3, n): component by component, for long inner loops."""
    d = np.subtract(raw.T, np.atleast_2d(bias).T, order="C")
    return d, _apply(matrix, d)


def _apply(matrix: Array, vectors: Array) -> Array:
    """W v of vectors (3, n), by one matrix (3, 3) or each by its own (n, 3, 3)."""
    if matrix.ndim == 2:
        return matrix @ vectors
    return np.asarray(np.einsum("nij,jn->in", matrix, vectors))


def _distance(
    d: Array,
    matrix: Array,
    g: Array,
    e: Array,
    bent: Callable[[Array], Array],
    trace: Callable[[], Array],
    noise_sd: float,
    angle: _Angle | None,
    differentiate: Derivatives,
) -> tuple[Array, Array]:
    """A condition g(u) = 0 on the field as a distance in raw space, and its Jacobian (n, 12).

    e = ∂g/∂u (3, n), `bent` multiplies by the second derivative G = ∂²g/∂u², and `trace` gives
    that of WᵀGW, (n,). With s = Wᵀe, n = s/|s|:

        r = g/|s|,   a = (e − r G W n)/|s|,   ∂r/∂bias = −Wᵀa,   ∂r/∂W = a dᵀ − (r/|s|) e nᵀ
    """
    back = np.swapaxes(matrix, -1, -2)
    s = _apply(back, e)
    gradient = np.sqrt(_dot(s, s))
    r, scale, power = g / gradient, 1.0 / gradient, 1.0
    if angle is not None:
        r, scale = (x * angle.factor * gradient**angle.power for x in (r, scale))
        power = 1.0 - angle.power
    if not differentiate and not noise_sd:
        return r, np.empty((d.shape[1], 0))
    normal = s / gradient
    turned = _apply(matrix, normal)
    across = bent(turned)
    bent_by = (
        0.5 * noise_sd**2 * (trace() - 4.0 * _dot(turned, across)) / gradient if noise_sd else 0.0
    )
    if not differentiate:
        return r - bent_by, np.empty((d.shape[1], 0))
    a = e * scale - across * (power * r / gradient)
    if angle is not None:
        a += angle.gradient * r
    if differentiate == "bias":
        return r - bent_by, -_apply(back, a).T
    jacobian = np.empty((12, d.shape[1]))
    np.negative(_apply(back, a), out=jacobian[:3])
    tilt = e * (power * r / gradient)
    entries = jacobian[3:].reshape(3, 3, -1)
    np.multiply(a[:, None], d[None], out=entries)
    entries -= tilt[:, None] * normal[None]
    return r - bent_by, jacobian.T


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->j", a, b))


def _square(a: Array) -> Array:
    return _dot(a, a)


def expand_covariates(jacobian: Array, covariates: Array) -> Array:
    """The Jacobian by coefficients when each parameter is linear in covariates φ.

    parameter_j(i) = Σ_k φ_k(i) c_jk, so ∂r_i/∂c_jk = ∂r_i/∂parameter_j · φ_k(i).
    jacobian (n, m), covariates (n, k) → (n, m·k), coefficient k fastest.
    """
    return (jacobian.T[:, None] * covariates.T).reshape(-1, len(jacobian)).T


def correction_jacobian(raw: Array, bias: Array, matrix: Array) -> Array:
    """∂field/∂(twelve local numbers) of field = matrix @ (raw − bias), (n, 3, 12).

    Parameters: raw (n, 3), bias (3,) or (n, 3), matrix (3, 3) or (n, 3, 3).
    """
    d = np.atleast_2d(raw - bias)
    jacobian: NDArray[Any] = np.zeros((len(d), 3, 12))
    jacobian[:, :, :3] = -matrix
    for i in range(3):
        jacobian[:, i, 3 + 3 * i : 6 + 3 * i] = d
    return jacobian
