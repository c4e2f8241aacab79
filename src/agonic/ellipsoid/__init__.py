"""The magnitude calibration: from samples, or from moments alone."""

from agonic.ellipsoid.evidence import check_by_gravity, evaluate
from agonic.ellipsoid.fit import (
    find_inclination_deg,
    fit_ellipsoid,
    fit_ellipsoid_alone,
    open_ellipsoid_parts,
)
from agonic.ellipsoid.large_fit import Recording, fit_recording, fit_recording_and_rows
from agonic.ellipsoid.moments_fit import fit_moments

__all__ = [
    "Recording",
    "check_by_gravity",
    "evaluate",
    "find_inclination_deg",
    "fit_ellipsoid",
    "fit_ellipsoid_alone",
    "fit_moments",
    "fit_recording",
    "fit_recording_and_rows",
    "open_ellipsoid_parts",
]
