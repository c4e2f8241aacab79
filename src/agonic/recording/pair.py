"""Two magnetometers of a vehicle: whether one thing disturbs both, and the mix that cancels it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.health import Finding, figure
from agonic.maths.one_pass import median
from agonic.recording.calibrated import Calibrated
from agonic.reference import Reference
from agonic.samples import Samples

TOGETHER = 0.6
"""Correlation of what two sensors leave, from which one thing disturbs both."""
STANDS_OUT = 2.0
"""Times that it must stand out of what the noise of the readings leaves in the mean of a second."""
BLOCK_S = 1.0
BETTER = 0.8
"""Share of the unseen spread that a mix has to be below where its verdict is no better."""

Again = Callable[[Samples], Calibrated]
"""What calibrates samples that have a second magnetometer beside them, mixing the two."""


def tell_pairs(results: Sequence[Calibrated]) -> list[Calibrated]:
    """The results, with a finding where one thing disturbs a sensor and another."""
    told = []
    for result in results:
        others = [other for other in results if other is not result]
        found = [one for other in others if (one := compare(result, other)) is not None]
        told.append(result.with_finding(found[0]) if found else result)
    return told


def compare(result: Calibrated, other: Calibrated) -> Finding | None:
    """The finding that one thing disturbs both, from the correlation of what they leave.

    What is left of the magnitude is averaged over seconds, beyond which the noise of readings is
    small; opposite signs tell of a disturbance that the mean of the two cancels.
    """
    if result.samples.time is None or other.samples.time is None:
        return None
    time, beside = result.samples.time, other.samples.time
    both = time[(time >= beside[0]) & (time <= beside[-1])]  # each may be of a stretch
    left = [_average(one, both) for one in (result, other)] if len(both) else [None, None]
    if left[0] is None or left[1] is None or len(left[0]) < 8:
        return None
    correlation = float(np.corrcoef(left[0], left[1])[0, 1])
    if not abs(correlation) > TOGETHER:
        return None
    way = "oppositely" if correlation < 0 else "alike"
    names = f"{result.samples.name} and {other.samples.name}"
    move = (
        "record the current that does it, or mix the two: agonic calibrate LOG --second auto"
        if correlation < 0
        else "look for what is as near to both, a changing field, or a wrong place; no mix of the "
        "two can tell it from the field"
    )
    said = f"one thing disturbs {names}, {way} (correlation {figure(correlation)})"
    return Finding("pair", "check", said, move)


def _average(one: Calibrated, time: Array) -> Array | None:
    """What a calibration leaves of the magnitude, means over seconds; none where it is noise."""
    fit, own = one.fit, one.samples.time
    if own is None or fit.calibration.magnitude is None:
        return None
    wanted = np.full(len(one.samples), fit.calibration.magnitude)
    if one.reference is not None and fit.calibration.unit_out == "nT":
        wanted = one.reference.magnitudes(len(one.samples))
    left = np.linalg.norm(one.corrected, axis=1) - wanted
    if not np.isfinite(left).all():  # a refused fit may be anything
        return None
    left = np.clip(left, *np.percentile(left, (0.5, 99.5)))
    at_rows = np.interp(time, own, left)
    block = np.floor((time - time[0]) / BLOCK_S).astype(int)
    rows = np.bincount(block)
    kept = rows > 0
    means = np.bincount(block, at_rows)[kept] / rows[kept]
    gain = float(np.trace(fit.calibration.matrix)) / 3
    noise = median(np.abs(np.diff(left))) / 0.6745 / np.sqrt(2)
    least = min(noise, fit.noise * gain) / np.sqrt(median(rows[kept]))
    return means if means.std() > STANDS_OUT * least else None


def take_mixes(results: Sequence[Calibrated], again: Again, chosen: str) -> list[Calibrated]:
    """The results, each as a mix with another sensor where that is better.

    Parameters: `again` calibrates with the second sensor; `chosen` is "auto", or the name of the
    second sensor, which is then taken whatever comes of it.
    """
    taken = []
    for result in results:
        others = [one for one in results if one is not result]
        if chosen != "auto":
            others = [one for one in others if one.samples.name == chosen]
        mixes = [mixed for other in others if (mixed := _mix(result, other, again)) is not None]
        best = min(mixes, key=_rank, default=None)
        better = best is not None and (chosen != "auto" or _is_better(best, result))
        taken.append(best if best is not None and better else result)
    return taken


def _mix(result: Calibrated, other: Calibrated, again: Again) -> Calibrated | None:
    """A sensor calibrated as a mix with another; none where that cannot be had."""
    try:
        mixed = again(result.samples.with_second(other.samples))
    except AgonicError:
        return None
    before, after = result.verification.spread_after, mixed.verification.spread_after
    reason = (
        f"{other.samples.name} was mixed in, which takes the spread of unseen readings from "
        f"{before:.2%} to {after:.2%}"
    )
    return replace(mixed, reason=reason)


def _rank(one: Calibrated) -> tuple[int, float]:
    return ("good", "check", "refused").index(one.verdict), one.verification.spread_after


def _is_better(mixed: Calibrated, alone: Calibrated) -> bool:
    """Whether a mix has the better verdict, or the same and clearly less spread."""
    if mixed.verdict != alone.verdict:
        return _rank(mixed) < _rank(alone)
    return mixed.verification.spread_after < BETTER * alone.verification.spread_after


def require_reference(reference: Reference | None) -> Reference:
    """The field of the place, which a mix needs."""
    if reference is None:
        raise AgonicError(
            "a mix of two magnetometers needs the field of the place: give --at LAT,LON or --field"
        )
    return reference
