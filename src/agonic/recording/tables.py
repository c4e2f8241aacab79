"""Tables of a calibrated sensor: every number beside what the log held, and the method."""

from __future__ import annotations

from collections.abc import Sequence

from agonic.recording.calibrated import Calibrated
from agonic.recording.choice.fits import describe_latency
from agonic.recording.entries import describe_heading
from agonic.recording.quantities import (
    Group,
    Quantity,
    list_quantities,
    list_views,
    mixes_sensors,
)
from agonic.report.digits import (
    quantity,
    round_to_sd,
    show_sign,
    with_sd,
    write_minus,
)
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, grouped_table, markup, table
from agonic.report.verdict import sentence


def list_numbers(result: Calibrated) -> Markup:
    """Every number with its standard error, beside what the log held."""
    first, others = list_quantities(result), list_views(result)
    compared = result.samples.logged is not None and not mixes_sensors(result.fit.calibration)
    return element(
        "div",
        _draw_groups(first, compared),
        element(
            "div",
            _draw_groups(others, compared) if others else "",
            table(["Quality", "This calibration"], _list_quality(result), class_="numbers"),
        ),
        class_="pair tables",
    )


def _list_quality(result: Calibrated) -> list[tuple[str, str]]:
    """How good the calibration is: numbers in words with their units."""
    fit, coverage = result.fit, result.fit.coverage
    into, out = (unit_label(u) for u in (fit.calibration.unit_in, fit.calibration.unit_out))
    heading, place = describe_heading(result)
    return [
        ("Noise of one reading on one axis", quantity(fit.noise, into)),
        (f"Heading standard error, {place}", heading),
        ("Field standard error, worst direction", quantity(coverage.field_sd_max, out)),
        ("Residual of held-out readings, rms", quantity(result.verification.residual_rms, out)),
    ]


def _draw_groups(groups: Sequence[Group], compared: bool) -> Markup:
    head = ["Number", "This calibration", *(["In the log", "Change"] if compared else [])]
    rows = (
        (
            f"{group.name}, {group.unit}" if group.unit else group.name,
            (_list_cells(q, compared) for q in group.rows),
        )
        for group in groups
    )
    return element("div", grouped_table(head, rows, class_="numbers"), class_="scroll")


def _list_cells(q: Quantity, compared: bool) -> list[str]:
    cells = [q.name, with_sd(q.value, q.sd)]
    if compared and q.logged is not None:
        cells += [round_to_sd(q.logged, q.sd), show_sign(round_to_sd(q.value - q.logged, q.sd))]
    return cells


def _chance(p: float) -> str:
    """A probability; one too small for a number of the machine is no zero."""
    return f"= {p:.2g}" if p > 0.0 else "< 1e-300"


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
                f"{test.statistic:.3g}, p {_chance(test.p_value)}",
                class_="aside",
            ),
        )
        for test in fit.tests
    )
    return markup(chosen, element("ul", *items))
