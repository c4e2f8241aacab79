"""Which compass to trust at each moment: what each measured against what the field should be."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.base import has_two_axes
from agonic.calibration.setup import Compass, Setup
from agonic.calibration.steps import find_magnitude
from agonic.headings.acceleration import ROWS
from agonic.headings.attitude import LEVEL, select_rows
from agonic.headings.compass_heading import Indication
from agonic.headings.expected_field import Surroundings
from agonic.health.finding import figure
from agonic.maths.equation.crowding import choose_evenly
from agonic.maths.rotations.angles import wrap_deg
from agonic.units import RAW

OPPOSITE_DEG = 15.0
"""A dip is the opposite of the expected one to this, and that one steep enough to tell."""


class Comparison(NamedTuple):
    """How far a compass's field is from the expected one, 1 being the limit, (n,); its strength
    over the expected one and its dip less that, rad. `None` where nothing is known to compare with.
    """

    distance: Array | None
    notes: tuple[str, ...] = ()
    share: Array | None = None
    steeper: Array | None = None


def compare_with_expected(
    compass: Compass, indicated: Indication, around: Surroundings, setup: Setup, tilt: str
) -> Comparison:
    """The larger of the differences of magnitude and dip, each over its limit.

    A level compass knows its horizontal intensity only, one calibrated to a magnitude alone has no
    dip to compare with, and one in raw units no magnitude. One of two axes that was calibrated
    without a place knows the intensity of its own circle.
    """
    h, z = indicated.horizontal, indicated.vertical
    raw = compass.calibration.unit_out == RAW
    if around.horizontal is None or around.vertical is None:
        size = find_magnitude(compass.calibration)
        if size is None or tilt == LEVEL:
            return Comparison(
                None, (_explain_unseen(compass, "no field to compare it with is known"),)
            )
        return Comparison(_over(np.sqrt(h * h + z * z) / size - 1, setup.magnitude_limit))
    if tilt == LEVEL:
        if raw:
            return Comparison(None, (_explain_unseen(compass, "its calibration gives raw units"),))
        off = _over(h / around.horizontal - 1, setup.magnitude_limit)
        size = find_magnitude(compass.calibration)
        if has_two_axes(compass.calibration) and size is not None:
            off = np.minimum(off, _over(h / size - 1, setup.magnitude_limit))
        return Comparison(off)
    share, steeper = around.compare(h, z, np.isfinite(h))
    dip = np.degrees(steeper)
    distance = _over(dip, setup.dip_limit_deg)
    opposite = () if tilt == "log" else _tell_opposite_sign(compass, dip, around)
    if not raw:
        distance = np.maximum(distance, _over(share - 1, setup.magnitude_limit))
        some = choose_evenly(len(share), ROWS)
        level, below = (select_rows(one, some) for one in (around.horizontal, around.vertical))
        there = np.hypot(level, below) * share[some]
        other = _tell_other_magnitude(compass, share[some] - 1, there, setup)
        return Comparison(distance, (*opposite, *other), share, steeper)
    return Comparison(distance, opposite, share, steeper)


def _tell_opposite_sign(compass: Compass, off: Array, around: Surroundings) -> tuple[str, ...]:
    """What to say of dips (n,), degrees less the expected ones, that are the opposite of these."""
    assert around.horizontal is not None
    assert around.vertical is not None
    expected = float(np.degrees(np.median(np.arctan2(around.vertical, around.horizontal))))
    dip = expected + float(np.nanmedian(off)) if np.isfinite(off).any() else expected
    if abs(expected) < OPPOSITE_DEG or abs(dip + expected) > OPPOSITE_DEG:
        return ()
    return (
        f"the field by {compass.sensor} seems to dip by {figure(dip)}° where it should by "
        f"{figure(expected)}°: the acceleration or the magnetometer has the opposite sign",
    )


def _tell_other_magnitude(
    compass: Compass, share: Array, size: Array, setup: Setup
) -> tuple[str, ...]:
    """What to say of a magnitude that is off by the same share throughout: no row is to blame."""
    known = np.isfinite(share)
    if not known.any():
        return ()
    off, limit = float(np.median(share[known])), setup.magnitude_limit
    low, high = np.quantile(share[known], [0.1, 0.9])
    if not abs(off) > limit / 2 or max(high - off, off - low) > abs(off):
        return ()
    there = float(np.median(size[known]))
    return (
        f"the magnitude by {compass.sensor} is {100 * abs(off):.0f} % "
        f"{'above' if off > 0 else 'below'} that of the place throughout ({there / 1000:.1f} µT "
        f"for {there / (1 + off) / 1000:.1f} µT), and more than {100 * limit:g} % is flagged "
        '"disturbed": calibrate with the place (--at LAT,LON), or indoors, where the field is '
        "another, give a declination in the setup and no place",
    )


def _explain_unseen(compass: Compass, why: str) -> str:
    return f"disturbances of {compass.sensor} were not looked for: {why}"


def _over(difference: Array, limit: float) -> Array:
    return np.abs(difference) / max(limit, 1e-12)


def choose_compass(distances: list[Array | None], missing: list[Mask], n: int) -> Index:
    """Which compass each row is taken from, (n,).

    The first that was read and is not disturbed; where all are, the one nearest to the expected
    field. A compass that cannot be judged counts as undisturbed.
    """
    if len(distances) == 1:
        return np.zeros(n, dtype=np.intp)
    score = np.empty((len(distances), n))
    for k, (row, distance, gone) in enumerate(zip(score, distances, missing, strict=True)):
        far = np.zeros(n) if distance is None else distance
        row[:] = np.where(far <= 1.0, -1.0 + 1e-6 * k, far)
        row[~np.isfinite(row)] = np.inf
        row[gone] = np.inf
    return np.asarray(np.argmin(score, axis=0))


def find_disagreement(
    seen: list[Indication], distances: list[Array | None], limit_deg: float
) -> Mask | None:
    """The rows on which two sensors differ that are both trusted, or `None` with a single one.

    By more than the limit and three of their standard deviations; a sensor known to be disturbed is
    outvoted already.
    """
    if len(seen) == 1:
        return None
    rows = np.zeros(len(seen[0].magnetic_deg), dtype=bool)
    for i, one in enumerate(seen):
        for k, other in enumerate(seen[:i]):
            apart = np.abs(wrap_deg(one.magnetic_deg - other.magnetic_deg))
            sd = np.sqrt(one.random + one.systematic + other.random + other.systematic)
            trusted = np.ones_like(rows)
            for distance in (distances[i], distances[k]):
                if distance is not None:
                    trusted &= distance <= 1.0
            rows |= trusted & (apart > np.maximum(limit_deg, 3 * sd))
    return rows


def compute_disagreement_deg(magnetic_deg: list[Array]) -> Array | None:
    """The largest difference between the headings of two sensors, (n,); NaN where fewer were read.

    >>> compute_disagreement_deg([np.array([359.0]), np.array([2.0]), np.array([np.nan])]).tolist()
    [3.0]
    """
    if len(magnetic_deg) == 1:
        return None
    largest = np.full(len(magnetic_deg[0]), np.nan)
    for i, one in enumerate(magnetic_deg):
        for other in magnetic_deg[:i]:
            largest = np.fmax(largest, np.abs(wrap_deg(one - other)))
    return largest
