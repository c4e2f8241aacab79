"""What might replace what is running: the base moved on, and the weights trained on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import ceil
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.inputs import measure_width
from agonic.calibration.network import Network
from agonic.calibration.retraining import RetrainerParams, RetrainerState, Running, Window
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.maths.equation.network import Shape
from agonic.network.fit import NetworkFit, fit_network
from agonic.network.fit.problem import compute_errors
from agonic.network.retraining.posterior import can_move, describe_prior, train_on
from agonic.network.retraining.problem import to_samples

PER_WEIGHT = 3.0
"""So many readings for each weight before weights are trained."""


class Candidate(NamedTuple):
    """What might replace what is running: in words, trained in how many epochs, and the covariance
    of its errors where there is one of base and weights together."""

    calibration: Running
    what: str
    epochs: int = 0
    covariance: Array | None = None

    def errors(self, rows: Window) -> Array:
        """How far it is from the known field (k, 3), or from the magnitude (k, 1), nT."""
        return compute_errors(correct(self.calibration, rows), rows.wanted)


def adapt(params: RetrainerParams, running: Running | None) -> RetrainerParams:
    """The params with what is running deciding inputs and hidden nodes, and the target where the
    magnitude was not asked for."""
    if running is not None and not isinstance(running, Affine | Thermal | Network):
        raise AgonicError(
            f"a retrainer starts from a Network, an Affine or a Thermal, not from a "
            f"{type(running).__name__}; apply that to the readings first"
        )
    if not isinstance(running, Network):
        return params
    if running.held:
        raise AgonicError("a network held at a temperature cannot be trained further")
    if not can_move(running):  # its weights alone can learn a change; a fifth is held out
        fewest = ceil(1.25 * PER_WEIGHT * running.shape.size)
        params = replace(params, fewest=max(params.fewest, fewest))
    target = "magnitude" if params.target == "magnitude" else running.target
    return replace(params, target=target, inputs=running.inputs, hidden=running.shape.hidden)


def count_weights(params: RetrainerParams) -> int:
    """How many weights a network of these params has."""
    outputs = 3 if params.target == "vector" else 1
    return Shape(sum(measure_width(name) for name in params.inputs), params.hidden, outputs).size


def train_candidates(
    state: RetrainerState, params: RetrainerParams, seen: Window, *, whole: bool
) -> list[Candidate]:
    """Candidates from the simplest, trained on some rows.

    While a change is being learned, on less than a `whole` window, the base alone is let go: what
    is known of weights is not Gaussian so far from where they were.

    Raises `AgonicError` where the rows cannot teach anything.
    """
    running = state.running
    found: list[Candidate] = []
    enough = len(seen) >= PER_WEIGHT * count_weights(params)
    if running is not None and can_move(running):
        covariance = describe_prior(running) if state.covariance is None else state.covariance
        trained = isinstance(running, Network) and enough and whole
        for weights in (False, True)[: 1 + trained]:
            made = train_on(
                running, covariance, seen, params, least=state.correlation, weights=weights
            )
            what = "weights trained" if weights else "an affine step"
            found.append(Candidate(made.calibration, what, made.iterations, made.covariance))
        if isinstance(running, Network):
            return found
        running = found[0].calibration
    if not enough:
        return found
    if isinstance(running, Network):
        fit = _fit(state, params, seen, start=running)
        return [Candidate(fit.calibration, "weights trained", fit.iterations)]
    fit = _fit(state, params, seen, base=params.base if running is None else running)
    if running is None and fit.base is not None:
        found.append(Candidate(fit.base, "an affine calibration"))
    return [*found, Candidate(fit.calibration, "a network", fit.iterations)]


def correct(running: Running | None, rows: Window) -> Array:
    """The field (k, 3) by a calibration, NaN without one."""
    if running is None:
        return np.full((len(rows), 3), np.nan)
    beside: Mapping[str, Array] = {name: rows.columns[name] for name in running.needs}
    if isinstance(running, Network):
        return running.evaluated(rows.raw, beside)[0]
    return running.correct(rows.raw, **beside)


def _fit(
    state: RetrainerState,
    params: RetrainerParams,
    rows: Window,
    *,
    base: Affine | Thermal | str | None = None,
    start: Network | None = None,
) -> NetworkFit:
    samples, reference = to_samples(state, rows)
    fit = fit_network(
        samples,
        reference,
        hidden=params.hidden,
        inputs=params.inputs,
        base=base,  # type: ignore[arg-type]
        target=params.target,
        compared=False,
        start=start,
        seed=params.seed,
    )
    if fit.verdict == "refused":
        raise AgonicError(fit.status)
    return fit
