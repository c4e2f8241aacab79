"""The training itself: base, scales, weights, and again without what stands out."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.base import Validity
from agonic.calibration.network import Network
from agonic.calibration.sources import measure_width
from agonic.calibration.thermal import Thermal
from agonic.maths.equation import network
from agonic.maths.estimation import domain
from agonic.maths.estimation.domain import estimate_neighbour_covariance
from agonic.maths.estimation.noise.residuals import (
    Noise,
    correlation_length,
    estimate_noise,
    robust_scale,
)
from agonic.network.fit.base import BaseFit
from agonic.network.fit.problem import Problem, compute_errors
from agonic.network.maths import levenberg_marquardt
from agonic.provenance import Provenance

BLOCKS = 20
"""Of time, for cross-validation and for what is held out of a training."""


def number_blocks(n: int, count: int = BLOCKS) -> Index:
    """The number of the block of time that each of n rows in order is in, (n,)."""
    return np.asarray(np.arange(n) * count // max(n, 1), dtype=np.intp)


class Scale(NamedTuple):
    """Inputs and targets as −1…1: x = (input − middle)/half, y = (target − middle)/half."""

    input_middle: Array
    input_half: Array
    output_middle: Array
    output_half: float


class Scaled(NamedTuple):
    """What a network has to learn from some of the rows, and what it takes to get back.

    `between` is that between −1 and 1, with the inputs as they are; `field` (k, 3) the base's and
    `target` (k, o) what it leaves, nT.

    With noise in the inputs a network learns how the field was distributed rather than what the
    sensor does: where the field kept to a plane, say, it takes every reading back into it. The
    known field says what the noise was: with e = field − known and W the matrix of the base,

        x from raw − s W⁻¹ e,   s = 1 − sd²/noise²

    s being the share of e that is the sensor's, sd the standard deviation of the reference.
    """

    problem: Problem
    rows: Index
    base: BaseFit
    field: Array
    target: Array
    scale: Scale
    between: levenberg_marquardt.Problem

    @property
    def noisy(self) -> bool:
        """Whether readings go in and a base says what noise of the field is in them."""
        return self.base.calibration is not None and "field" in self.problem.settings.inputs

    def find_noiseless_inputs(self, error: Array) -> Array:
        """Scaled inputs (k, i) without noise when the field is off by `error` (k, o), nT."""
        inputs = self.problem.inputs[self.rows].copy()
        if self.noisy:
            if error.shape[1] == 1:
                error = error * self.field / np.linalg.norm(self.field, axis=1, keepdims=True)
            names = self.problem.settings.inputs
            at = sum(measure_width(name) for name in names[: names.index("field")])
            noise = robust_scale(error.ravel())
            share = 1.0 - min((self.problem.sd / max(noise, 1e-300)) ** 2, 1.0)
            base = self.base.calibration
            assert base is not None
            matrix = base.matrix
            if isinstance(base, Thermal):
                matrix = base.matrix_at(self.problem.columns["temperature"][self.rows])
            # errors of the field as errors of the readings, W⁻¹ e
            off = np.linalg.solve(matrix, error[:, :, None])[:, :, 0]
            inputs[:, at : at + 3] -= share * off
        return np.asarray((inputs - self.scale.input_middle) / self.scale.input_half)


ROOM = 1.25
"""The longest correction, over the longest that training saw."""


class Training(NamedTuple):
    """A network trained on some of the rows, what it leaves there, and how it went."""

    calibration: Network
    trained: levenberg_marquardt.Training
    noise: Noise
    residuals: Array  # (k, o) nT, of the rows it was given
    weights: Array  # (k,)
    regression: float


def scale_problem(problem: Problem, rows: Index, start: Network | None = None) -> Scaled:
    """What a network has to learn from some of the rows; from `start` base and scales are taken."""
    settings = problem.settings
    base = problem.fit_base(rows) if start is None else BaseFit(start.base)
    field = problem.apply_base(base.calibration, rows)
    target = -compute_errors(field, problem.wanted[rows])
    size = np.linalg.norm(target - np.median(target, axis=0), axis=1)
    # a network bends to what an affine leaves, but not to anything
    used = size <= (12.0 * max(robust_scale(size), 1e-300) if settings.robust else np.inf)
    scale = (
        _find_scale(problem, rows[used], target[used])
        if start is None
        else Scale(*(getattr(start, n) for n in Scale._fields))
    )
    between = levenberg_marquardt.Problem(
        x=(problem.inputs[rows] - scale.input_middle) / scale.input_half,
        target=(target - scale.output_middle) / scale.output_half,
        hidden=settings.hidden,
        weight=None if used.all() else used.astype(np.float64),
    )
    return Scaled(problem, rows, base, field, target, scale, between)


def train(problem: Problem, rows: Index, start: Network | None = None) -> Training:
    """The network of some of the rows; from `start` its base, scales and weights are taken."""
    task = scale_problem(problem, rows, start)
    found, noise, last = _train_until_settled(task, None if start is None else start.weights)
    outputs = network.forward(network.split(found.weights, last.shape), last.x)
    weights = np.ones(len(rows)) if last.weight is None else last.weight
    kept, size, residuals = weights > 0, task.scale.output_half, outputs - last.target
    # what the network leaves that is no noise: neighbours share it; a fit takes off
    # sd² (weights determined)/(residuals) of what they share, even of noise
    left = residuals[kept]
    taken = noise.sd**2 * found.effective * noise.correlation / left.size
    square, error = estimate_neighbour_covariance(left, last.x[kept])
    square += taken
    ratio, base_noise = 1.0, task.base.noise
    if base_noise is not None:  # standard errors of the base with the noise that the network leaves
        without = noise.sd * size * float(np.sqrt(noise.correlation))
        ratio = min(1.0, without / max(base_noise, 1e-300))
    calibration = replace(
        _network(task, found, noise, outputs, kept),
        unmodelled=size * (float(np.sqrt(square)) if square > error else 0.0),
        base_sd_ratio=ratio,
    )
    return Training(
        calibration=calibration,
        trained=found,
        noise=noise._replace(sd=noise.sd * size),
        residuals=residuals * size,
        weights=weights,
        regression=correlate(outputs[kept], last.target[kept]),
    )


def _find_scale(problem: Problem, rows: Index, target: Array) -> Scale:
    """Scales from the rows; one for the three axes of a vector, so that distances keep meaning."""
    inputs = problem.inputs[rows]
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    half, at = (high - low) / 2, 0
    for name in problem.settings.inputs:
        own = slice(at, at + measure_width(name))
        half[own] = half[own].max()
        at += measure_width(name)
    least, most = target.min(axis=0), target.max(axis=0)
    whole = float((most - least).max()) / 2
    return Scale((low + high) / 2, half, (least + most) / 2, whole or 1.0)


def _train_until_settled(
    task: Scaled, warm: Array | None
) -> tuple[levenberg_marquardt.Training, Noise, levenberg_marquardt.Problem]:
    """Train until the weights of rows, and their correlation, are what they were taken for.

    Rows that stand out lose their weight, and any may have it back; inputs lose their noise.
    Returns the scaled problem with its inputs as they are.
    """
    settings, scaled, size = task.problem.settings, task.between, task.scale.output_half
    x = scaled.x
    # every fifth block of time
    held = (number_blocks(len(x)) % 5 == 2) & (settings.stopping == "early")
    seen, unseen = np.flatnonzero(~held), np.flatnonzero(held)
    error = -(task.scale.output_middle + size * scaled.target)
    epochs: tuple[levenberg_marquardt.Epoch, ...] = ()
    start, ridge, twice = warm, None, task.noisy
    for _ in range(4):
        calm = scaled._replace(x=task.find_noiseless_inputs(error))
        shown = calm.subset(seen) if held.any() else calm
        other = calm.subset(unseen) if held.any() else None
        if start is None:
            start, epochs = levenberg_marquardt.choose_start(
                shown, seed=settings.seed, restarts=settings.restarts, held_out=other
            )
        found = levenberg_marquardt.train(
            shown,
            start,
            stopping=settings.stopping,
            ridge=ridge,
            held_out=other,
            most_epochs=settings.most_epochs,
        )
        epochs += found.epochs
        left = network.forward(network.split(found.weights, scaled.shape), x) - scaled.target
        error = size * left
        noise, weight = _estimate_noise(left, scaled, found.weights, settings.robust)
        before = np.ones(len(weight)) if scaled.weight is None else scaled.weight
        same = np.abs(weight - before).max() < 0.1
        if same and not twice and abs(noise.correlation / scaled.correlation - 1) < 0.2:
            break
        twice = False
        scaled = scaled._replace(
            weight=None if (weight == 1.0).all() else weight, correlation=noise.correlation
        )
        start, ridge = found.weights, found.ridge if settings.stopping == "bayesian" else None
    return found._replace(epochs=epochs), noise, scaled


def _estimate_noise(
    left: Array, scaled: levenberg_marquardt.Problem, weights: Array, robust: bool
) -> tuple[Noise, Array]:
    """The noise of what is left (k, o), axis after axis, and the weight of each row.

    What counts as one is asked of what is left times the activity of the nodes, which is what moves
    the weights: an error that lasts for minutes says little of a sensor that turns in seconds.
    """
    noise = estimate_noise(left.T.ravel(), robust, len(weights))
    weight = np.asarray(noise.loss.weight((left / noise.sd) ** 2).min(axis=1))
    if noise.correlation > 1.5:
        active = network.activity(network.split(weights, scaled.shape), scaled.x)
        active -= active.mean(axis=0)
        lengths = [
            correlation_length(left[:, k] * column, weight)
            for k in range(left.shape[1])
            for column in active.T
        ]
        # so that the evidence has something to go by
        most = len(left) * left.shape[1] / (3.0 * len(weights))
        noise = noise._replace(correlation=min(float(np.median(lengths)), max(most, 1.0)))
    return noise, weight


def correlate(outputs: Array, targets: Array) -> float:
    """R between outputs and targets, all components together (the paper's coefficient)."""
    a, b = outputs.ravel(), targets.ravel()
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0 else 0.0


def _network(
    task: Scaled, found: levenberg_marquardt.Training, noise: Noise, outputs: Array, kept: Mask
) -> Network:
    """The calibration, with where it holds."""
    problem, base, scale, target = task.problem, task.base.calibration, task.scale, task.target
    layers = network.split(found.weights, task.between.shape)
    centres, reach = domain.cover(task.between.x[kept], 64)
    added = scale.output_middle + scale.output_half * outputs[kept]
    longest = float(np.linalg.norm(added, axis=1).max())
    samples, wanted = problem.samples, problem.wanted
    misfit = target[kept] if base is not None else target[kept] - target[kept].mean(axis=0)
    return Network(
        base=base,
        inputs=problem.settings.inputs,
        **scale._asdict(),
        hidden=layers[0],
        second=layers[1] if len(layers) > 2 else None,
        output=layers[-1],
        centres=centres,
        # readings that lie on a curve are close together; the network holds a little beside it,
        # too
        reach=max(reach, 0.1),
        bound=None if base is None else ROOM * longest,
        misfit=float(np.sqrt(np.mean(misfit**2))),
        covariance=found.covariance,
        magnitude=float(np.sqrt(np.mean((wanted**2).sum(axis=1)))),
        noise=noise.sd * scale.output_half,
        validity=Validity.of(samples),
        provenance=Provenance(
            inputs=(samples.origin,),
            settings={"reference": problem.source, **problem.settings.to_record()},
            method=("wang-sheng-he-cheng-2020", "foresee-hagan-1997", "nguyen-widrow-1990"),
        ),
        unit_out="nT",
        **problem.ends._asdict(),
    )
