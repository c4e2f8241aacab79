"""agonic: magnetometer readings into a direction one can trust.

    import agonic as ag

    samples = ag.read("flight.bin", sensor="MAG2")
    fit = ag.fit_ellipsoid(samples, ag.Reference.constant(49_500))
    print(fit.status)
    field = fit.calibration.correct(samples.field)
    ag.save(fit.calibration, "mag2.json")

Conventions
-----------
Field       nanotesla (nT), everywhere inside; other units only at the doors (files, display).
            Readings of unknown scale are "raw"; then the input of a calibration is raw too.
Rows        a row is a sample: (n, 3), always. `None` is missing. Rows with NaN are left out at
            the door, counted and reported.
Time        float64 seconds since `epoch` (UTC), strictly increasing.
Names       quantities other than field and time end in their unit: `_deg`, `_rad`, `_C`, `_s`,
            `_m`, `_A`. Standard deviations and standard errors are `sd`.
Equation    field = matrix @ (raw − bias).
Frames      one letter: m magnetometer, b body (forward, right, down), c star camera,
            n north-east-down, e Earth-fixed, i inertial. `rot_nb` turns b into n.
Attitude    aerospace yaw-pitch-roll; heading clockwise from true north.
Quaternion  only on disk: `quat_wxyz`, Hamilton.
Heading     magnetic = compass + deviation(compass); true = magnetic + declination; east positive.

Modules
-------
samples, reference            what was measured, and what it should have been
fitting                       `fit_*(samples, reference, *, settings) -> Fit`
calibration                   what gets saved: `Affine`, `Alignment`, `Chain`
health, coverage, fit         what a result rests on, and what is wrong with it
verification, calibrated      named checks on data the fit has not seen
io                            readers by content, the calibration file, exports
field                         the world model: IGRF and WMM
simulation                    readings with known truth
report                        HTML and text
kernels                       the mathematics, on plain arrays
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from agonic.version import __version__

if TYPE_CHECKING:
    from agonic.calibrated import Calibrated, calibrate
    from agonic.calibration.affine import Affine
    from agonic.calibration.alignment import Alignment
    from agonic.calibration.base import apply
    from agonic.calibration.chain import Chain
    from agonic.coverage import Coverage
    from agonic.errors import (
        AgonicError,
        AgonicWarning,
        ConvergenceError,
        CoverageError,
        FrameError,
        LogError,
        MissingExtraError,
        UnitError,
        ValidityError,
    )
    from agonic.field import igrf, wmm, wmmhr
    from agonic.fit import Fit
    from agonic.fitting.ellipsoid import fit_ellipsoid, fit_moments
    from agonic.health import Finding
    from agonic.io.calfile import load, save
    from agonic.io.log import Log
    from agonic.io.read import open_log, read, sensors
    from agonic.io.write_ardupilot import write_ardupilot
    from agonic.io.write_c import write_c
    from agonic.io.write_csv import write_csv
    from agonic.io.write_matlab import write_matlab
    from agonic.io.write_motioncal import write_motioncal
    from agonic.io.write_px4 import write_px4
    from agonic.io.write_ros import write_ros
    from agonic.io.write_table import write_table
    from agonic.moments import Moments
    from agonic.provenance import Provenance
    from agonic.reference import Reference
    from agonic.report.html import render
    from agonic.samples import Samples
    from agonic.simulation import simulate
    from agonic.verification import Verification, verify

_HOMES = {
    "calibrated": ("Calibrated", "calibrate"),
    "calibration.affine": ("Affine",),
    "calibration.alignment": ("Alignment",),
    "calibration.base": ("apply",),
    "calibration.chain": ("Chain",),
    "coverage": ("Coverage",),
    "errors": (
        "AgonicError", "AgonicWarning", "ConvergenceError", "CoverageError", "FrameError",
        "LogError", "MissingExtraError", "UnitError", "ValidityError",
    ),
    "field": ("igrf", "wmm", "wmmhr"),
    "fit": ("Fit",),
    "fitting.ellipsoid": ("fit_ellipsoid", "fit_moments"),
    "health": ("Finding",),
    "io.calfile": ("load", "save"),
    "io.log": ("Log",),
    "io.read": ("open_log", "read", "sensors"),
    "io.write_ardupilot": ("write_ardupilot",),
    "io.write_c": ("write_c",),
    "io.write_csv": ("write_csv",),
    "io.write_matlab": ("write_matlab",),
    "io.write_motioncal": ("write_motioncal",),
    "io.write_px4": ("write_px4",),
    "io.write_ros": ("write_ros",),
    "io.write_table": ("write_table",),
    "moments": ("Moments",),
    "provenance": ("Provenance",),
    "reference": ("Reference",),
    "report.html": ("render",),
    "samples": ("Samples",),
    "simulation": ("simulate",),
    "verification": ("Verification", "verify"),
}  # fmt: skip
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = ["__version__", *sorted(_HOME_OF)]


def __getattr__(name: str) -> Any:
    """Public names are loaded when first used, so that a command pays only for what it needs."""
    if name not in _HOME_OF:
        raise AttributeError(f"module 'agonic' has no attribute {name!r}")
    value = getattr(import_module(f"agonic.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
