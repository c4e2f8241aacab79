"""The one thing to do next about a calibrated sensor."""

from __future__ import annotations

from agonic.recording.calibrated import Calibrated
from agonic.report.verdict import WHEN_GOOD, moves


def next_move(result: Calibrated) -> str:
    """What to do first: the move of the gravest finding, or of the first check that failed."""
    if result.verdict == "good":
        return WHEN_GOOD
    failed = [check.meaning for check in result.verification.checks if check.passed is False]
    return next(
        (m for m in (*moves(result.fit.findings), result.fit.coverage.turns, *failed) if m),
        result.status,
    )
