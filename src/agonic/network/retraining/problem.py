"""Rows of a window from samples and reference, and back again for a training."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.calibration.retraining import RetrainerParams, RetrainerState, Window
from agonic.errors import AgonicError, FrameError, LogError, UnitError
from agonic.network.fit.problem import find_vectors
from agonic.reference import Reference
from agonic.samples import Samples


def take_samples(
    state: RetrainerState, params: RetrainerParams, samples: Samples, reference: Reference
) -> tuple[RetrainerState, Window]:
    """The state, with the sensor's names before the first reading, and the rows of samples that
    are not flagged, with the field known at each.

    Raises `UnitError`, `FrameError`, `LogError` or `AgonicError` where they do not fit the state.
    """
    wanted, frame_out = _find_known_field(samples, reference, params, state)
    if state.n == 0 and state.running is None:
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
    if samples.frame != state.frame_in:
        raise FrameError("the network takes other axes", left=samples.frame, right=state.frame_in)
    if frame_out != state.frame_out:
        raise FrameError(
            "network and known field must be in the same axes",
            left=frame_out,
            right=state.frame_out,
        )
    time = samples.seconds_since(state.epoch, known=state.n > 0)
    if time[0] <= state.time:
        raise AgonicError(
            f"times must increase beyond the last one seen ({state.time:g} s); pass on only what "
            "is new"
        )
    columns = _columns(samples, list_columns(state, params))
    rows = Window(time=time, raw=samples.field, wanted=wanted, columns=columns)
    state = replace(state, reference_sd=reference.sd, source=reference.source)
    return state, rows if samples.flagged is None else rows.select(samples.flagged == 0)


def list_columns(state: RetrainerState, params: RetrainerParams) -> tuple[str, ...]:
    """The columns that what is running takes, and what is to be trained."""
    running = () if state.running is None else state.running.needs
    return tuple(dict.fromkeys((*running, *(n for n in params.inputs if n != "field"))))


def to_samples(state: RetrainerState, rows: Window) -> tuple[Samples, Reference]:
    """Rows of the window as a training takes them."""
    samples = Samples(
        time=rows.time,
        field=rows.raw,
        unit=state.unit,
        epoch=state.epoch,
        name=state.sensor,
        frame=state.frame_in,
        device_id=state.device_id,
    ).with_columns(**rows.columns)
    sd, source = state.reference_sd, state.source
    if rows.wanted.shape[1] == 1:
        return samples, Reference.magnitude(rows.wanted[:, 0], sd=sd, source=source)
    return samples, Reference.vector(rows.wanted, frame=state.frame_out, sd=sd, source=source)


def _columns(samples: Samples, names: Iterable[str]) -> dict[str, Array]:
    there = samples.columns()
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
    return {name: there[name] for name in names}


def _find_known_field(
    samples: Samples, reference: Reference, params: RetrainerParams, state: RetrainerState
) -> tuple[Array, str]:
    """The field (n, 3) or magnitude (n, 1) known at each reading, and its axes."""
    if params.target == "vector":
        return find_vectors(samples, reference)
    n = len(samples)
    wanted = np.array(np.broadcast_to(reference.magnitudes(n), n))[:, None]
    return wanted, samples.frame if state.running is None else state.frame_out
