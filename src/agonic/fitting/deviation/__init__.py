"""The deviation of a compass from the headings of a swing, and the plan of one."""

from agonic.fitting.deviation.from_headings import DeviationFit, fit_deviation
from agonic.fitting.deviation.plan import SwingPlan, plan_swing

__all__ = ["DeviationFit", "SwingPlan", "fit_deviation", "plan_swing"]
