"""The lines of a calibrated sensor's text: its numbers, and how well they hold."""

from __future__ import annotations

import numpy as np

from agonic.calibration.affine import Affine
from agonic.recording.calibrated import Calibrated
from agonic.recording.choice import describe_latency
from agonic.recording.quantities import ADDED, Group, list_quantities, mixes_sensors
from agonic.report import tables
from agonic.report.digits import NO_BREAK, degrees, group_digits, quantity, with_sd, write_minus
from agonic.report.labels import unit_label

LABELS = {"current_A": "Current", "throttle": "Throttle"}


def describe_heading(result: Calibrated) -> tuple[str, str]:
    """The standard error of a heading, and where it holds."""
    coverage = result.fit.coverage
    place = f"dip {group_digits(coverage.inclination_deg)}°"
    known = coverage.heading_sd_deg < 180.0
    return degrees(coverage.heading_sd_deg) if known else "undetermined", place


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
    if result.latency is not None:
        entries["Latency"] = describe_latency(result.latency)
    for group in others:
        if group.name.startswith(ADDED):
            name = group.name.removeprefix(ADDED)
            known = f" ({name})" if name in LABELS else ""
            entries[LABELS.get(name, name)] = f"{_join_numbers(group)}{known}"
    return entries


def list_details(result: Calibrated) -> dict[str, str]:
    """The lines of the text that are shown when all is asked for."""
    heading, place = describe_heading(result)
    cells = result.fit.coverage.cells
    return {
        "Method": f"{result.method}: {result.reason}",
        "Heading": f"{heading} (level, {place})",
        "Coverage": f"{np.count_nonzero(cells)} of {len(cells)} directions",
        "Checks": "\n".join(
            f"{check.name}: {quantity(check.value, check.unit)}"
            + ("" if check.limit is None else f" (limit {quantity(check.limit, check.unit)})")
            for check in result.verification.checks
        ),
    }


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
    return "   ".join(values) + f"{NO_BREAK}{group.unit}"
