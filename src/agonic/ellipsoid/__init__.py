"""The magnitude calibration: from samples, or from moments alone."""

from agonic.ellipsoid.axes_check import against_gravity
from agonic.ellipsoid.evidence import evaluate
from agonic.ellipsoid.fit import ellipsoid_alone, fit_ellipsoid
from agonic.ellipsoid.large_scan import Recording
from agonic.ellipsoid.moments_fit import fit_moments
from agonic.ellipsoid.recording import fit_and_rows, fit_recording

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
