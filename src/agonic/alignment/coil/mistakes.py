"""Mistakes of a coil's measurement that its residuals do not show: each from another comparison."""

from __future__ import annotations

import numpy as np

from agonic.alignment.coil.result import CoilFit
from agonic.alignment.maths import coil_axis as kernel
from agonic.alignment.maths.coil_axis import Stretch
from agonic.alignment.session.session import compute_unix_s
from agonic.arrays import Array
from agonic.calibration.base import select_columns
from agonic.health import Finding, figure

STANDS_OUT = 5.0
"""Standard errors."""
SHARE, DRIFTS = 1e-5, 1e-4
"""Shares of the constant: what a reference may see of the coil, and how far it may drift."""
FAR_DEG, REVERSED_DEG = 5.0, 90.0
OTHER_SIZE = 0.005
"""Share by which the magnetometer may read more of the ambient field than the reference."""
MOST_A = 50.0
ENOUGH, MOST_DRIFT = 16, 16


def find_mistakes(fit: CoilFit) -> list[Finding]:
    """What the axis as drawn, the reference, the size of the current and the halves tell."""
    return [*_large_current(fit), *_far_from_drawn(fit), *_check_reference(fit), *_drifting(fit)]


def _large_current(fit: CoilFit) -> list[Finding]:
    largest = float(np.abs(fit.stretches.current).max())
    if largest <= MOST_A:
        return []
    what = f"the largest current is {figure(largest)} A, more than such coils carry"
    move = "give current_A in amperes; are these milliamperes?"
    return [Finding("large current", "check", what, move)]


def _far_from_drawn(fit: CoilFit) -> list[Finding]:
    away = fit.geometric_deg
    if away is None or away <= FAR_DEG:
        return []
    reverse = away > REVERSED_DEG and 180 - away <= FAR_DEG
    cause = "the coil or the sign of its current is reversed" if reverse else "is it another coil?"
    move = f"check the leads and the axes: {cause}"
    what = f"the axis is {figure(away)}° from the one drawn"
    return [Finding("axis not as drawn", "check", what, move)]


def _check_reference(fit: CoilFit) -> list[Finding]:
    """What the reference says: of the coil it should see nothing, of the ambient field all."""
    session = fit.session
    samples, reference = session.magnetometer, session.reference
    if reference is None:
        return []
    assert samples.time is not None, "checked with the session"
    assert samples.current_A is not None, "checked with the session"
    now, then = compute_unix_s(samples), compute_unix_s(reference)
    beside = np.stack([np.interp(now, then, b) for b in reference.field.T], axis=1)
    step = 0.02 * float(np.abs(samples.current_A).max())
    own = kernel.find_stretches(
        samples.time, samples.current_A, beside, None, session.settle_s, step
    )
    seen = kernel.estimate(own, kernel.choose_drift(own, MOST_DRIFT, even=False), even=False)
    found = []
    size = float(np.linalg.norm(seen.linear))
    sure = np.abs(seen.linear) > STANDS_OUT * np.sqrt(seen.covariance[:, 0, 0])
    if sure.any() and size > SHARE * fit.constant:
        what = (
            f"the reference sees {figure(100 * size / fit.constant)} % of the coil's field, so "
            "that much may be missing from the constant"
        )
        move = "put the reference farther from the coil, or fit without it"
        found.append(Finding("coil in the reference", "check", what, move))
    ambient = (_correct_field(fit) - np.outer(samples.current_A, fit.estimate.linear)).mean(axis=0)
    more = float(np.linalg.norm(ambient) / np.linalg.norm(beside.mean(axis=0))) - 1
    if abs(more) > OTHER_SIZE:
        what = (
            f"without the coil the magnetometer reads {figure(100 * abs(more))} % "
            f"{'more' if more > 0 else 'less'} than the reference; if that is its gain, the "
            "constant is as wrong"
        )
        move = "give the magnetometer's calibration, or state why the field differs"
        found.append(Finding("ambient field differs", "check", what, move))
    return found


def _correct_field(fit: CoilFit) -> Array:
    """The magnetometer's field (n, 3), nT, with its calibration where there is one."""
    known, samples = fit.session.calibration, fit.session.magnetometer
    if known is None:
        return samples.field
    return known.correct(samples.field, **select_columns(known, samples))


def _drifting(fit: CoilFit) -> list[Finding]:
    """The constant of the first half of the stretches against that of the second."""
    seen, even = fit.stretches, len(fit.levels) > 0
    half = len(seen.time) // 2
    if half < ENOUGH:
        return []
    parts = [
        kernel.estimate(_select(seen, rows), min(fit.estimate.drift, half // 4), even=even)
        for rows in (slice(0, half), slice(half, None))
    ]
    moved = float((parts[1].linear - parts[0].linear) @ fit.axis)
    sd = float(np.sqrt(sum(one.covariance[:, 0, 0] @ fit.axis**2 for one in parts)))
    if abs(moved) <= max(STANDS_OUT * sd, DRIFTS * fit.constant):
        return []
    what = (
        f"the second half of the readings gives a constant {figure(100 * moved / fit.constant)} % "
        "from that of the first: the coil, its shunt or its source warms up"
    )
    move = "warm it up before, and keep the current on for the same time in both directions"
    return [Finding("constant drifts", "check", what, move)]


def _select(seen: Stretch, rows: slice) -> Stretch:
    beside = None if seen.reference is None else seen.reference[rows]
    own = seen._replace(current=seen.current[rows], time=seen.time[rows], field=seen.field[rows])
    return own._replace(reference=beside, counts=seen.counts[rows])
