"""What is said and shown of what a tracker made of a log."""

from __future__ import annotations

import numpy as np

from agonic.inflight.report.document import add_figures, join_axes
from agonic.inflight.report.flight import flight_of_log
from agonic.inflight.tracking.result import Coefficients
from agonic.inflight.tracking.tracker import Tracker
from agonic.maths.estimation.filters.states import FilterState
from agonic.readable import make_record
from agonic.report.digits import group_digits, quantity
from agonic.report.document import Document
from agonic.samples import Samples


def describe_tracking(
    tracker: Tracker,
    found: Coefficients | None,
    samples: Samples | None = None,
    *,
    rows: int = 0,
    title: str = "",
) -> Document:
    """What a tracker made of a log.

    Parameters
    ----------
    tracker : after the log. found : what `tracker.update(samples, …)` gave, None where nothing was
        new. samples : its readings; without them nothing is drawn. rows : of the log.
    """
    state = tracker.state
    rms, new = None, 0 if found is None else len(found.residual)
    if found is not None:  # without those of which a start could not yet say anything
        rms = float(np.sqrt(np.mean(found.residual[found.foretold] ** 2)))
    document = Document(
        schema="agonic/track@1",
        kind="Calibration followed in flight",
        name=state.base.sensor,
        title=title,
        verdict=tracker.verdict,
        status=tracker.status,
        findings=tracker.findings,
        entries=_tracking_entries(tracker, new, rows - new, rms),
        entries_title="",
        values={
            "sensor": state.base.sensor,
            "unit": state.base.unit_in,
            "new": new,
            "passed_over": rows - new,
            **make_record(state),
            "matrix": tracker.calibration.matrix,
            "walk": tracker.params.walk,
            "predicted_rms_nT": rms,
            "gyro": None
            if state.turn is None
            else {
                "bias_deg_s": np.degrees(state.turn.gyro_bias),
                "delay_s": state.turn.delay_s,
                "field_nT": state.turn.field @ state.turned.rotation.T,
            },
            "history": {
                "time_s": tracker.history[:, 0],
                "bias": tracker.history[:, 1:4],
                "bias_sd": tracker.history[:, 4:],
            },
        },
    )
    if found is None or samples is None:
        return document
    return add_figures(document, flight_of_log(tracker, found, samples))


def _tracking_entries(
    tracker: Tracker, new: int, passed_over: int, rms: float | None
) -> dict[str, str]:
    state, unit = tracker.state, tracker.state.base.unit_in
    passed = f", {group_digits(passed_over)} passed over" if passed_over else ""
    jumps = (
        f"at {j.time:.1f} s by {', '.join(f'{v:.0f}' for v in j.shift)} {unit}, "
        f"seen at {j.seen:.1f} s"
        for j in state.jumps
    )
    return {
        "Readings": f"{group_digits(new)} new{passed}; {group_digits(state.n)} in all, "
        f"{group_digits(state.refused)} did not fit",
        "Bias": f"{join_axes(state.bias, state.bias_sd)} {unit}",
        "Model": f"noise {quantity(state.noise, unit)}, random walk "
        f"{tracker.params.walk:.3g} {unit} per √s",
        "Residual": ""
        if rms is None
        else f"{quantity(rms, 'nT')} rms, each reading before it was used",
        "Jump": "; ".join(jumps),
        "Gyro": "" if state.turn is None else _describe_gyro(state.turn),
    }


def _describe_gyro(turn: FilterState) -> str:
    bias = ", ".join(
        f"{axis} {np.degrees(b):.3f}" for axis, b in zip("xyz", turn.gyro_bias, strict=True)
    )
    return f"bias {bias} °/s; the magnetometer is {group_digits(1e3 * turn.delay_s, 1)} ms late"
