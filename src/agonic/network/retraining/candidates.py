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
from agonic.network.retraining.model_change import can_move, move
from agonic.network.retraining.problem import to_samples

PER_WEIGHT = 3.0
"""So many readings for each weight before weights are trained."""


class Candidate(NamedTuple):
    """What might replace what is running: in words, and trained in how many epochs."""

    calibration: Running
    what: str
    epochs: int = 0

    def errors(self, rows: Window) -> Array:
        """How far it is from the known field (k, 3), or from the magnitude (k, 1), nT."""
        return compute_errors(correct(self.calibration, rows), rows.wanted)


def adapt(params: RetrainerParams, running: Running | None) -> RetrainerParams:
    """The params with what is running deciding target, inputs and hidden nodes, and with as many
    readings as the smallest training takes."""
    if running is not None and not isinstance(running, Affine | Thermal | Network):
        raise AgonicError(
            f"a retrainer starts from a Network, an Affine or a Thermal, not from a "
            f"{type(running).__name__}; apply that to the readings first"
        )
    if isinstance(running, Network):
        if running.held:
            raise AgonicError("a network held at a temperature cannot be trained further")
        params = replace(
            params, target=running.target, inputs=running.inputs, hidden=running.shape.hidden
        )
    if can_move(running) if running is not None else params.base is not None:
        return params
    fewest = ceil(1.25 * PER_WEIGHT * count_weights(params))  # a fifth is held out
    return replace(params, fewest=max(params.fewest, fewest))


def count_weights(params: RetrainerParams) -> int:
    """How many weights a network of these params has."""
    outputs = 3 if params.target == "vector" else 1
    return Shape(sum(measure_width(name) for name in params.inputs), params.hidden, outputs).size


def train_candidates(
    state: RetrainerState, params: RetrainerParams, seen: Window, *, whole: bool
) -> list[Candidate]:
    """Candidates from the simplest, trained on some rows.

    On less than a `whole` window weights are trained only where no affine step can be taken: what
    they know of fields that were not seen since would be lost.

    Raises `AgonicError` where the rows cannot teach anything.
    """
    running = state.running
    if running is None:
        fit = _fit(state, params, seen, base=params.base)
        first = [] if fit.base is None else [Candidate(fit.base, "an affine calibration")]
        return [*first, Candidate(fit.calibration, "a network", fit.iterations)]
    found = []
    if can_move(running):
        sds = {"bias_sd": params.bias_sd, "matrix_sd": params.matrix_sd}
        running = move(running, seen, **sds)
        found.append(Candidate(running, "an affine step"))
        if not whole:
            return found
    if len(seen) >= PER_WEIGHT * count_weights(params):
        if isinstance(running, Network):
            fit = _fit(state, params, seen, start=running)
        else:
            fit = _fit(state, params, seen, base=running)
        found.append(Candidate(fit.calibration, "weights trained", fit.iterations))
    return found


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
