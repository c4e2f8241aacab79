"""Findings: what is wrong or worth knowing about readings and fits, each by name."""

from agonic.health.evidence import Evidence, examine, undetermined
from agonic.health.finding import Finding, Severity, figure
from agonic.health.readings import FEWEST, describe, inspect, step, usable_rows

__all__ = [
    "FEWEST",
    "Evidence",
    "Finding",
    "Severity",
    "describe",
    "examine",
    "figure",
    "inspect",
    "step",
    "undetermined",
    "usable_rows",
]
