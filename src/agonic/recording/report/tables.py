"""Tables of a calibrated sensor: every number beside what the log held, and the method."""

from __future__ import annotations

from collections.abc import Sequence

from agonic.recording.calibrated import Calibrated
from agonic.recording.choice import describe_latency
from agonic.recording.report.quantities import (
    Group,
    Quantity,
    mixes,
    quality,
    quantities,
    views,
)
from agonic.report.digits import minused, rounded, signed, with_sd
from agonic.report.markup import Markup, element, grouped_table, markup, table
from agonic.report.verdict import sentence


def numbers(result: Calibrated) -> Markup:
    """Every number with its standard error, beside what the log held."""
    first, others = quantities(result), views(result)
    compared = result.samples.logged is not None and not mixes(result.fit.calibration)
    quality_rows = quality(result).items()
    return element(
        "div",
        _numbers(first, compared),
        element(
            "div",
            _numbers(others, compared) if others else "",
            table(["Quality", "This calibration"], quality_rows, class_="numbers"),
        ),
        class_="pair tables",
    )


def _numbers(groups: Sequence[Group], compared: bool) -> Markup:
    head = ["Number", "This calibration", *(["In the log", "Change"] if compared else [])]
    rows = ((_heading(group), (_number_cells(q, compared) for q in group.rows)) for group in groups)
    return grouped_table(head, rows, class_="numbers")


def _heading(group: Group) -> str:
    return f"{group.name}, {group.unit}" if group.unit else group.name


def _number_cells(q: Quantity, compared: bool) -> list[str]:
    cells = [q.name, with_sd(q.value, q.sd)]
    if compared and q.logged is not None:
        cells += [rounded(q.logged, q.sd), signed(rounded(q.value - q.logged, q.sd))]
    return cells


def method(result: Calibrated) -> Markup:
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
            minused(sentence(test.sentence)),
            element(
                "span",
                f" {test.larger} against {test.smaller}: statistic "
                f"{test.statistic:.3g}, p = {test.p_value:.2g}",
                class_="aside",
            ),
        )
        for test in fit.tests
    )
    return markup(chosen, element("ul", *items))
