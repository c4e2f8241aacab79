"""The numbers of a calibrated sensor, and how well they hold: lines of text, tables of the page."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.decomposition import find_raw_ellipsoid
from agonic.calibration.sources import name_sources
from agonic.health import sentences
from agonic.maths.one_pass import median
from agonic.recording.calibrated import Calibrated
from agonic.recording.choice.fits import describe_latency
from agonic.recording.quantities import (
    ADDED,
    Group,
    Quantity,
    list_quantities,
    list_views,
    mixes_sensors,
)
from agonic.report import tables
from agonic.report.digits import (
    NO_BREAK,
    UNDETERMINED,
    degrees,
    group_digits,
    quantity,
    round_to_sd,
    show_sign,
    with_sd,
    write_minus,
)
from agonic.report.labels import TIMING, unit_label
from agonic.report.markup import Markup, element, grouped_table, markup, table
from agonic.report.tables import state_check
from agonic.report.verdict import sentence

SHORT = {"Scale factor": "Scale", "Non-orthogonality": "Angles", "Turn about": "Turn"}
"""Names of groups as labels of a line."""
LABELS = {"current_A": "Current", "throttle": "Throttle"}
LONGEST_LABEL = 14
FAMILIES = {"duty": "Duty", "_Am2": "Torquers", "_A": "Currents"}
"""What sources with long names are called, by a part of them."""


def describe_heading(result: Calibrated) -> tuple[str, str]:
    """The standard error of a heading, the vehicle's where it is known, and where it holds."""
    coverage, known = result.fit.coverage, result.fit.accuracy
    place = f"level, dip {group_digits(coverage.inclination_deg)}°"
    if not coverage.heading_known:
        return UNDETERMINED, place
    vehicle = None if known is None else known.vehicle_heading_deg
    if vehicle is None and known is not None and known.alone:
        place = f"the sensor's own axes, {place}"
    return degrees(coverage.heading_sd_deg if vehicle is None else vehicle), place


def describe_origin(results: Sequence[Calibrated]) -> str:
    """Which sensors, when, where, and the field that was expected there."""
    if not results:
        return ""
    samples, reference = results[0].samples, results[0].reference
    said = [", ".join(result.samples.name for result in results)]
    if samples.epoch is not None:
        said.append(f"{samples.epoch:%Y-%m-%d %H:%M} UTC")
    if samples.latitude_deg is not None and samples.longitude_deg is not None:
        place = (median(at) for at in (samples.latitude_deg, samples.longitude_deg))
        said.append("{:.3f}°, {:.3f}°".format(*place))
    if reference is not None:
        size = median(reference.magnitudes(len(samples)))
        said.append(f"field {group_digits(size)} nT ({reference.source})")
    return " · ".join(said)


def list_entries(result: Calibrated) -> dict[str, str]:
    """The lines of the text: the numbers, and how well they hold."""
    fit = result.fit
    first, *others = list_quantities(result)  # the bias, or the constant of a mix
    entries = {
        first.name: _join_numbers(first),
        **({} if mixes_sensors(fit.calibration) else {"Matrix": _write_matrix(fit.calibration)}),
        "Spread": f"{tables.spread(result.verification)} (held out, before → after)   noise "
        f"{quantity(fit.noise, unit_label(fit.calibration.unit_in), 2)}",
    }
    if fit.shares:
        shares = ", ".join(tables.list_shares(fit.shares, most=4))
        entries["Made of"] = f"{shares} (of the heading’s variance)"
    for finding in fit.findings:  # of a turn that the calibration undoes
        if finding.name == "mounting" and finding.severity == "note":
            entries["Mounting"] = sentences(finding.what)
    if result.latency is not None:
        entries["Latency"] = describe_latency(result.latency)
    if result.disturbers is not None and result.disturbers.shapes:
        shapes = result.disturbers.shapes
        entries["Disturbers"] = "\n".join(f"{one.describe()}." for one in shapes)
    for group in others:
        if group.name.startswith(ADDED):
            label, known = _label_source(group.name.removeprefix(ADDED))
            more = sum(own.startswith(label) for own in entries)
            entries[f"{label} {more + 1}" if more else label] = f"{_join_numbers(group)}{known}"
    return entries


def _label_source(name: str) -> tuple[str, str]:
    """A label for the line of a source, and its name after the numbers where that is longer."""
    plain = re.sub(TIMING, "", name)
    if plain in LABELS:
        return LABELS[plain], f" ({name})"
    if len(name) <= LONGEST_LABEL:
        return name, ""
    label = next((word for end, word in FAMILIES.items() if end in name), "Source")
    return label, f" ({name_sources((name,))})"


