"""The magnitude calibration: from samples, or from moments alone."""

from agonic.fitting.ellipsoid.from_moments import fit_moments
from agonic.fitting.ellipsoid.from_samples import fit_ellipsoid

__all__ = ["fit_ellipsoid", "fit_moments"]
