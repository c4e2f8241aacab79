"""Findings: what is wrong or worth knowing about readings and fits, each by name."""

from agonic.health.evidence import Evidence, examine, examine_taught, undetermined
from agonic.health.finding import Finding, Judged, Severity, figure, sentences
from agonic.health.mounting import mounted
from agonic.health.readings import FEWEST, describe, inspect, step, usable_rows
from agonic.health.scale import misscaled

__all__ = [
    "FEWEST",
    "Evidence",
    "Finding",
    "Judged",
    "Severity",
    "describe",
    "examine",
    "examine_taught",
    "figure",
    "inspect",
    "misscaled",
    "mounted",
    "sentences",
    "step",
    "undetermined",
    "usable_rows",
]
