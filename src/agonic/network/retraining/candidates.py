"""What might replace what is running: the base moved on, and the weights trained on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.network import Network
from agonic.calibration.retraining import RetrainerParams, RetrainerState, Running, Window
from agonic.calibration.sources import measure_width
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, FrameError, LogError, UnitError
from agonic.maths.equation.coverage import find_cells
from agonic.maths.equation.network import Shape
from agonic.maths.estimation.noise.residuals import correlation_length
from agonic.maths.one_pass import find_length
from agonic.network.fit import NetworkFit, fit_network
from agonic.network.fit.problem import compute_errors, find_known_field
from agonic.network.retraining.posterior import describe_prior, train_on
from agonic.reference import Reference
from agonic.samples import Samples


def take_samples(
    state: RetrainerState, params: RetrainerParams, samples: Samples, reference: Reference
) -> tuple[RetrainerState, Window]:
    """The state, with the sensor's names before the first reading, and the rows of samples that
    are not flagged, with the field known at each.

    Raises `UnitError`, `FrameError`, `LogError` or `AgonicError` where they do not fit the state.
    """
    running, there = state.running, samples.columns()
    ends_in = samples.frame if running is None else state.frame_out
    wanted, frame_out = find_known_field(samples, reference, params.target, ends_in)
    if state.n == 0 and running is None:
        state = replace(
            state,
            sensor=samples.name,
            unit=samples.unit,
            frame_in=samples.frame,
            frame_out=frame_out,
            device_id=samples.device_id,
        )
    if samples.unit != state.unit:
        raise UnitError(
            f"the network takes readings in {state.unit}, and these are in {samples.unit}"
        )
    for left, right, said in (
        (samples.frame, state.frame_in, "the network takes other axes"),
        (frame_out, state.frame_out, "network and known field must be in the same axes"),
    ):
        if left != right:
            raise FrameError(said, left=left, right=right)
    time = samples.seconds_since(state.epoch, known=state.n > 0)
    if time[0] <= state.time:
        raise AgonicError(
            f"times must increase beyond the last one seen ({state.time:g} s); pass on only what "
            "is new"
        )
    needs = () if running is None else running.needs  # and what is to be trained
    names = dict.fromkeys((*needs, *(n for n in params.inputs if n != "field")))
    missing = [name for name in names if name not in there]
    if "temperature_rate" in missing:
        raise LogError(
            "the rate of the temperature needs readings yet to come, which a stream has not; "
            "retrain a network of the temperature itself"
        )
    if missing:
        raise LogError(
            f"{samples.name}: the samples have no {', '.join(missing)}, which the network takes"
        )
    columns = {name: there[name] for name in names}
    rows = Window(time=time, raw=samples.field, wanted=wanted, columns=columns)
    state = replace(state, reference_sd=reference.sd, source=reference.source)
    return state, rows if samples.flagged is None else rows.select(samples.flagged == 0)


MOST = 75
"""Readings of a training that are kept."""
PER_CELL = 3
"""Of a cell: neighbours in time err alike, those of another training tell more."""
VISITS = 4
"""Trainings of which readings are kept: older ones tell of another sensor."""
VISIT = "visit"


def add_rows(reservoir: Window, rows: Window, running: Running, visit: int) -> Window:
    """The reservoir with some of the rows that are later, of every cell about as many; column
    `visit` keeps the number of the training that they came with."""
    last = float(reservoir.time[-1]) if len(reservoir) else -np.inf
    rows = rows.select(rows.time > last)
    if not len(rows):
        return reservoir
    rows = replace(rows, columns={**rows.columns, VISIT: np.full(len(rows), float(visit))})
    cells = find_cells(correct(running, rows))
    if "temperature" in rows.columns:
        # of a cell in temperature, °C
        warmth = np.floor(rows.columns["temperature"] / 10.0).astype(np.intp)
        cells = cells + 80 * (warmth - warmth.min())
    cells = np.unique(cells, return_inverse=True)[1].reshape(-1)
    order = np.lexsort((-np.arange(len(cells)), cells))  # in each cell the latest first
    first = np.searchsorted(cells[order], np.arange(cells.max() + 1))
    seen = np.arange(len(cells)) - first[cells[order]]
    stride = np.maximum(np.bincount(cells) // PER_CELL, 1)[cells[order]]
    some = order[(seen % stride == 0) & (seen < PER_CELL * stride)]
    some = some[np.lexsort((some, cells[some]))]
    some = some[np.linspace(0, len(some) - 1, min(len(some), MOST)).astype(np.intp)]
    before = reservoir.columns.get(VISIT, np.empty(0))
    kept = np.isin(before, np.unique(before)[1 - VISITS :])
    older = reservoir.select(kept if len(before) else slice(0, 0))
    return older.with_rows(rows.select(np.sort(some)))


def find_common_error(state: RetrainerState, rows: Window) -> float:
    """The standard deviation s, nT, of an error of the known field that `rows` of one training
    share on an axis: the ring current, say, which is about the same for half an orbit.

    With m_v the mean residuals of the reservoir by visit, of n_v readings with noise σ, second
    differences d = m_v+1 − 2 m_v + m_v−1 know no steady drift:

        E d² = 6 s² + σ² (1/n_v+1 + 4/n_v + 1/n_v−1)

    Before there are three visits it is what the reference states of itself, over the root of how
    many independent errors the rows hold: a world model errs alike for as long as the strength of
    the field is alike, always at one place and for a part of each orbit.
    """
    kept = state.reservoir
    visits, visit = np.unique(kept.columns.get(VISIT, ()), return_inverse=True)
    if len(visits) < 3 or state.noise is None:
        strength = find_length(rows.wanted)
        alike = correlation_length(strength - strength.mean(), np.ones(len(rows)))
        varied = np.ptp(strength) > state.reference_sd and 20 <= len(rows) > 4 * alike
        return state.reference_sd * (np.sqrt(alike / len(rows)) if varied else 1.0)
    n: Array = np.bincount(visit).astype(np.float64)
    left = compute_errors(correct(state.running, kept), kept.wanted)
    means = np.column_stack([np.bincount(visit, column) / n for column in left.T])
    white = state.noise**2 * (1 / n[2:] + 4 / n[1:-1] + 1 / n[:-2])
    square = float(np.mean(np.diff(means, 2, axis=0) ** 2 - white[:, None])) / 6
    return float(np.sqrt(max(square, 0.0)))


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
    target = "magnitude" if params.target == "magnitude" else running.target
    return replace(params, target=target, inputs=running.inputs, hidden=running.shape.hidden)


def train_candidates(
    state: RetrainerState, params: RetrainerParams, seen: Window, *, whole: bool
) -> list[Candidate]:
    """Candidates from the simplest, trained on some rows. While a change is being learned, on less
    than a `whole` window, the base alone is let go: what is known of weights is not Gaussian then.
    """
    running = state.running
    found: list[Candidate] = []
    outputs = 3 if params.target == "vector" else 1
    shape = Shape(sum(map(measure_width, params.inputs)), params.hidden, outputs)
    # so many readings for each weight before weights are trained
    enough = len(seen) >= 3.0 * shape.size
    if running is not None:
        trained = isinstance(running, Network) and enough and whole
        common = find_common_error(state, seen)
        for weights in (False, True)[: 1 + trained]:
            made, covariance, steps = train_on(
                running,
                describe_prior(running) if state.covariance is None else state.covariance,
                seen,
                params,
                least=state.correlation,
                weights=weights,
                common=common,
            )
            what = "weights trained" if weights else "an affine step"
            found.append(Candidate(made, what, steps, covariance))
        if isinstance(running, Network):
            return found
    if not enough:
        return found
    fit = _fit(state, params, seen, found[0].calibration if found else params.base)
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


def _fit(state: RetrainerState, params: RetrainerParams, rows: Window, base: Any) -> NetworkFit:
    samples = Samples(
        time=rows.time,
        field=rows.raw,
        unit=state.unit,
        epoch=state.epoch,
        name=state.sensor,
        frame=state.frame_in,
        device_id=state.device_id,
    ).with_columns(**rows.columns)
    known: dict[str, Any] = {"sd": state.reference_sd, "source": state.source}
    if rows.wanted.shape[1] == 1:
        reference = Reference.magnitude(rows.wanted[:, 0], **known)
    else:
        reference = Reference.vector(rows.wanted, frame=state.frame_out, **known)
    fit = fit_network(
        samples,
        reference,
        **{name: getattr(params, name) for name in ("hidden", "inputs", "target", "seed")},
        base=base,
        compared=False,
    )
    if fit.verdict == "refused":
        raise AgonicError(fit.status)
    return fit
