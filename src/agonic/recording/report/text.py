"""`summary`: the result of a log as one screen of plain text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from agonic.recording.calibrated import Calibrated
from agonic.recording.report.next_move import next_move
from agonic.recording.report.quantities import ADDED, quantities
from agonic.report.digits import degrees, grouped, minused, quantity, with_sd
from agonic.report.labels import unit_label
from agonic.report.tables import spread
from agonic.report.text import SIGNS, WIDTH
from agonic.report.verdict import MEANINGS, sentence

LABELS = {"current_A": "Current", "throttle": "Throttle"}

_MOST_LINES = 2  # of a sentence, so that three sensors fit on a screen of 24 lines


def summary(results: Sequence[Calibrated]) -> str:
    """Verdict, numbers and next move of every sensor, at most 7 lines each and 100 columns wide.

    A latency, each signal of a source on board, and, of a sensor alone, why the method was chosen
    take a line more.

    >>> summary([])
    'No magnetometer was found in the log.'
    """
    if not results:
        return "No magnetometer was found in the log."
    return "\n\n".join(_sensor(result, alone=len(results) == 1) for result in results)


def _sensor(result: Calibrated, *, alone: bool) -> str:
    fit = result.fit
    calibration, unit = fit.calibration, unit_label(fit.calibration.unit_in)
    first = quantities(result)[0]  # the bias, or the constant of a mix, in a unit of its own
    bias = "   ".join(f"{q.name} {with_sd(q.value, q.sd)}" for q in first.rows)
    heading = (
        f"heading standard error {degrees(fit.coverage.heading_sd_deg)} at "
        f"{grouped(fit.coverage.inclination_deg)}° inclination"
    )
    word = MEANINGS[result.verdict][0].lower()
    rows = [
        f"{SIGNS[result.verdict]} {_plain(result.samples.name)}: {word} "
        f"({result.method}, {calibration.model} model, {grouped(result.fit.n)} readings)",
        *_wrapped("", sentence(result.status)),
        f"  {first.name:<10}{bias} {first.unit}",
        f"  Spread    {spread(result.verification)}   {heading}   "
        f"noise {quantity(fit.noise, unit, 2)}",
        *(_beside(result) if result.verdict != "refused" else ()),
        *([f"  Method    {result.method}: {_plain(result.reason)}"] if alone else ()),
        *_wrapped("Next", sentence(next_move(result))),
    ]
    return "\n".join(row[:WIDTH] for row in rows)


def _beside(result: Calibrated) -> Iterator[str]:
    """How late the readings were, and what sources on board add to them, a line each."""
    late = result.latency
    if late is not None:
        way = "late" if late.latency_s > 0 else "early"
        yield (
            f"  Latency   {abs(1e3 * late.latency_s):.1f} ± {max(1e3 * late.sd_s, 0.05):.1f} ms "
            f"{way} beside the {late.method}, kept in the calibration"
        )
    for group in quantities(result):
        if group.name.startswith(ADDED):
            name = group.name.removeprefix(ADDED)
            values = "   ".join(f"{q.name} {with_sd(q.value, q.sd)}" for q in group.rows)
            yield f"  {LABELS.get(name, 'Second'):<10}{values} {group.unit} ({name})"


def _wrapped(label: str, text: str) -> list[str]:
    return textwrap.wrap(
        _plain(minused(text)),
        width=WIDTH,
        initial_indent=f"  {label:<10}" if label else "  ",
        subsequent_indent=" " * (12 if label else 2),
        max_lines=_MOST_LINES,
        placeholder=" …",
    )


def _plain(text: str) -> str:
    """Text without the control characters that a log could smuggle into a terminal."""
    return "".join(c if c.isprintable() else "?" for c in text)
