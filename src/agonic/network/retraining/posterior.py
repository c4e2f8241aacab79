"""What is known of base and weights, moved on by readings: a posterior that is the next prior.

Errors of what is running are a step of the base and one of the weights ω,

    field = (I + M) b + p + network(x; ω + δ),   θ = (M row by row, each with its p; δ)

with b the field by the base. θ is Gaussian about zero with the covariance C that the last training
left, wider by what the base may have moved since:

    θ = L z,   z ~ N(0, I),   L Lᵀ = C + Q,   Q = size_p² of p, size_M² of M

The two sizes are those of the largest evidence (MacKay 1992) of the new readings, with G = JᵀJ and
h = Jᵀr over the noise at θ = 0:

    log p(r) = ½ hᵀL A⁻¹ Lᵀh − ½ log |A| + …,   A = I + Lᵀ G L

An error e of the known field that all rows share, as the ring current over half an orbit, is a step
as well, of the size by which visits scatter: it is solved for beside z and left out of θ.

Without a base the step is that of the readings that go in, U [(I + M) x + p, 1].

So a sensor that has not changed is known better after each training, what the readings do not show
stays as it was, and one that has changed is followed in bias and matrix with the weights kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.linalg import block_diag

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.retraining import RetrainerParams, Running, Window
from agonic.calibration.sources import measure_width
from agonic.calibration.thermal import Thermal
from agonic.maths.equation import network as kernel
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.estimation import domain, leastsq
from agonic.maths.estimation.noise.residuals import Noise, robust_scale
from agonic.network.fit.solve import ROOM
from agonic.network.maths.robust import solve_with_noise

Base = Affine | Thermal
STEP = 12
"""Numbers of a step of the base: M and p."""
_SHARES = np.r_[0.0, 10.0 ** np.arange(-3.0, 0.25, 0.5)]
"""Sizes that a step may have, as shares of the largest."""
_SINGULAR = 1e-12
"""Share of the largest eigenvalue below which rounding has made it."""


class Sizes(NamedTuple):
    """Standard deviations of a step of the base: of p, nT, and of an entry of M."""

    bias: float
    matrix: float

    @property
    def variances(self) -> Array:
        """Of M and p, (12,)."""
        return np.tile([*[self.matrix**2] * 3, self.bias**2], 3)


def describe_prior(running: Running) -> Array:
    """The covariance (k, k) of θ by what a calibration states of itself."""
    base = running.base if isinstance(running, Network) else running
    step = np.empty((0, 0))
    if base is not None:
        own = _own(base)
        step = own.onto @ own.covariance @ own.onto.T
    if not isinstance(running, Network):
        return step
    stated = np.eye(running.shape.size) if running.covariance is None else running.covariance
    return block_diag(running.base_sd_ratio**2 * step, stated)


def train_on(
    running: Running,
    covariance: Array,
    rows: Window,
    params: RetrainerParams,
    *,
    least: float,
    weights: bool,
    common: float = 0.0,
) -> tuple[Running, Array, int]:
    """What is running after some rows, the covariance (k, k) of its errors θ, and the iterations.

    `least` residuals of what ran counted as one, which a fit to a few readings does not show;
    `common` is the sd, nT, of an error of the known field that all of the rows share.
    """
    model, fixed = _Model(running, rows), np.zeros_like(covariance)
    if not weights:
        fixed[model.own :, model.own :] = covariance[model.own :, model.own :]
        covariance = covariance * np.outer(*[np.arange(model.size) < model.own] * 2)
    vector = rows.wanted.shape[1] == 3
    most = Sizes(params.bias_sd * model.strength, params.matrix_sd if vector else 0.0)
    shared = model.step * np.sqrt(Sizes(common, common / model.strength).variances)
    sizes = _find_sizes(model, covariance, shared, most, least)
    root = _factor(model.loosen(covariance, sizes))
    r = root.shape[1]
    if not r:  # neither the prior nor the evidence lets anything move
        return running, covariance + fixed, 0
    solution, noise = _solve(model.pieces, np.hstack([root, shared]), least)
    after = root @ solution.covariance[:r, :r] @ root.T + fixed
    moved = _compose(running, root @ solution.params[:r], model)
    stated = _state_errors(moved, after, sizes, noise.sd)
    return stated, after, solution.iterations


def _factor(covariance: Array) -> Array:
    """L (k, r) with L Lᵀ the covariance; errors that are exactly zero have no column."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    kept = values > _SINGULAR * max(values[-1], 1e-300)
    return np.asarray(safe[:, None] * vectors[:, kept] * np.sqrt(values[kept]))


def _solve(pieces: leastsq.Pieces, root: Array, least: float) -> tuple[leastsq.Solution, Noise]:
    """z by residuals and Jacobian of θ, and the noise of a residual."""

    def whitened(z: Array) -> Iterator[tuple[Array, Array]]:
        for residual, jacobian in pieces(root @ z):
            yield residual, jacobian @ root

    zero = np.zeros(root.shape[1])
    first = np.concatenate([residual for residual, _ in whitened(zero)])
    scale = max(robust_scale(first), 1e-6)
    return solve_with_noise(
        whitened,
        zero,
        scale=scale,
        prior=lambda z: (z, np.eye(len(z))),
        least=least,
        tolerance=0.1,
    )


