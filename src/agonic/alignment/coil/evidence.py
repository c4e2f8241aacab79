"""What the axis of a coil rests on, and what is wrong or worth knowing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agonic.alignment.coil.result import CoilFit
from agonic.alignment.findings import tell
from agonic.alignment.maths import columns as kernel
from agonic.alignment.maths.columns import CoilEstimate
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


def examine(fit: CoilFit, late: CoilEstimate | None) -> Iterator[Finding]:
    """The findings of a fit, beside the estimate of the second halves of the stretches alone.

    A coil that does not settle spoils what the mistakes are told by.
    """
    settling = list(_judge_settling(fit, late))
    yield from settling
    if not settling:
        yield from _find_mistakes(fit)
        yield from _check_reference(fit)
        yield from _check_drift(fit)
    yield from _check_session(fit)
    yield from _check_residuals(fit)


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


def _check_session(fit: CoilFit) -> Iterator[Finding]:
    """Currents of one sign, a reference that is missing, and where the axis can be told."""
    if (fit.current > 0).all() or (fit.current < 0).all():
        yield tell("one polarity")
    if fit.session.reference is None:
        yield tell("no reference")
    site, fixed = fit.session.site, "e" in fit.directions
    if fixed and site is not None and site.coordinates == "geodetic":
        yield tell("geodetic coordinates", otherwise="")
    if fixed and "i" not in fit.directions:
        yield tell("no inertial axis")


def _check_residuals(fit: CoilFit) -> Iterator[Finding]:
    """Levels that differ, what does not reverse, and stretches that are alike in what is left."""
    if fit.p_linear < RARE:
        worst = max(fit.levels, key=lambda level: abs(level.departure / level.sd))
        off = 1e6 * worst.departure / fit.constant
        yield tell("nonlinear", current=figure(worst.current_A, 3), off=off)
    even, spread = fit.estimate.even, fit.estimate.covariance[:, 1, 1]
    if spread.any() and (even**2 / spread).max() > STANDS_OUT**2:
        largest = float(np.abs(fit.current).max())
        left = float(np.linalg.norm(even)) * largest**2
        yield tell("even in the current", left=left, largest=largest)
    length = float(fit.estimate.correlation.max())
    if length > CORRELATED:
        yield tell("correlated residuals", length=length)


def _judge_settling(fit: CoilFit, late: CoilEstimate | None) -> Iterator[Finding]:
    """Whether the field was still on its way after each change of the current: then the second
    halves of the stretches give another constant."""
    if late is None:
        return
    moved = abs(float((late.linear - fit.estimate.linear) @ fit.axis))
    sd, share = float(np.sqrt(late.covariance[:, 0, 0] @ fit.axis**2)), moved / fit.constant
    if moved >= SURE * sd and share >= SETTLED:
        yield tell("coil not settled", "refuse" if share > UNSETTLED else "check", by=100 * share)


def _find_mistakes(fit: CoilFit) -> Iterator[Finding]:
    """What the size of the current and the axis as drawn tell."""
    largest, away = float(np.abs(fit.current).max()), fit.geometric_deg
    if largest > MOST_A:
        yield tell("large current", largest=largest)
    if away is not None and away > FAR_DEG:
        reverse = away > REVERSED_DEG and 180 - away <= FAR_DEG
        turned = "the coil or the sign of its current is reversed"
        yield tell(
            "axis not as drawn", away=away, cause=turned if reverse else "is it another coil?"
        )


def _check_reference(fit: CoilFit) -> Iterator[Finding]:
    """What the reference says: of the coil it should see nothing, of the ambient field all."""
    beside = fit.read.beside
    if beside is None:
        return
    own = fit.read._replace(field=beside.field, beside=None)
    drift = kernel.choose_drift(fit.current, own, MOST_DRIFT, even=False)
    seen = kernel.estimate(fit.current, own, drift, even=False)
    size = float(np.linalg.norm(seen.linear))
    sure = np.abs(seen.linear) > SURE * np.sqrt(seen.covariance[:, 0, 0])
    if sure.any() and size > SHARE * fit.constant:
        yield tell("coil in the reference", share=100 * size / fit.constant)
    ambient = fit.read.counts @ (fit.read.field - fit.current[:, None] * fit.estimate.linear)
    more = float(np.linalg.norm(ambient) / np.linalg.norm(fit.read.counts @ beside.field)) - 1
    if abs(more) > OTHER_SIZE:
        way = "more" if more > 0 else "less"
        yield tell("ambient field differs", by=100 * abs(more), way=way)


def _check_drift(fit: CoilFit) -> Iterator[Finding]:
    """The constant of the first half of the stretches against that of the second."""
    half = fit.n // 2
    if half < ENOUGH:
        return
    drift, even = min(fit.estimate.drift, half // 4), len(fit.levels) > 0
    first, second = (
        kernel.estimate(fit.current[rows], fit.stretches.select(rows), drift, even=even)
        for rows in (slice(0, half), slice(half, None))
    )
    moved = float((second.linear - first.linear) @ fit.axis)
    variance = (first.covariance + second.covariance)[:, 0, 0]
    sd = float(np.sqrt(variance @ fit.axis**2))
    if abs(moved) > max(SURE * sd, DRIFTS * fit.constant):
        yield tell("constant drifts", by=100 * moved / fit.constant)
