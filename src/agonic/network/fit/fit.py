"""`fit_network`: a network on top of an affine calibration, from samples with a known field."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np

from agonic.arrays import Index
from agonic.calibration.base import select_columns
from agonic.calibration.network import Network
from agonic.errors import AgonicError
from agonic.health import Finding, figure, inspect, sort_findings
from agonic.maths.equation.coverage import find_cells
from agonic.maths.equation.network import Nodes
from agonic.network.fit.problem import Base, Problem, Settings, Target, compute_errors, pose_problem
from agonic.network.fit.result import WORTH, Comparison, Errors, NetworkFit
from agonic.network.fit.solve import correlate, number_blocks, train
from agonic.network.maths.levenberg_marquardt import Stopping
from agonic.reference import Reference
from agonic.samples import Samples

OUTLIERS_DOUBTFUL = 0.1
"""Share of readings that fit nothing, from which on the others are doubted."""
LARGE = 0.03
"""Residual over the field from which the reference is doubted: no sensor scatters by so much."""


def examine(fit: NetworkFit, samples: Samples) -> NetworkFit:
    """The fit with findings and remarks."""
    found = [f for f in inspect(samples) if f.name not in ("gaps", "repeated readings")]
    findings = sort_findings((*found, *_list_findings(fit, samples)))
    return replace(fit, findings=findings, remarks=_remarks(fit))


def _list_findings(fit: NetworkFit, samples: Samples) -> Iterator[Finding]:
    """What comparison, residuals and training give away."""
    comparison, network = fit.comparison, fit.calibration
    used = np.flatnonzero(np.isfinite(fit.residuals[:, 0]))
    if comparison is not None and comparison.winner == "base":
        yield Finding(
            "network not needed",
            "check" if comparison.ratio > 1 / WORTH else "note",
            comparison.sentence,
            "use the base; give the network what else changes (temperature, current), or none",
        )
    some = samples.select(used[:: max(len(used) // 500, 1)])
    seen, _ = network.evaluated(some.field, select_columns(network, some))
    field = float(np.median(np.linalg.norm(seen, axis=1)))
    if fit.noise >= LARGE * field:
        yield Finding(
            "targets",
            "check",
            f"{figure(fit.noise)} nT are left on an axis, {figure(100 * fit.noise / field)} % "
            "of the field: the readings hardly follow the reference",
            "check the times, axes, signs and unit of the reference, and of the attitude with it",
        )
    share = 1.0 - float((fit.weights[used] > 0).mean())
    if share != 0.0:
        yield Finding(
            "left out in training",
            "check" if share > OUTLIERS_DOUBTFUL else "note",
            f"{figure(100 * share)} % of the readings are outliers and were left out",
            "look for wrong references, and for readings taken while something was switched",
        )
    independent = fit.n * fit.residuals.shape[1] / fit.correlation
    if independent < 5.0 * network.shape.size:
        yield Finding(
            "few for a network",
            "check",
            f"{network.shape.size} weights rest on {figure(independent)} independent residuals",
            "record longer, or take fewer hidden nodes",
        )
    if not fit.converged:
        yield Finding(
            "training unfinished",
            "note",
            f"training still improved after {fit.iterations} epochs",
            "raise most_epochs, or take fewer hidden nodes",
        )


def _remarks(fit: NetworkFit) -> tuple[str, ...]:
    """How good the result is, in words."""
    magnitude, comparison = fit.calibration.target == "magnitude", fit.comparison
    said = [
        f"trained in {fit.iterations} epochs to {figure(fit.rms)} nT rms of "
        f"{'magnitude' if magnitude else 'an axis'}, at most {figure(fit.maximum)}; the readings "
        f"determine {figure(fit.effective)} of {fit.calibration.shape.size} weights"
    ]
    if comparison is not None and comparison.winner == "network":
        said.append(comparison.sentence)
    if magnitude:
        said.append(
            "a magnitude cannot show turns of the field that vary with direction, so only its "
            "length is corrected"
        )
    return tuple(said)


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
    given = dict(locals())
    if start is not None:
        if start.held:
            raise AgonicError("a network held at a temperature cannot be trained further")
        given |= {name: getattr(start, name) for name in ("base", "inputs", "target")}
        given["hidden"] = start.shape.hidden
    problem = pose_problem(
        samples, reference, Settings(**{one.name: given[one.name] for one in fields(Settings)})
    )
    training = train(problem, np.flatnonzero(problem.rows), start)
    n, o = problem.wanted.shape
    residuals, weights = np.full((n, o), np.nan), np.zeros(n)
    residuals[problem.rows], weights[problem.rows] = training.residuals, training.weights
    fit = NetworkFit(
        calibration=training.calibration,
        n=int(problem.rows.sum()),
        residuals=residuals,
        weights=weights,
        noise=training.noise.sd,
        correlation=training.noise.correlation,
        regression=training.regression,
        comparison=cross_validate(problem, np.flatnonzero(weights > 0)) if compared else None,
        **{name: getattr(training.trained, name) for name in ("epochs", "effective", "converged")},
    )
    return examine(fit, samples)


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
        outputs.append(after[unseen] - before[unseen] - made.output_middle)  # what it added
        targets.append(-before[unseen] - made.output_middle)
    middle = problem.samples.field[used].mean(axis=0)
    return Comparison(
        base=None if problem.settings.base is None else Errors(values=before),
        network=Errors(values=after),
        rows=used,
        block=number,
        cell=find_cells(problem.samples.field[used] - middle),
        regression=correlate(np.concatenate(outputs), np.concatenate(targets)),
    )
