"""Rows of a window from samples and reference, and back again for a training."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.calibration.retraining import RetrainerParams, RetrainerState, Window
from agonic.errors import AgonicError, FrameError, LogError, UnitError
from agonic.maths.rotations.attitude import rot_nb
from agonic.reference import Reference
from agonic.samples import Samples


def match_samples(
    state: RetrainerState, params: RetrainerParams, samples: Samples, reference: Reference
) -> RetrainerState:
    """The state, with the sensor's names before the first reading, once the samples meet it."""
    out = _frame_out(samples, reference, params, state)
    if state.n == 0 and state.running is None:
        state = replace(
            state,
            sensor=samples.name,
            unit=samples.unit,
            frame_in=samples.frame,
            frame_out=out,
            device_id=samples.device_id,
        )
    if samples.unit != state.unit:
        raise UnitError(
            f"the network takes readings in {state.unit}, and these are in {samples.unit}"
        )
    if samples.frame != state.frame_in:
        raise FrameError("the network takes other axes", left=samples.frame, right=state.frame_in)
    if out != state.frame_out:
        raise FrameError(
            "network and known field must be in the same axes", left=out, right=state.frame_out
        )
    return replace(state, reference_sd=reference.sd, source=reference.source)


def collect_rows(
    state: RetrainerState, params: RetrainerParams, samples: Samples, reference: Reference
) -> Window:
    """The rows of samples that are not flagged, with the field that was wanted."""
    time = samples.seconds_since(state.epoch, known=state.n > 0)
    if time[0] <= state.time:
        raise AgonicError(
            f"times must increase beyond the last one seen ({state.time:g} s); pass on only what "
            "is new"
        )
    n = len(samples)
    if params.target == "magnitude":
        wanted = np.array(np.broadcast_to(reference.magnitudes(n), n))[:, None]
    else:
        wanted = _vectors(samples, reference)
    rows = Window(
        time=time,
        raw=samples.field,
        wanted=wanted,
        columns=_columns(samples, list_columns(state, params)),
    )
    return rows if samples.flagged is None else rows.select(samples.flagged == 0)


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


def _frame_out(
    samples: Samples, reference: Reference, params: RetrainerParams, state: RetrainerState
) -> str:
    """The axes in which the known field is."""
    if params.target == "magnitude":
        return samples.frame if state.running is None else state.frame_out
    if reference.kind != "vector":
        raise AgonicError(
            f'the reference is a {reference.kind} and target="vector" needs its components: give '
            'Reference.vector, or retrain with target="magnitude"'
        )
    return "b" if reference.frame == "n" else str(reference.frame)


def _vectors(samples: Samples, reference: Reference) -> Array:
    """The known field (n, 3) in axes fixed to the sensor or the body."""
    n = len(samples)
    if len(reference.values) not in (1, n):
        raise AgonicError(f"the reference has {len(reference.values)} rows and the samples {n}")
    values = np.array(np.broadcast_to(reference.values, (n, 3)))
    if reference.frame != "n":
        return values
    angles = (samples.roll_deg, samples.pitch_deg, samples.heading_deg)
    known = [angle for angle in angles if angle is not None]
    if len(known) < 3:
        raise LogError(
            f"{samples.name}: a field north-east-down needs roll, pitch and heading beside the "
            'readings; give the field in sensor axes, or retrain with target="magnitude"'
        )
    return np.asarray(np.einsum("nji,nj->ni", rot_nb(known[0], known[1], known[2]), values))
