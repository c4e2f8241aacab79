"""What is said and shown of a fit in flight, and the figures of any flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.decomposition import decompose
from agonic.calibration.interference import signals
from agonic.inflight.fit import InflightFit
from agonic.inflight.report import figures, tables
from agonic.inflight.report.direction import describe_direction, describe_sources
from agonic.inflight.report.flight import Flight, flight_of_fit
from agonic.inflight.report.tables import explain
from agonic.readable import make_record
from agonic.report.digits import NO_BREAK, count, group_digits, quantity, with_sd
from agonic.report.document import Document
from agonic.report.labels import per_label, unit_label
from agonic.report.markup import Markup, element
from agonic.report.section import Section
from agonic.report.strips import beyond_words, caption, has_enough
from agonic.samples import Samples


def describe_inflight(
    fit: InflightFit, samples: Samples | None = None, *, title: str = ""
) -> Document:
    """A fit in flight.

    Parameters
    ----------
    fit : from `fit_inflight`. samples : the readings it was made from, which know where each was
        taken; without them there is no map. title : of the page; default: the sensor.

    >>> from agonic.inflight.fit import fit_inflight
    >>> from agonic.reference import Reference
    >>> from agonic.simulation import simulate
    >>> made = simulate("tumble", n=2000, noise=50.0)
    >>> fit = fit_inflight(made.samples, Reference.constant(50_000.0))
    >>> describe_inflight(fit, made.samples, title="<log>").to_html().count("&lt;log&gt;")
    2
    """
    sd, rms = fit.sd, float(np.sqrt(np.mean(fit.residuals[fit.weights > 0] ** 2)))
    bias = join_axes(fit.change.bias, sd[:3])
    document = Document(
        schema="agonic/fit-inflight@1",
        kind="Calibration in flight",
        name=fit.change.sensor,
        title=title,
        method=f"in flight, {fit.solve}, {count(fit.n, 'reading')}",
        verdict=fit.verdict,
        status=fit.status,
        findings=fit.findings,
        entries={
            "Field": str(fit.calibration.provenance.settings.get("reference", "")),
            "Bias" if fit.ground is None else "Moved by": f"{bias} {fit.change.unit_in}",
            **(describe_decomposition(fit.change) if fit.solve != "bias" else {}),
            **_list_sources(fit),
            "Residual": f"{quantity(rms, 'nT', 3)} rms{_describe_correlation(fit)}",
        },
        entries_title="",
        values={
            "method": "inflight",
            "sensor": fit.change.sensor,
            **make_record(fit),
            "reference": fit.calibration.provenance.settings.get("reference"),
            **_list_bias(fit.after),
            "bias_change_nT": fit.change.bias,
            "matrix_change": fit.change.matrix,
            "sd": sd,
            **decompose(fit.change)._asdict(),
            "calibration_kind": fit.calibration.kind,
            "residual_rms_nT": rms,
            "drift_intervals": fit.drift.intervals,
            "held_out_nT": {str(k): v for k, v in fit.held_out.items()},
            "channels": {
                kind: {"noise_nT": of.noise, "correlation": of.correlation}
                for kind, of in fit.channels.items()
            },
            **_direction_values(fit),
            "sources": dict(zip(signals(fit.source_names), fit.sources.T.tolist(), strict=True)),
        },
        calibration=fit.calibration,
    )
    return add_figures(document, flight_of_fit(fit, samples))


_CONSTANT = element("p", "It was taken as constant over the record: see its numbers below.")


def _list_bias(found: Affine) -> dict[str, Any]:
    """The whole bias at the end of the record, in the unit of the readings and, where it is, nT."""
    sd = None if found.sd is None else found.sd[:3]
    in_nT = (found.bias, sd) if found.unit_in == "nT" else (None, None)
    names = ("bias", "bias_sd", "bias_nT", "bias_sd_nT")
    return dict(zip(names, (found.bias, sd, *in_nT), strict=True))


def _list_sources(fit: InflightFit) -> dict[str, str]:
    """What a unit of each source adds to a reading, by its name."""
    names, unit = signals(fit.source_names), unit_label(fit.change.unit_in)
    return {
        name: f"{join_axes(values, sds)} {unit} {per_label(name)}"
        for name, values, sds in zip(names, fit.sources.T, fit.sources_sd.T, strict=True)
    }


def _describe_correlation(fit: InflightFit) -> str:
    """What successive residuals have in common, in words; nothing where it is nothing."""
    if fit.correlation < 1.05:
        return ""
    every = quantity(fit.correlation_s, "s", 2)
    return f"; errors are correlated, as if independent readings came every {every}"


def _direction_values(fit: InflightFit) -> Mapping[str, Any]:
    """What the attitude adds."""
    if fit.alignment is None or fit.direction_error_deg is None:
        return {"direction_error_deg": None, "alignment_deg": None}
    assert fit.alignment.covariance is not None
    return {
        "direction_error_deg": float(np.median(fit.direction_error_deg[fit.weights > 0])),
        "alignment_deg": {
            "rotation_vector": fit.alignment.rotation.as_rotvec(degrees=True),
            "sd": np.degrees(np.sqrt(np.diag(fit.alignment.covariance))),
        },
    }


def add_figures(document: Document, flight: Flight) -> Document:
    """The document with what is shown of a flight on a page."""
    moved = np.ptp(flight.course.bias, axis=0).any()
    sections = [
        Section("Bias over time", [(lambda: _bias(flight)) if moved else _CONSTANT]),
        _ground(flight),
        Section("Residuals", [lambda: _residuals(flight)]),
        *(() if flight.fit is None else describe_direction(flight.fit)),
        *(() if flight.fit is None else describe_sources(flight.fit)),
        Section("Error of the model", [tables.describe_model_error(flight)]),
        Section("Likely causes", [lambda: tables.list_causes(explain(flight))]),
        Section("Left out", [tables.list_left_out(flight)]),
        Section("What was chosen, and the held-out error", [tables.list_held_out(flight)]),
    ]
    return replace(
        document,
        about=f"{flight.sensor}, {flight.begun}",
        key_figures=_key_figures(flight),
        sections=sections,
        calibration=flight.calibration,
        samples=flight.samples,
        styles=("inflight.css",),
    )


def _key_figures(flight: Flight) -> list[tuple[str, str, str]]:
    """The four numbers to look at first."""
    course, used = flight.course, flight.used
    n, of = int(np.count_nonzero(used)), "rms, before each was used" if flight.predicted else "rms"
    rms = float(np.sqrt(np.mean(flight.residuals[used] ** 2))) if used.any() else np.nan
    sd = quantity(float(course.sd[-1].max()), unit_label(course.unit), 2)
    size = group_digits(float(f"{n / max(flight.correlation, 1.0):.2g}"))
    return [
        ("Residual", quantity(rms, "nT"), of),
        ("Bias standard error", sd, "of the worst axis"),
        ("Effective sample size", size, f"independent readings of {group_digits(n)}"),
        ("Readings", group_digits(n), f"of {count(len(used), 'reading')}"),
    ]


def _bias(flight: Flight) -> Markup:
    course = flight.course
    what = "the bias" if flight.predicted else "what is found in flight"
    keys = {"bias": what, "band": "± 2 standard errors"}
    if course.jumps:
        keys["jump"] = "a jump"
    drawn = Markup("".join(figures.draw_bias(course, axis) for axis in range(3)))
    return caption(f"Bias along x, y and z, {unit_label(course.unit)}", drawn, keys)


def _ground(flight: Flight) -> Section:
    """The numbers, beside those of the ground where there are any."""
    rows = [q for group in flight.numbers for q in group.rows]
    title = "Ground against flight"
    if all(q.ground is None for q in rows):
        title = "Numbers"
        said = "There was no ground calibration to compare with. ± is one standard error."
    elif all(q.ground_sd is None for q in rows):
        said = (
            "The ground calibration came without standard errors, so a change is measured by that "
            "of the flight alone. Lines at ±1 and ±2 standard errors."
        )
    else:
        said = (
            "σ is that of the change, from both standard errors. Lines at ±1 and ±2 σ; beyond ±3 "
            "the two do not agree."
        )
    shown = tuple(group for group in flight.numbers if not all(q.fixed for q in group.rows))
    for group in flight.numbers:
        if group not in shown:
            said += f" The {group.name.lower()} was fixed at its earlier value."
    return Section(
        title, [lambda: tables.compare_numbers(shown), element("p", said, class_="aside")]
    )


def _residuals(flight: Flight) -> list[Markup]:
    """Over time, along latitude and temperature, in sunlight and shadow, and where they lie."""
    limit = figures.residual_limit(flight)
    keys = {"range": "least to largest", "middle": "the middle two thirds", "mean": "median"}
    timed = dict(keys)
    if not has_enough(len(flight.residuals)):
        del timed["middle"]
    if figures.has_shadows(flight):
        timed["shadow"] = "in the Earth’s shadow"
    if figures.has_left_out(flight):
        timed["left-out"] = "mostly left out"
    beyond = beyond_words(flight.residuals, limit, "nT")
    parts = [caption("Over time", figures.draw_over_time(flight, limit), timed, beyond)]
    missing = []
    for unit, name in (("°", "latitude"), ("°C", "temperature")):
        values = flight.latitude_deg if name == "latitude" else flight.temperature
        if values is None:
            missing.append(name)
        else:
            drawn = figures.draw_along(flight, values, f"{name}, {unit}", limit)
            parts.append(caption(f"Along {name}", drawn, keys))
    if flight.eclipse is None:
        missing.append("sunlight and shadow (position and date)")
    else:
        parts += [element("h3", "Sunlight and shadow"), tables.compare_sunlight(flight)]
    if flight.latitude_deg is None or flight.longitude_deg is None:
        missing.append("place")
    else:
        parts.append(_map(flight, limit))
    if missing:
        said = f"The log does not hold {', '.join(missing)}: not drawn."
        parts.append(element("p", said, class_="aside"))
    return parts


def _map(flight: Flight, limit: float) -> Markup:
    drawn, highest, cell_sd = figures.draw_map(flight, limit)
    full = quantity(highest, "nT", 2)
    least, most = (element("span", f"{sign}{full}") for sign in "−+")
    scale = element("p", least, element("i", class_="ramp through"), most, class_="legend")
    note = (
        "The mean residual of the readings in a cell, which a typical cell knows to "
        f"±{quantity(cell_sd, 'nT', 2)}."
    )
    return caption("Where the residuals lie", Markup(scale + drawn), note=note)


def describe_decomposition(calibration: Affine) -> dict[str, str]:
    """The sensitivity of each axis and how far the axes are from square, with standard errors.

    >>> from numpy import diag, eye
    >>> found = describe_decomposition(
    ...     Affine(bias=[0, 0, 0], matrix=diag([2.0, 1.0, 1.0]), covariance=1e-6 * eye(9))
    ... )
    >>> found["Scale"].replace("\u00a0", " ")
    'x 0.50000 ± 0.00025   y 1.0000 ± 0.0010   z 1.0000 ± 0.0010'
    """
    found = decompose(calibration)
    return {
        "Scale": join_axes(found.scale_factors, found.scale_factors_sd, blank=NO_BREAK),
        "Angles": join_axes(
            found.nonorthogonality_deg,
            found.nonorthogonality_sd_deg,
            ("xy", "xz", "yz"),
            blank=NO_BREAK,
        )
        + "°",
    }


def join_axes(values: Array, sds: Array, names: Sequence[str] = "xyz", *, blank: str = " ") -> str:
    """Numbers of axes with their standard errors, in a line."""
    parts = (
        f"{name} {with_sd(float(v), float(sd))}"
        for name, v, sd in zip(names, values, sds, strict=True)
    )
    return "   ".join(part.replace(" ", blank) for part in parts)
