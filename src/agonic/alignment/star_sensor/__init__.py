"""The rotation between a magnetometer and a star sensor, from a session of many orientations."""

from agonic.alignment.star_sensor.budget import error_budget
from agonic.alignment.star_sensor.fit import fit_alignment
from agonic.alignment.star_sensor.plan import AlignmentPlan, plan_alignment
from agonic.alignment.star_sensor.result import AlignmentFit

__all__ = [
    "AlignmentFit",
    "AlignmentPlan",
    "error_budget",
    "fit_alignment",
    "plan_alignment",
]
