"""agonic: turn magnetometer readings into headings you can trust.

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

Wings
-----
samples, reference            what was measured, and what it should have been
calibration                   what gets saved: `Affine`, `Interference`, `Alignment`, `Chain`,
                              `Deviation`, and the `Setup` of a vehicle
health, coverage, fit         what a result rests on, and what is wrong with it
verification                  named checks on data the fit has not seen
maths                         the mathematics, on plain arrays
field                         the world model: IGRF and WMM
logs, files, exports          readers by content, our own documents, other programs' files
ellipsoid, attitude           affine calibrations by magnitude; by roll, pitch and heading
recording                     a recording into calibrations: `agonic calibrate`
headings, thermal, inflight,  a job each: compass and deviation, the climatic chamber, in orbit,
network, alignment            neural networks, the rotation to a star sensor, north or gravity
population, fleet, history    the calibrations of many sensors and logs, as one table
live                          calibration while the sensor is turned
simulation                    readings with known truth
report, console, cli          pages and text; the command line
display                       what objects show of themselves: summary, page, plot
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from agonic.version import __version__ as __version__

with open(f"{__file__}i", encoding="utf-8") as _public:  # __init__.pyi: a line a name
    _HOME_OF = {line.split()[-1]: line.split()[1] for line in _public if line.startswith("from ")}

__all__ = sorted(_HOME_OF)


def __getattr__(name: str) -> Any:
    """Public names are loaded when first used, so that a command pays only for what it needs."""
    if name not in _HOME_OF:
        raise AttributeError(f"module 'agonic' has no attribute {name!r}")
    value = getattr(import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
