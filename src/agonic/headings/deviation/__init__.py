"""The deviation of a compass from the headings of a swing, and the plan of one."""

from agonic.headings.deviation.fit import DeviationFit, fit_deviation
from agonic.headings.deviation.plan import SwingPlan, plan_swing

__all__ = ["DeviationFit", "SwingPlan", "fit_deviation", "plan_swing"]
