"""Findings: what is wrong or worth knowing about readings and fits, each by name."""

from agonic.health.decoding import undo_decoding
from agonic.health.evidence import FEWEST, RECORD_LONGER, Evidence
from agonic.health.examine import examine
from agonic.health.finding import (
    Finding,
    Judged,
    Verdict,
    figure,
    sentences,
    sort_findings,
    verdict_of,
)
from agonic.health.mounting import (
    REVERSED_FIELD,
    check_axes,
    check_mounting,
    find_mounting,
    find_side,
)
from agonic.health.outliers import check_outliers
from agonic.health.readings import (
    check_rejected,
    describe,
    inspect,
)
from agonic.health.scale import (
    check_magnitude,
    check_resolution,
    check_scale,
    find_quantisation,
    find_rounding,
)
from agonic.health.sticking import find_usable_rows

__all__ = [
    "FEWEST",
    "RECORD_LONGER",
    "REVERSED_FIELD",
    "Evidence",
    "Finding",
    "Judged",
    "Verdict",
    "check_axes",
    "check_magnitude",
    "check_mounting",
    "check_outliers",
    "check_rejected",
    "check_resolution",
    "check_scale",
    "describe",
    "examine",
    "figure",
    "find_mounting",
    "find_quantisation",
    "find_rounding",
    "find_side",
    "find_usable_rows",
    "inspect",
    "sentences",
    "sort_findings",
    "undo_decoding",
    "verdict_of",
]
