"""Whether readings are in the unit that they claim."""

from __future__ import annotations

import numpy as np

from agonic.health.evidence import HOLDS
from agonic.health.finding import Finding, figure
from agonic.maths.one_pass import find_length, median
from agonic.samples import Samples
from agonic.units import RAW, STANDARD_GRAVITY_M_S2

GAIN = (0.5, 2.0)
"""A gain outside is no error of a sensor."""
STRETCH = (1 / 3, 3.0)
"""A gain outside, for readings of the right size, is no shield's either: the fit follows noise."""
MAGNITUDES_NT = (1_000.0, 200_000.0)
"""Far outside what the Earth's field, or a coil that makes one like it, ever is."""


def check_scale(gain: float, unit: str, size: float | None = None) -> Finding | None:
    """A gain far from one where both sides are in nT: a wrong unit or a wrong reference.

    `size` is that of the readings as they are, over that of the field: where it is near one, unit
    and reference are right, and it is the fit that stretches what hardly changes.

    >>> check_scale(100.0, "nT").what
    'readings had to be multiplied by 100 to reach the stated field'
    >>> check_scale(54.0, "nT", size=1.6).what
    'the fit multiplies readings by 54 that have the size of the stated field as they are'
    >>> check_scale(54.0, "nT", size=1.6).severity, check_scale(2.4, "nT", size=1.1).severity
    ('refuse', 'check')
    """
    if unit != "nT" or GAIN[0] < gain < GAIN[1]:
        return None
    what = f"readings had to be multiplied by {figure(gain)} to reach the stated field"
    move, doubtful = "check the unit of the log and the reference magnitude", True
    if size is not None and GAIN[0] < size < GAIN[1]:
        what = (
            f"the fit multiplies readings by {figure(gain)} that have the size of the stated field "
            "as they are"
        )
        move = (
            "they do not follow the attitude, or the sensor was hardly turned: check roll, pitch "
            "and heading, and turn it through all headings"
        )
        doubtful = STRETCH[0] < gain < STRETCH[1]
    return Finding("scale", "check" if doubtful else "refuse", what, move)


BARE = "no column is named for a magnetometer"
"""How a reader's note on columns x, y and z of nothing begins."""


def check_gravity(samples: Samples) -> Finding | None:
    """The question whether x, y and z, named for no sensor, are an accelerometer's.

    They are of the size of gravity about zero, most of them: motion disturbs the others.
    """
    if samples.unit != RAW or not any(note.startswith(BARE) for note in samples.notes):
        return None
    size = find_length(samples.field)
    middle = median(size)
    turned = float(np.ptp(samples.field, axis=0).max()) > middle / 4
    near = [abs(middle / one - 1) < HOLDS for one in (1.0, STANDARD_GRAVITY_M_S2)]
    if not any(near) or not turned or median(np.abs(size - middle)) > HOLDS * middle:
        return None
    return Finding(
        "scale",
        "refuse",
        f"x, y and z are {figure(middle, 3)} in size about zero in every direction, as an "
        "accelerometer reads gravity",
        "are they the magnetometer? say so with --columns x=…,y=…,z=… or name its columns",
    )


def check_magnitude(
    magnitude: float | None, unit: str, gain: float | None = None
) -> Finding | None:
    """A magnitude in nT that no compass was ever in: most likely a wrong unit.

    A coil of any field can be stated, then with the `gain` of the fit; but not one that readings
    without a unit have the size of as they are.

    >>> check_magnitude(48e6, "nT").what
    'the field would be 4.8e+07 nT, where the Earth has 20 000 to 70 000 nT'
    >>> check_magnitude(48_000.0, "nT"), check_magnitude(48.0, "nT", gain=1.0)
    (None, None)
    >>> check_magnitude(48.0, "raw", gain=1.0).what.partition(",")[0]
    'readings without a unit have the size of the stated 48 nT'
    """
    low, high = MAGNITUDES_NT
    if magnitude is None or low < magnitude < high:
        return None
    what, move = (
        f"the field would be {magnitude:.3g} nT",
        ("check the unit of the log; where the field was made by a coil, give it with --field"),
    )
    if gain is not None:
        if unit != RAW or not GAIN[0] < gain < GAIN[1]:
            return None
        what = f"readings without a unit have the size of the stated {magnitude:.3g} nT"
        move = "both are most likely in another unit: say which one (--unit uT, unit='uT')"
    elif unit != "nT":
        return None
    return Finding("scale", "check", f"{what}, where the Earth has 20 000 to 70 000 nT", move)