def _find_sizes(
    model: _Model, covariance: Array, shared: Array, most: Sizes, least: float
) -> Sizes:
    """The sizes of the step with the largest evidence, one after the other until they stay; the
    noise is what is left where all sizes are possible, to first order."""
    now = list(model.pieces(np.zeros(model.size)))

    def pieces(theta: Array) -> Iterator[tuple[Array, Array]]:
        for residual, jacobian in now:
            yield residual + jacobian @ theta, jacobian

    solution, noise = _solve(pieces, _factor(model.loosen(covariance, most)), least)
    weight = noise.loss.weight((solution.residuals / noise.sd) ** 2)
    weight /= noise.sd**2 * max(noise.correlation, least)
    residual, jacobian = (np.concatenate(parts) for parts in zip(*now, strict=True))
    gram, slope = (jacobian.T * weight) @ jacobian, jacobian.T @ (weight * residual)

    def evidence(sizes: Sizes) -> float:
        root = np.hstack([_factor(model.loosen(covariance, sizes)), shared])
        inner = np.eye(root.shape[1]) + root.T @ gram @ root
        towards = root.T @ slope
        _, size = np.linalg.slogdet(inner)
        return float(towards @ np.linalg.solve(inner, towards) - size) / 2

    best, before = Sizes(0.0, 0.0), None
    while best != before:
        before = best
        best = max((best._replace(bias=share * most.bias) for share in _SHARES), key=evidence)
        best = max((best._replace(matrix=share * most.matrix) for share in _SHARES), key=evidence)
    return best


class _Model:
    """The residuals of some rows as a function of θ, and the part of θ (k, 12) that a step is."""

    def __init__(self, running: Running, rows: Window) -> None:
        self.rows, self.network = rows, running if isinstance(running, Network) else None
        # what takes the step; of a network that stands alone its hidden weights do
        base = running.base if isinstance(running, Network) else running
        self.base, self.own = np.zeros((len(rows), 3)), 0
        if base is not None:
            self.own = STEP
            self.base = base.correct(rows.raw, **{name: rows.columns[name] for name in base.needs})
        if self.network is not None:
            self.x = self.network.scaled(rows.raw, rows.columns)
            self.shape, self.weights = self.network.shape, self.network.weights
        self.size = self.own + (0 if self.network is None else self.shape.size)
        self.step = np.eye(self.size, STEP)
        if base is None:
            assert self.network is not None
            self.step = _step_input(self.network)
        field = self.field(np.zeros(self.size))[0]
        self.strength = float(np.sqrt(np.mean((field**2).sum(axis=1))))

    def loosen(self, covariance: Array, sizes: Sizes) -> Array:
        """C + Q."""
        return np.asarray(covariance + self.step * sizes.variances @ self.step.T)

    def field(self, theta: Array) -> tuple[Array, Array]:
        """The field (n, 3) and its Jacobian (n, 3, k)."""
        field, jacobian = self.base, np.zeros((len(self.base), 3, self.size))
        if self.own:
            step = theta[:STEP].reshape(3, 4)
            for axis in range(3):
                jacobian[:, axis, 4 * axis : 4 * axis + 3] = self.base
                jacobian[:, axis, 4 * axis + 3] = 1.0
            field = field + self.base @ step[:, :3].T + step[:, 3]
        if self.network is None:
            return field, jacobian
        layers = kernel.split(self.weights + theta[self.own :], self.shape)
        half, along = self.network.output_half, np.ones((len(field), 1))
        if self.shape.outputs == 1:
            along = self.base / np.linalg.norm(self.base, axis=1, keepdims=True)
        added = self.network.output_middle + half * kernel.forward(layers, self.x)
        jacobian[:, :, self.own :] = along[:, :, None] * (half * kernel.jacobian(layers, self.x))
        return field + added * along, jacobian

    def pieces(self, theta: Array) -> Iterator[tuple[Array, Array]]:
        """Residuals of an axis after the other, or of the magnitude, with their Jacobian."""
        field, jacobian = self.field(theta)
        wanted = self.rows.wanted
        if wanted.shape[1] == 1:
            length = np.linalg.norm(field, axis=1)
            along = field / length[:, None]
            yield length - wanted[:, 0], np.einsum("ni,nik->nk", along, jacobian)
            return
        for axis in range(3):
            yield field[:, axis] - wanted[:, axis], jacobian[:, axis]


def _step_input(network: Network) -> Array:
    """A step of what goes into a network without a base as one of its weights (m, 12).

    U [(I + M) x + p/h, 1] is that of U (I + M), its constants U p/h on.
    """
    step = np.zeros((network.shape.size, STEP))
    if "field" in network.inputs:
        before = network.inputs[: network.inputs.index("field")]
        own = sum(map(measure_width, before)) + np.arange(3)
        into = np.zeros((network.hidden.shape[1], 4))
        into[own, np.arange(3)], into[-1, 3] = 1.0, 1.0 / network.output_half
        step[: network.hidden.size] = np.kron(network.hidden[:, own], into)
    return step