def list_details(result: Calibrated) -> dict[str, str]:
    """The lines of the text that are shown when all is asked for."""
    heading, place = describe_heading(result)
    cells = result.fit.coverage.cells
    views = {group.name: _join_numbers(group) for group in list_views(result)}
    return {
        "Method": f"{result.method}: {result.reason}",
        **_describe_shape(result),
        **{SHORT.get(name, name): text for name, text in views.items()},
        "Heading": f"{heading} ({place})",
        "Coverage": f"{np.count_nonzero(cells)} of {len(cells)} directions",
        "Checks": "\n".join(map(state_check, result.verification.checks)),
    }


def _describe_shape(result: Calibrated) -> dict[str, str]:
    """Whether the ellipsoid of the readings is tilted, and what that means."""
    calibration = result.fit.calibration
    found = None if mixes_sensors(calibration) else find_raw_ellipsoid(calibration)
    if found is None:
        return {}
    unit = unit_label(calibration.unit_in)
    axes = ", ".join(with_sd(*pair) for pair in zip(*found[1:3], strict=True))
    if found.shape == "sphere":
        said = "a sphere within its standard errors: neither soft iron nor unequal gains stand out"
    elif found.shape == "upright":
        said = "upright: unequal gains; no soft iron across the axes is seen"
    else:
        tilts = zip(found.tilt_deg, found.tilt_sd_deg, strict=True)
        off = ", ".join(f"{with_sd(min(tilt, 90.0), min(sd, 90.0))}°" for tilt, sd in tilts)
        said = (
            f"tilted, its axes {off} off x, y, z: soft iron, or sensor axes that are not square; "
            "unequal gains alone leave it upright"
        )
    return {"Ellipsoid": f"{said}\nhalf axes {axes} {unit}"}


def _write_matrix(calibration: Affine) -> str:
    """The matrix row by row, in columns, to the fifth digit of a gain."""
    size = float(np.abs(calibration.matrix).max())
    decimals = max(5 - int(np.floor(np.log10(size))), 0) if np.isfinite(size) and size else 5
    cells = [[write_minus(f"{value:.{decimals}f}") for value in row] for row in calibration.matrix]
    wide = max(len(cell) for row in cells for cell in row)
    return "\n".join("  ".join(f"{cell:>{wide}}" for cell in row) for row in cells)


def _join_numbers(group: Group) -> str:
    """The numbers of a group in a line."""
    values = (f"{q.name} {with_sd(q.value, q.sd)}".replace(" ", NO_BREAK) for q in group.rows)
    unit = group.unit if group.unit in ("", "°") else f"{NO_BREAK}{group.unit}"
    return "   ".join(values) + unit


def list_numbers(result: Calibrated) -> Markup:
    """Every number with its standard error, beside what the log held."""
    first, others = list_quantities(result), list_views(result)
    fit, (heading, place) = result.fit, describe_heading(result)
    into, out = (unit_label(u) for u in (fit.calibration.unit_in, fit.calibration.unit_out))
    quality = [
        ("Noise of one reading on one axis", quantity(fit.noise, into)),
        (f"Heading standard error, {place}", heading),
        ("Field standard error, worst direction", quantity(fit.coverage.field_sd_max, out)),
        ("Residual of held-out readings, rms", quantity(result.verification.residual_rms, out)),
    ]
    compared = result.samples.logged is not None and not mixes_sensors(result.fit.calibration)
    return element(
        "div",
        _draw_groups(first, compared),
        element(
            "div",
            _draw_groups(others, compared) if others else "",
            table(["Quality", "This calibration"], quality, class_="numbers"),
        ),
        class_="pair tables",
    )


def _draw_groups(groups: Sequence[Group], compared: bool) -> Markup:
    head = ["Number", "This calibration", *(["In the log", "Change"] if compared else [])]
    rows = (
        (
            f"{group.name}, {group.unit}" if group.unit else group.name,
            ([q.name, with_sd(q.value, q.sd), *_compare(q, compared)] for q in group.rows),
        )
        for group in groups
    )
    return element("div", grouped_table(head, rows, class_="numbers"), class_="scroll")


def _compare(q: Quantity, compared: bool) -> list[str]:
    if not compared or q.logged is None:
        return []
    return [round_to_sd(q.logged, q.sd), show_sign(round_to_sd(q.value - q.logged, q.sd))]


def describe_method(result: Calibrated) -> Markup:
    """The method and why, and the choice of model in words with the statistics behind them."""
    fit, calibration = result.fit, result.fit.calibration
    chosen = element(
        "p",
        f"Method: {result.method}. {sentence(result.reason)} "
        f"Model: {calibration.model}, {calibration.gauge} matrix."
        + (f" {describe_latency(result.latency)}" if result.latency else ""),
    )
    if not fit.tests:
        return chosen
    items = (
        element(
            "li",
            write_minus(sentence(test.sentence)),
            element(
                "span",
                f" {test.larger} against {test.smaller}: statistic "
                f"{test.statistic:.3g}, p "
                + (f"= {test.p_value:.2g}" if test.p_value > 0.0 else "< 1e-300"),
                class_="aside",
            ),
        )
        for test in fit.tests
    )
    return markup(chosen, element("ul", *items))
