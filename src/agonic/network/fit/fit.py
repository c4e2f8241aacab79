"""`fit_network`: a network on top of an affine calibration, from samples with a known field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.network import Network
from agonic.errors import AgonicError
from agonic.maths.equation.coverage import find_cells
from agonic.maths.equation.network import Nodes
from agonic.network.fit import evidence
from agonic.network.fit.problem import Problem, compute_errors, pose_problem
from agonic.network.fit.result import Comparison, Errors, NetworkFit
from agonic.network.fit.settings import Base, Settings, Target
from agonic.network.fit.solve import Training, correlate, train
from agonic.network.maths.blocks import number_blocks
from agonic.network.maths.levenberg_marquardt import Stopping
from agonic.reference import Reference
from agonic.samples import Samples


def fit_network(
    samples: Samples,
    reference: Reference,
    *,
    hidden: Nodes = 3,
    inputs: tuple[str, ...] = ("field",),
    base: Base = "affine",
    target: Target = "vector",
    stopping: Stopping = "bayesian",
    compared: bool = True,
    start: Network | None = None,
    robust: bool = True,
    restarts: int = 4,
    most_epochs: int = 300,
    seed: int = 0,
) -> NetworkFit:
    """A network of one or two hidden layers that corrects what an affine calibration leaves.

        field = base(raw) + g(x) · network(x),   network(x) = V [tanh(U [x, 1]), 1]

    or V [tanh(W [tanh(U [x, 1]), 1]), 1] with two hidden layers; trained by Levenberg–Marquardt
    backpropagation, and compared with its base on blocks of time that neither has seen.

    Parameters
    ----------
    samples : readings, and the columns that `inputs` name.
    reference : for `target="vector"` the field at every reading in axes m or b, or in axes n with
        roll, pitch and heading in the samples; for "magnitude" any reference.
    hidden : nodes of the hidden layer; two numbers, (5, 3), are two layers.
    inputs : what goes in: "field" (the readings), "temperature", "temperature_rate", "current_A",
        "throttle", "second", or any disturber of the samples, as "motor1_duty".
    base : "affine" fits one from the same readings; an `Affine`, `Interference` or `Thermal` is
        kept as it is; None leaves everything to the network, as in the paper.
    target : "vector", or "magnitude": no attitude is needed, and only the length is corrected.
    stopping : how overfitting is met: "bayesian" (weights held small by the evidence), "early"
        (the error on held-out blocks), or "plain" (not at all, as in the paper).
    compared : judge base and network on unseen blocks; it takes as long as four trainings.
    start : a network to start from, with its base, inputs and scales (warm start).
    robust : rows that stand out lose their weight (Tukey).
    restarts : random starts that are tried. seed : of those. most_epochs : steps of a training.

    Returns a `NetworkFit`: `calibration` is the network, `chosen` the better of the two. Raises
    `CoverageError` where readings are too few or an input never changes, `LogError` where a column
    is missing, `FrameError` where the axes do not meet.

    Source: Wang, Sheng, He & Cheng (2020), doi:10.4236/jcc.2020.86004; Foresee & Hagan (1997).

    Examples
    --------
    >>> from agonic.network.simulate import simulate_nonaffine
    >>> made = simulate_nonaffine(n=1000, hysteresis=0.0, seed=1)
    >>> fit = fit_network(made.samples, made.reference, hidden=6)
    >>> fit.comparison.winner, fit.comparison.ratio < 0.5
    ('network', True)
    """
    settings = Settings(
        hidden=hidden,
        inputs=inputs,
        base=base if start is None else start.base,
        target=target,
        stopping=stopping,
        robust=robust,
        restarts=restarts,
        most_epochs=most_epochs,
        seed=seed,
    )
    if start is not None:
        settings = _settings_of_start(settings, start)
    problem = pose_problem(samples, reference, settings)
    training = train(problem, np.flatnonzero(problem.rows), start)
    fit = _fit(problem, training)
    if compared:
        fit = replace(fit, comparison=cross_validate(problem, np.flatnonzero(fit.weights > 0)))
    return evidence.examine(fit, samples)


def _settings_of_start(settings: Settings, start: Network) -> Settings:
    """The settings with what a start decides: base, inputs, hidden nodes, target."""
    if start.held:
        raise AgonicError("a network held at a temperature cannot be trained further")
    return replace(
        settings,
        base=start.base,
        inputs=start.inputs,
        hidden=start.shape.hidden,
        target=start.target,
    )


def _fit(problem: Problem, training: Training) -> NetworkFit:
    """The fit before it is compared and examined; residuals and weights of every row."""
    n, o = problem.wanted.shape
    residuals, weights = np.full((n, o), np.nan), np.zeros(n)
    residuals[problem.rows], weights[problem.rows] = training.residuals, training.weights
    return NetworkFit(
        calibration=training.calibration,
        n=int(problem.rows.sum()),
        residuals=residuals,
        weights=weights,
        noise=training.noise.sd,
        correlation=training.noise.correlation,
        epochs=training.trained.epochs,
        effective=training.trained.effective,
        converged=training.trained.converged,
        regression=training.regression,
    )


FOLDS = 4


def cross_validate(problem: Problem, used: Index) -> Comparison:
    """Base and network made from three blocks of four, judged on the fourth, in turn.

    Parameters: `used` (k,) the rows that take part; outliers would judge luck.
    """
    number = number_blocks(len(used))
    before, after = (np.empty((len(used), problem.wanted.shape[1])) for _ in range(2))
    outputs, targets = [], []
    for fold in range(FOLDS):
        unseen = number % FOLDS == fold
        rows = used[unseen]
        made = train(problem, used[~unseen]).calibration
        field, _ = made.evaluated(problem.samples.field[rows], problem.select_columns(rows))
        based, wanted = problem.apply_base(made.base, rows), problem.wanted[rows]
        before[unseen], after[unseen] = compute_errors(based, wanted), compute_errors(field, wanted)
        outputs.append(_measure_network_part(field, based, wanted) - made.output_middle)
        targets.append(-compute_errors(based, wanted) - made.output_middle)
    middle = problem.samples.field[used].mean(axis=0)
    return Comparison(
        base=None if problem.settings.base is None else Errors(values=before),
        network=Errors(values=after),
        rows=used,
        block=number,
        cell=find_cells(problem.samples.field[used] - middle),
        regression=correlate(np.concatenate(outputs), np.concatenate(targets)),
    )


def _measure_network_part(field: Array, based: Array, wanted: Array) -> Array:
    """What the network added, likewise."""
    if wanted.shape[1] == 3:
        return field - based
    lengths = (np.linalg.norm(values, axis=1, keepdims=True) for values in (field, based))
    return np.asarray(next(lengths) - next(lengths))
