"""The verdict in words, and the one thing to do next."""

from __future__ import annotations

from collections.abc import Iterable

from agonic.health import RECORD_LONGER, Finding
from agonic.health.finding import start_sentence

MEANINGS = {
    "good": ("Good", "ready to use"),
    "check": ("Check", "look before use"),
    "refused": ("Refused", "do not use"),
}
"""The word of each verdict, and what it means for the user."""

WHEN_GOOD = (
    "use this calibration, and repeat it when iron, magnets or currents near the sensor change"
)


def moves(findings: Iterable[Finding]) -> list[str]:
    """What helps against findings, that of the gravest first; notes need nothing done. To record
    longer comes after what another finding asks for: it helps against no cause."""
    found = sorted(findings, key=lambda finding: finding.move.startswith(RECORD_LONGER))
    return [
        finding.move
        for severity in ("refuse", "check")
        for finding in found
        if finding.severity == severity and finding.move
    ]


def sentence(text: str) -> str:
    """A capital first and a full stop last."""
    return start_sentence(text) + ("" if text.endswith((".", "!", "?", "…")) else ".")
