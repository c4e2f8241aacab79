"""The rotation between a magnetometer and a star sensor, from a session of many orientations."""

from agonic.fitting.alignment.budget import Effect, error_budget
from agonic.fitting.alignment.from_session import fit_alignment
from agonic.fitting.alignment.plan import AlignmentPlan, plan_alignment
from agonic.fitting.alignment.record import AlignmentFit

__all__ = [
    "AlignmentFit",
    "AlignmentPlan",
    "Effect",
    "error_budget",
    "fit_alignment",
    "plan_alignment",
]