def _compose(running: Running, theta: Array, model: _Model) -> Running:
    """Base and weights after the step: W' = (I + M) W, b' = b − W'⁻¹ p, of a thermal one at all
    temperatures alike; and where the weights hold."""
    step = theta[:STEP].reshape(3, 4)
    onto, shift = np.eye(3) + step[:, :3], step[:, 3]
    if isinstance(running, Affine):
        matrix = onto @ running.matrix
        bias = running.bias - np.linalg.solve(matrix, shift)
        return replace(running, bias=bias, matrix=matrix)
    if isinstance(running, Thermal):
        gain, bias = onto @ running.matrix, np.array(running.bias)
        bias[0] -= np.linalg.solve(gain[0], shift)
        return replace(running, bias=bias, matrix=gain)
    base = None if running.base is None else _compose(running.base, theta[:STEP], model)
    layers = kernel.split(running.weights + theta[model.own :], running.shape)
    moved = replace(
        running,
        base=cast(Base | None, base),
        hidden=layers[0],
        second=layers[1] if len(layers) > 2 else None,
        output=layers[-1],
    )
    return _cover(moved, model.x)


def _cover(network: Network, x: Array) -> Network:
    """The network that holds also where it was trained now, and as far as it reaches there."""
    distance = domain.compute_distances(x, network.centres)
    centres, reach = network.centres, network.reach
    if (distance > reach).any():
        centres, found = domain.cover(np.concatenate([centres, x]), len(centres))
        reach = max(reach, found)
    if network.bound is None:
        return replace(network, centres=centres, reach=reach)
    added = network.output_middle + network.output_half * kernel.forward(network.layers, x)
    longest = ROOM * float(np.linalg.norm(added, axis=1).max())
    return replace(network, centres=centres, reach=reach, bound=max(network.bound, longest))


def _state_errors(running: Running, after: Array, sizes: Sizes, noise: float) -> Running:
    """The calibration with the errors that its own numbers have after the training.

    Those that are no step, as the coefficients of a thermal base over temperature, follow by their
    regression K on the step: C + K (after − before) Kᵀ.
    """
    if isinstance(running, Network):
        base, m = running.base, running.shape.size
        if base is not None:
            base = cast(Base, _state_errors(base, after[:STEP, :STEP], sizes, noise))
        return replace(
            running, base=base, covariance=after[-m:, -m:], noise=noise, base_sd_ratio=1.0
        )
    own = _own(running)
    gain = running.matrix if isinstance(running, Affine) else running.matrix[0]
    settings: dict[str, Any] = {"gauge": FREE, "noise": noise / np.cbrt(abs(np.linalg.det(gain)))}
    if isinstance(running, Affine):
        settings["model"] = "full"
    elif running.covariance is None:
        return replace(running, **settings)
    prior = own.covariance + own.back * sizes.variances @ own.back.T
    step = own.onto @ prior @ own.onto.T
    onto = prior @ own.onto.T @ np.linalg.pinv(step, rcond=_SINGULAR, hermitian=True)
    return replace(running, covariance=prior + onto @ (after - step) @ onto.T, **settings)


class _Own(NamedTuple):
    """The covariance (q, q) of a base's own numbers in the free gauge; the step (12, q) that they
    are, and the numbers (q, 12) that are a step."""

    covariance: Array
    onto: Array
    back: Array


def _own(base: Affine | Thermal) -> _Own:
    """Of a thermal base a step moves the powers 0: dW = M W, db = −W⁻¹ p."""
    matrix = base.matrix[0] if isinstance(base, Thermal) else base.matrix
    step = np.zeros((STEP, STEP))
    for axis in range(3):
        step[:3, 4 * axis + 3] = -np.linalg.inv(matrix)[:, axis]
        for k in range(3):
            step[3 + 3 * axis : 6 + 3 * axis, 4 * axis + k] = matrix[k]
    free = np.linalg.pinv(model_basis("full", FREE))
    powers = base.degree + 1 if isinstance(base, Thermal) else 1
    rates = 3 if isinstance(base, Thermal) and base.rate is not None else 0
    if isinstance(base, Interference):
        rates = base.coefficients.size
    at = powers * np.arange(STEP)
    size = STEP * powers + rates
    back, onto = np.zeros((size, STEP)), np.zeros((STEP, size))
    back[at], onto[:, at] = free @ step, np.linalg.inv(free @ step)
    if base.covariance is None:
        return _Own(np.zeros((size, size)), onto, back)
    model = "full" if isinstance(base, Thermal) else base.model
    wide = np.kron(free @ model_basis(model, base.gauge), np.eye(powers))
    whole = np.zeros((size, wide.shape[1] + rates))
    whole[: len(wide), : wide.shape[1]] = wide
    whole[len(wide) :, wide.shape[1] :] = np.eye(rates)
    return _Own(whole @ base.covariance @ whole.T, onto, back)
