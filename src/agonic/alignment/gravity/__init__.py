"""How a magnetometer and an accelerometer sit on each other, from orientations at rest."""

from agonic.alignment.gravity.fit import GravityFit, fit_gravity

__all__ = ["GravityFit", "fit_gravity"]
