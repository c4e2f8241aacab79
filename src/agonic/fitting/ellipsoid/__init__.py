"""The magnitude calibration: from samples, or from moments alone."""

from agonic.fitting.ellipsoid.evaluate import evaluate
from agonic.fitting.ellipsoid.from_moments import fit_moments
from agonic.fitting.ellipsoid.from_samples import fit_ellipsoid

__all__ = ["evaluate", "fit_ellipsoid", "fit_moments"]
