"""`summary`: the result of a log as one screen of plain text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from agonic.calibrated import Calibrated
from agonic.report.digits import degrees, grouped, quantity, with_sd
from agonic.report.quantities import quantities, unit_label
from agonic.report.tables import spread
from agonic.report.verdict import MEANINGS, next_move, sentence

WIDTH = 100
SIGNS = {"good": "✓", "check": "!", "refused": "✗"}

_MOST_LINES = 2  # of a sentence, so that three sensors fit on a screen of 24 lines


def summary(results: Sequence[Calibrated]) -> str:
    """Verdict, numbers and next move of every sensor, at most 7 lines each and 100 columns wide.

    >>> summary([])
    'No magnetometer was found in the log.'
    """
    if not results:
        return "No magnetometer was found in the log."
    return "\n\n".join(_sensor(result) for result in results)


def _sensor(result: Calibrated) -> str:
    fit = result.fit
    calibration, unit = fit.calibration, unit_label(fit.calibration.unit_in)
    bias = "   ".join(f"{q.name} {with_sd(q.value, q.sd)}" for q in quantities(result)[0].rows)
    heading = (
        f"heading standard error {degrees(fit.coverage.heading_sd_deg)} at "
        f"{fit.coverage.inclination_deg:.0f}° inclination"
    )
    word = MEANINGS[result.verdict][0].lower()
    rows = [
        f"{SIGNS[result.verdict]} {_plain(result.samples.name)}: {word} "
        f"({result.method}, {calibration.model} model, {grouped(result.fit.n)} readings)",
        *_wrapped("", sentence(result.status)),
        f"  Bias      {bias} {unit}",
        f"  Spread    {spread(result.verification)}   {heading}   "
        f"noise {quantity(fit.noise, unit, 2)}",
        *_wrapped("Next", sentence(next_move(result))),
    ]
    return "\n".join(row[:WIDTH] for row in rows)


def _wrapped(label: str, text: str) -> list[str]:
    return textwrap.wrap(
        _plain(text), width=WIDTH, initial_indent=f"  {label:<10}" if label else "  ",
        subsequent_indent=" " * (12 if label else 2), max_lines=_MOST_LINES, placeholder=" …",
    )  # fmt: skip


def _plain(text: str) -> str:
    """Text without the control characters that a log could smuggle into a terminal."""
    return "".join(c if c.isprintable() else "?" for c in text)
