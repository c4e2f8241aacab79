"""Whether a platform has a field of its own: turned beneath a magnetometer that stands still."""

from agonic.alignment.remanence.fit import RemanenceFit, fit_remanence

__all__ = ["RemanenceFit", "fit_remanence"]
