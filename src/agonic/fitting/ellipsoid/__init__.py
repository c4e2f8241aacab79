"""The magnitude calibration: from samples, or from moments alone."""

from agonic.fitting.ellipsoid.axes import against_gravity
from agonic.fitting.ellipsoid.evaluate import evaluate
from agonic.fitting.ellipsoid.from_moments import fit_moments
from agonic.fitting.ellipsoid.from_pieces import fit_and_rows, fit_recording
from agonic.fitting.ellipsoid.from_samples import ellipsoid_alone, fit_ellipsoid
from agonic.fitting.ellipsoid.scan import Recording

__all__ = [
    "Recording",
    "against_gravity",
    "ellipsoid_alone",
    "evaluate",
    "fit_and_rows",
    "fit_ellipsoid",
    "fit_moments",
    "fit_recording",
]
