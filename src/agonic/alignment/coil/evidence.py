"""What the axis of a coil rests on, and what is wrong or worth knowing."""

from __future__ import annotations

import numpy as np

from agonic.alignment.coil.result import CoilFit
from agonic.alignment.maths import coil_axis as kernel
from agonic.alignment.maths.coil_axis import CoilEstimate
from agonic.health import Finding, figure

RARE = 1e-3
STANDS_OUT = 4.0
CORRELATED = 2.0
SURE = 5.0
"""Standard errors by which parts of the readings, or the reference, must differ to say anything."""
FAR_DEG, REVERSED_DEG = 5.0, 90.0
OTHER_SIZE = 0.005
"""Share by which the magnetometer may read more of the ambient field than the reference."""
SHARE, DRIFTS = 1e-5, 1e-4
"""Shares of the constant: what a reference may see of the coil, and how far it may drift."""
MOST_A = 50.0
ENOUGH, MOST_DRIFT = 16, 16
SETTLED, UNSETTLED = 1e-5, 1e-2
"""Shares of the constant: a field that moves it by less has settled, by more is not used."""


def examine(fit: CoilFit) -> tuple[Finding, ...]:
    """The findings of a fit, in the order of its parts: currents, frames, model, residuals."""
    checks = (
        _one_polarity,
        _no_reference,
        _geodetic,
        _no_inertial_axis,
        _nonlinear,
        _check_even,
        _check_correlated,
    )
    return tuple(found for check in checks if (found := check(fit)) is not None)


def describe(fit: CoilFit) -> tuple[str, ...]:
    """How good it is, in sentences."""
    said = (
        f"constant {figure(fit.constant, 7)} ± {figure(fit.constant_sd)} nT/A from "
        f"{fit.reversals} reversals",
        f"standard error of the axis: {figure(fit.axis_sd_arcsec)}″ in the magnetometer's axes",
    )
    if fit.geometric_deg is None or fit.geometric_sd_arcsec is None:
        return said
    away = f"{figure(3600 * fit.geometric_deg, 4)}″ ± {figure(fit.geometric_sd_arcsec)}″"
    return (*said, f"the axis is {away} from the one drawn")


def _one_polarity(fit: CoilFit) -> Finding | None:
    current = fit.current
    if not ((current > 0).all() or (current < 0).all()):
        return None
    what = "the current never changes its sign, so what is even in it does not cancel"
    return Finding("one polarity", "check", what, "reverse it")


def _no_reference(fit: CoilFit) -> Finding | None:
    if fit.session.reference is not None:
        return None
    what = "the drift of the ambient field is only what a smooth curve makes of it"
    return Finding("no reference", "note", what, "record a reference beside it")


def _geodetic(fit: CoilFit) -> Finding | None:
    site = fit.session.site
    if "e" not in fit.directions or site is None or site.coordinates != "geodetic":
        return None
    what = (
        "the site's coordinates are geodetic: north and down may be off by up to 20″, the "
        "deflection of the vertical"
    )
    return Finding("geodetic coordinates", "check", what, "give astronomical coordinates")


def _no_inertial_axis(fit: CoilFit) -> Finding | None:
    if "e" not in fit.directions or "i" in fit.directions:
        return None
    what = (
        "the readings have no date for which the Earth's rotation is known, so there is no "
        "inertial axis"
    )
    move = "give times as dates, or install a newer astropy-iers-data"
    return Finding("no inertial axis", "note", what, move)


def _nonlinear(fit: CoilFit) -> Finding | None:
    if fit.p_linear >= RARE:
        return None
    worst = max(fit.levels, key=lambda level: abs(level.departure / level.sd))
    what = (
        f"at {figure(worst.current_A, 3)} A the constant is off by "
        f"{figure(1e6 * worst.departure / fit.constant)} ppm"
    )
    move = "check shunt and source, and the magnetometer's linearity"
    return Finding("nonlinear", "check", what, move)


def _check_even(fit: CoilFit) -> Finding | None:
    even, spread = fit.estimate.even, fit.estimate.covariance[:, 1, 1]
    if not spread.any() or (even**2 / spread).max() <= STANDS_OUT**2:
        return None
    largest = float(np.abs(fit.current).max())
    left = float(np.linalg.norm(even)) * largest**2
    what = f"reversing does not reverse {figure(left)} nT at {largest:g} A"
    move = "look for heating, or iron near the coil; the axis is free of it"
    return Finding("even in the current", "note", what, move)


