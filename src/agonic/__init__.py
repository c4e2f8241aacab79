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

Groups
------
What every day needs is a name in `agonic`; what one job needs is in its group: `agonic.alignment`
(star sensor, north, coil, gravity), `thermal`, `inflight`, `network`, `headings`, `history`,
`fleet`, `live`, `region` (the map of a room), `exports`.

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
placement, region             where magnetometers should sit; the field of a room or a coil
population, fleet, history    the calibrations of many sensors and logs, as one table
live                          calibration while the sensor is turned
simulation                    readings with known truth
report, console, cli          pages and text; the command line
display                       what objects show of themselves: summary, page, plot
"""

from __future__ import annotations

import warnings as _warnings
from importlib import import_module as _import_module
from typing import Any as _Any

from agonic.public import find_homes as _find_homes
from agonic.public import offer as _offer_names
from agonic.public import read_stub as _read_stub
from agonic.readable import show_by as _show_by
from agonic.version import __version__ as __version__

_offer = _offer_names(__name__, f"{__file__}i")
__dir__, __all__ = _offer.list_names, _offer.names
_show_by(lambda: _import_module(f"{__name__}.display"))

GROUPS = (
    "alignment",
    "exports",
    "fleet",
    "headings",
    "history",
    "inertial",
    "inflight",
    "live",
    "network",
    "region",
    "thermal",
)
"""Wings whose names are theirs: `agonic.thermal.fit_thermal`."""


def __getattr__(name: str) -> _Any:
    """A public name; of those that a group has taken over, with a warning, for one release."""
    try:
        return _offer.find(name)
    except AttributeError:
        group = None if name.startswith("_") else _find_group(name)
        if group is None:
            raise
        _warnings.warn(
            f"agonic.{name} is agonic.{group}.{name} now; the short name goes with release 0.2",
            DeprecationWarning,
            stacklevel=2,
        )
        return getattr(_offer.find(group), name)


def _find_group(name: str) -> str | None:
    """The group that lists a name."""
    for group in GROUPS:
        if name in _find_homes(_read_stub(f"{__path__[0]}/{group}/__init__.pyi")):
            return group
    return None
