"""How a magnetometer and an accelerometer sit on each other, from orientations at rest."""

from agonic.alignment.gravity.fit import fit_gravity
from agonic.alignment.gravity.result import GravityFit

__all__ = ["GravityFit", "fit_gravity"]
