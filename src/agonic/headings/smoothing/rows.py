"""The rows of a log smoothed with its gyro, where that is the better of the two."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.setup import Setup
from agonic.headings.attitude import UNSURE_DEG
from agonic.headings.compass_heading import pick_used
from agonic.headings.expected_field import Surroundings
from agonic.headings.maths.offset import BIAS_SD, LIKELY, Sizes
from agonic.headings.result import SMOOTHED
from agonic.headings.rows import RowHeadings
from agonic.headings.smoothing.smooth import SmoothedHeading, find_shown_axes, smooth_headings
from agonic.headings.tilt_source import find_rate_mounting
from agonic.health.finding import figure
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.samples import Samples

UNUSED = "the gyro is not used"
_TOO_LITTLE = f"{UNUSED}: too few readings are undisturbed"
_IN_MOTION = ("gyro", "log")
"""Sources of tilt that follow a vehicle in motion."""


def smooth_rows(
    first: Samples,
    by_row: RowHeadings,
    find: Callable[[Samples], RowHeadings],
    setup: Setup,
    around: Surroundings,
) -> tuple[RowHeadings, SmoothedHeading | None, tuple[str, ...]]:
    """What is known of the rows, the smoothed headings, or `None` where they are no better, and
    why; nothing is said of a log without a gyro.

    Where a gyro's bias shows, the tilt by its rates is found anew without it by `find`.
    """
    if first.time is None or first.rotation_rate is None:
        return by_row, None, ()
    if by_row.tilt.source not in _IN_MOTION:
        why = f"tilt from the {by_row.tilt.source} does not follow the motion"
        return by_row, None, (f"{UNUSED}: {why}",)
    turn = find_rate_mounting(first, setup, by_row.compasses[0].compass.calibration)
    own = first
    for _ in range(2 if by_row.tilt.source == "gyro" else 0):
        found = _smooth(own, turn, by_row, setup, around, LIKELY)
        if found is None:
            return by_row, None, (_TOO_LITTLE,)
        changed = _correct_rates(own, turn, by_row, found)
        again = find(changed)
        if not np.nanmedian(again.tilt.sd_deg) < 0.8 * np.nanmedian(by_row.tilt.sd_deg):
            break
        own, by_row = changed, again
    smoothed = _smooth(own, turn, by_row, setup, around, None)
    if smoothed is None:
        return by_row, None, (_TOO_LITTLE,)
    rows = np.isfinite(smoothed.variance)
    each = [one.indicated.random + one.indicated.systematic for one in by_row.compasses]
    alone = float(np.nanmedian(np.sqrt(pick_used(by_row.used, each)[rows])))
    sd = float(np.median(np.sqrt(smoothed.variance[rows])))
    by_itself = f"{figure(alone)}° each row by itself"
    if sd > alone:
        return by_row, None, (f"{UNUSED}: standard error {figure(sd)}° with it, {by_itself}",)
    return by_row, smoothed, (f"{SMOOTHED}: standard error {figure(sd)}°, {by_itself}",)


def bridge(flags: Mapping[str, Mask], sd_deg: Array) -> tuple[Mapping[str, Mask], tuple[str, ...]]:
    """Flags without those of readings where the gyro knows the heading to 5° all the same."""
    known = np.isfinite(sd_deg) & (sd_deg < UNSURE_DEG)
    spared = ("disturbed", "no reading", "disagreement")
    doubted = np.logical_or.reduce([flags[name] for name in spared])
    left = {name: rows & ~known if name in spared else rows for name, rows in flags.items()}
    share = float((doubted & known).mean())
    notes = (f"the gyro bridges {100 * share:.1f} % of the rows: disturbed",) * (share > 0)
    return MappingProxyType(left), notes


def _smooth(
    own: Samples,
    turn: Array,
    by_row: RowHeadings,
    setup: Setup,
    around: Surroundings,
    sizes: Sizes | None,
) -> SmoothedHeading | None:
    assert own.time is not None
    assert own.rotation_rate is not None
    tilt, settling = by_row.tilt, setup.settling_s if by_row.tilt.source == "gyro" else 0.0
    rate, force = own.rotation_rate @ turn.T, own.acceleration
    found = smooth_headings(own.time, rate, force, by_row, around, settling, sizes)
    if found is None:
        return None
    # a nose that points up turns its heading by a tilt aside, over cos pitch
    upright = np.maximum(tilt.tilt.cos_pitch, 0.05)
    more = np.degrees(np.degrees(tilt.variance * (tilt.tilt.sin_pitch / upright) ** 2))
    by_card = []
    for one in by_row.compasses:
        card, level = one.compass.deviation, np.nan_to_num(one.indicated.compass_deg)
        known = card is not None and card.covariance is not None
        by_card.append(card.sd_at(level) ** 2 if card is not None and known else 0.0 * level)
    return found._replace(variance=found.variance + more + pick_used(by_row.used, by_card))


def _correct_rates(
    own: Samples, turn: Array, by_row: RowHeadings, found: SmoothedHeading
) -> Samples:
    """The samples without the gyro's bias about axes that were turned to the vertical."""
    assert own.rotation_rate is not None
    down = by_row.tilt.down
    axes = find_shown_axes(down[np.isfinite(down).all(axis=1)])
    bias = np.clip(found.bias @ axes @ axes.T, -3 * BIAS_SD, 3 * BIAS_SD)
    gain = np.eye(3) + unpack_symmetric(found.gain)
    rate = np.linalg.solve(gain, (own.rotation_rate @ turn.T - bias).T).T
    return own.with_columns(rotation_rate=rate @ turn)
