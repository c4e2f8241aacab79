"""Findings: what is wrong or worth knowing about readings and fits, each by name."""

from agonic.health.evidence import (
    Evidence,
    examine,
    examine_taught,
    strayed,
    undetermined,
    wandered,
)
from agonic.health.finding import (
    Finding,
    Judged,
    Severity,
    Verdict,
    figure,
    gravest_first,
    sentences,
    verdict_of,
)
from agonic.health.mounting import misnamed, mounted
from agonic.health.readings import FEWEST, describe, inspect, left_out, step, usable_rows
from agonic.health.scale import misscaled

__all__ = [
    "FEWEST",
    "Evidence",
    "Finding",
    "Judged",
    "Severity",
    "Verdict",
    "describe",
    "examine",
    "examine_taught",
    "figure",
    "gravest_first",
    "inspect",
    "left_out",
    "misnamed",
    "misscaled",
    "mounted",
    "sentences",
    "step",
    "strayed",
    "undetermined",
    "usable_rows",
    "verdict_of",
    "wandered",
]
