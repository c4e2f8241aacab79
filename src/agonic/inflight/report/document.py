"""What is said and shown of a fit in flight, and of what a tracker made of a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.decomposition import decompose
from agonic.calibration.interference import signals
from agonic.inflight.fit import InflightFit
from agonic.inflight.report import figures, tables
from agonic.inflight.report.flight import Flight, flight_of_fit, flight_of_log
from agonic.inflight.tracking.result import Coefficients
from agonic.inflight.tracking.tracker import Tracker
from agonic.readable import make_record
from agonic.report.digits import NO_BREAK, count, each_with_sd, group_digits, name_each, quantity
from agonic.report.document import Document
from agonic.report.labels import per_label, unit_label
from agonic.report.markup import element
from agonic.report.section import Block, Section, Shown, aside
from agonic.samples import Samples


def describe_inflight(
    fit: InflightFit, samples: Samples | None = None, *, title: str = ""
) -> Document:
    """A fit in flight; without the `samples` it was made from, which know where each was taken,
    there is no map."""
    sd, rms = fit.sd, float(np.sqrt(np.mean(fit.residuals[fit.weights > 0] ** 2)))
    reference, unit = fit.calibration.provenance.settings.get("reference"), fit.change.unit_in
    names, lasts = signals(fit.source_names), ""
    if fit.correlation >= 1.05:
        every = quantity(fit.correlation_s, "s", 2)
        lasts = f"; errors are correlated, as if independent readings came every {every}"
    document = Document.judge(
        fit,
        schema="agonic/fit-inflight@1",
        kind="Calibration in flight",
        name=fit.change.sensor,
        title=title,
        method=f"in flight, {fit.solve}, {count(fit.n, 'reading')}",
        entries={
            "Field": str(reference or ""),
            "Bias" if fit.ground is None else "Moved by": name_each(
                "xyz", each_with_sd(fit.change.bias, sd), unit
            ),
            **(describe_decomposition(fit.change) if fit.solve != "bias" else {}),
            **{
                name: name_each(
                    "xyz", each_with_sd(values, sds), f"{unit_label(unit)} {per_label(name)}"
                )
                for name, values, sds in zip(names, fit.sources.T, fit.sources_sd.T, strict=True)
            },
            "Residual": f"{quantity(rms, 'nT', 3)} rms{lasts}",
        },
        entries_title="",
        values=_list_values(fit, rms) | {"reference": reference},
        calibration=fit.calibration,
    )
    return _add_figures(document, flight_of_fit(fit, samples))


def _list_values(fit: InflightFit, rms: float) -> dict[str, Any]:
    """What the JSON of a fit says beside verdict, status and findings; the bias is the whole one at
    the end of the record, in the unit of the readings and, where it is, nT."""
    bias, bias_sd = fit.after.bias, None if fit.after.sd is None else fit.after.sd[:3]
    in_nT = (bias, bias_sd) if fit.after.unit_in == "nT" else (None, None)
    mounting = None
    if fit.alignment is not None:
        assert fit.alignment.covariance is not None
        mounting = {
            "rotation_vector": fit.alignment.rotation.as_rotvec(degrees=True),
            "sd": np.degrees(np.sqrt(np.diag(fit.alignment.covariance))),
        }
    return {
        "method": "inflight",
        "sensor": fit.change.sensor,
        **make_record(fit),
        "bias": bias,
        "bias_sd": bias_sd,
        "bias_nT": in_nT[0],
        "bias_sd_nT": in_nT[1],
        "bias_change_nT": fit.change.bias,
        "matrix_change": fit.change.matrix,
        "sd": fit.sd,
        **decompose(fit.change)._asdict(),
        "calibration_kind": fit.calibration.kind,
        "residual_rms_nT": rms,
        "drift_intervals": fit.drift.intervals,
        "held_out_nT": {str(k): v for k, v in fit.held_out.items()},
        "channels": {
            kind: {"noise_nT": of.noise, "correlation": of.correlation}
            for kind, of in fit.channels.items()
        },
        "direction_error_deg": fit.median_direction_error_deg,
        "alignment_deg": mounting,
        "sources": dict(zip(signals(fit.source_names), fit.sources.T.tolist(), strict=True)),
    }


def describe_tracking(
    tracker: Tracker,
    found: Coefficients | None,
    samples: Samples | None = None,
    *,
    rows: int = 0,
    title: str = "",
) -> Document:
    """What a tracker made of a log of so many `rows`: `found` is what its update gave, None where
    nothing was new; without its readings, the `samples`, nothing is drawn."""
    state, turn, history = tracker.state, tracker.state.turn, tracker.history
    rms, new = None, 0 if found is None else len(found.residual)
    if found is not None:  # without those of which a start could not yet say anything
        rms = float(np.sqrt(np.mean(found.residual[found.foretold] ** 2)))
    document = Document.judge(
        tracker,
        schema="agonic/track@1",
        kind="Calibration followed in flight",
        name=state.base.sensor,
        title=title,
        entries=_list_tracking_entries(tracker, new, rows - new, rms),
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
            if turn is None
            else {
                "bias_deg_s": np.degrees(turn.gyro_bias),
                "delay_s": turn.delay_s,
                "field_nT": turn.field @ state.turned.rotation.T,
            },
            "history": {
                "time_s": history[:, 0],
                "bias": history[:, 1:4],
                "bias_sd": history[:, 4:],
            },
        },
    )
    if found is None or samples is None:
        return document
    return _add_figures(document, flight_of_log(tracker, found, samples))


def _list_tracking_entries(
    tracker: Tracker, new: int, passed_over: int, rms: float | None
) -> dict[str, str]:
    state, unit, turn = tracker.state, tracker.state.base.unit_in, tracker.state.turn
    passed = f", {group_digits(passed_over)} passed over" if passed_over else ""
    gyro = ""
    if turn is not None:
        rates = zip("xyz", np.degrees(turn.gyro_bias), strict=True)
        bias = ", ".join(f"{axis} {rate:.3f}" for axis, rate in rates)
        late = group_digits(1e3 * turn.delay_s, 1)
        gyro = f"bias {bias} °/s; the magnetometer is {late} ms late"
    return {
        "Readings": f"{group_digits(new)} new{passed}; {group_digits(state.n)} in all, "
        f"{group_digits(state.refused)} did not fit",
        "Bias": name_each("xyz", each_with_sd(state.bias, state.bias_sd), unit),
        "Model": f"noise {quantity(state.noise, unit)}, random walk "
        f"{tracker.params.walk:.3g} {unit} per √s",
        "Residual": ""
        if rms is None
        else f"{quantity(rms, 'nT')} rms, each reading before it was used",
        "Jump": "; ".join(
            f"at {j.time:.1f} s by {', '.join(f'{v:.0f}' for v in j.shift)} {unit}, "
            f"seen at {j.seen:.1f} s"
            for j in state.jumps
        ),
        "Gyro": gyro,
    }


def _add_figures(document: Document, flight: Flight) -> Document:
    """The document with what is shown of a flight on a page."""
    of = "what is found in flight" if flight.fit else "the bias"
    bias: Block = "It was taken as constant over the record: see its numbers below."
    if np.ptp(flight.course.bias, axis=0).any():
        bias = partial(figures.draw_course, flight.course, of)
    sections = [
        Section("Bias over time", [bias]),
        tables.compare_numbers(flight.numbers),
        Section("Residuals", [lambda: _draw_residuals(flight)]),
        Section("Direction", tables.describe_direction(flight.fit)),
        Section("Currents on board", tables.describe_sources(flight.fit)),
        Section("Error of the model", [tables.describe_model_error(flight)]),
        Section("Likely causes", [lambda: tables.list_causes(tables.explain(flight))]),
        Section("Left out", tables.list_left_out(flight)),
        Section("What was chosen, and the held-out error", tables.list_held_out(flight)),
    ]
    return replace(
        document,
        about=f"{flight.sensor}, {flight.begun}",
        key_figures=_list_key_figures(flight),
        sections=sections,
        calibration=flight.calibration,
        samples=flight.samples,
        styles=("inflight.css",),
    )


def _draw_residuals(flight: Flight) -> list[Shown]:
    """Over time, along latitude and temperature, in sunlight and shadow, and where they lie."""
    limit, missing = figures.residual_limit(flight), []
    parts: list[Shown] = [figures.draw_over_time(flight, limit)]
    along = {"latitude": (flight.latitude_deg, "°"), "temperature": (flight.temperature, "°C")}
    for name, (values, unit) in along.items():
        if values is None:
            missing.append(name)
        else:
            parts.append(figures.draw_along(flight, values, name, unit, limit))
    if flight.eclipse is None:
        missing.append("sunlight and shadow (position and date)")
    else:
        parts += [element("h3", "Sunlight and shadow"), *tables.compare_sunlight(flight)]
    if flight.latitude_deg is None or flight.longitude_deg is None:
        missing.append("place")
    else:
        parts.append(figures.draw_map(flight, limit))
    if missing:
        parts.append(aside(f"The log does not hold {', '.join(missing)}: not drawn."))
    return parts


def _list_key_figures(flight: Flight) -> list[tuple[str, str, str]]:
    """The four numbers to look at first."""
    course, used = flight.course, flight.used
    n, of = int(np.count_nonzero(used)), "rms" if flight.fit else "rms, before each was used"
    rms = float(np.sqrt(np.mean(flight.residuals[used] ** 2))) if n else np.nan
    sd = quantity(float(course.sd[-1].max()), unit_label(course.unit), 2)
    size = group_digits(float(f"{n / max(flight.correlation, 1.0):.2g}"))
    return [
        ("Residual", quantity(rms, "nT"), of),
        ("Bias standard error", sd, "of the worst axis"),
        ("Effective sample size", size, f"independent readings of {group_digits(n)}"),
        ("Readings", group_digits(n), f"of {count(len(used), 'reading')}"),
    ]


def describe_decomposition(calibration: Affine) -> Mapping[str, str]:
    """The sensitivity of each axis and how far the axes are from square, with standard errors."""
    found, pairs = decompose(calibration), ("xy", "xz", "yz")
    scales = each_with_sd(found.scale_factors, found.scale_factors_sd)
    angles, sds = found.nonorthogonality_deg, found.nonorthogonality_sd_deg
    return {
        "Scale": name_each("xyz", scales, blank=NO_BREAK),
        "Angles": name_each(pairs, each_with_sd(angles, sds), "°", blank=NO_BREAK),
    }