def _check_correlated(fit: CoilFit) -> Finding | None:
    length = float(fit.estimate.correlation.max())
    if length <= CORRELATED:
        return None
    what = f"stretches are alike in what is left, {figure(length)} counting as one"
    move = "reverse the current more often, or put the reference nearer"
    return Finding("correlated residuals", "check", what, move)


def judge_settling(fit: CoilFit, late: CoilEstimate | None) -> list[Finding]:
    """Whether the field was still on its way after each change of the current: then the second
    halves of the stretches give another constant."""
    if late is None:
        return []
    moved = abs(float((late.linear - fit.estimate.linear) @ fit.axis))
    sd, share = float(np.sqrt(late.covariance[:, 0, 0] @ fit.axis**2)), moved / fit.constant
    if moved < SURE * sd or share < SETTLED:
        return []
    return [
        Finding(
            "coil not settled",
            "refuse" if share > UNSETTLED else "check",
            "the field still changes after each change of the current: the second halves of the "
            f"stretches alone give a constant that differs by {figure(100 * share)} %",
            "give a longer settle_s in the session, and leave each current on for longer",
        )
    ]


def find_mistakes(fit: CoilFit) -> list[Finding]:
    """What the axis as drawn, the reference, the size of the current and the halves tell."""
    return [*_large_current(fit), *_far_from_drawn(fit), *_check_reference(fit), *_drifting(fit)]


def _large_current(fit: CoilFit) -> list[Finding]:
    largest = float(np.abs(fit.current).max())
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
    beside = fit.read.beside
    if beside is None:
        return []
    own = fit.read._replace(field=beside.field, beside=None)
    drift = kernel.choose_drift(fit.current, own, MOST_DRIFT, even=False)
    seen = kernel.estimate(fit.current, own, drift, even=False)
    found = []
    size = float(np.linalg.norm(seen.linear))
    sure = np.abs(seen.linear) > SURE * np.sqrt(seen.covariance[:, 0, 0])
    if sure.any() and size > SHARE * fit.constant:
        what = (
            f"the reference sees {figure(100 * size / fit.constant)} % of the coil's field, so "
            "that much may be missing from the constant"
        )
        move = "put the reference farther from the coil, or fit without it"
        found.append(Finding("coil in the reference", "check", what, move))
    ambient = fit.read.counts @ (fit.read.field - fit.current[:, None] * fit.estimate.linear)
    more = float(np.linalg.norm(ambient) / np.linalg.norm(fit.read.counts @ beside.field)) - 1
    if abs(more) > OTHER_SIZE:
        what = (
            f"without the coil the magnetometer reads {figure(100 * abs(more))} % "
            f"{'more' if more > 0 else 'less'} than the reference; if that is its gain, the "
            "constant is as wrong"
        )
        move = "give the magnetometer's calibration, or state why the field differs"
        found.append(Finding("ambient field differs", "check", what, move))
    return found


def _drifting(fit: CoilFit) -> list[Finding]:
    """The constant of the first half of the stretches against that of the second."""
    even = len(fit.levels) > 0
    half = fit.n // 2
    if half < ENOUGH:
        return []
    parts = [
        kernel.estimate(
            fit.current[rows],
            fit.stretches.select(rows),
            min(fit.estimate.drift, half // 4),
            even=even,
        )
        for rows in (slice(0, half), slice(half, None))
    ]
    moved = float((parts[1].linear - parts[0].linear) @ fit.axis)
    sd = float(np.sqrt(sum(one.covariance[:, 0, 0] @ fit.axis**2 for one in parts)))
    if abs(moved) <= max(SURE * sd, DRIFTS * fit.constant):
        return []
    what = (
        f"the second half of the readings gives a constant {figure(100 * moved / fit.constant)} % "
        "from that of the first: the coil, its shunt or its source warms up"
    )
    move = "warm it up before, and keep the current on for the same time in both directions"
    return [Finding("constant drifts", "check", what, move)]
