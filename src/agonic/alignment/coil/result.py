"""`CoilFit`: the axis of a coil in every known frame, what it rests on, and the usual mistakes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from agonic.alignment.maths.columns import (
    CoilEstimate,
    Stretches,
    average,
    choose_drift,
    estimate_coil,
    split,
)
from agonic.alignment.session.laboratory import CoilSession
from agonic.alignment.session.observed import average_beside
from agonic.alignment.session.session import DEFLECTION
from agonic.arrays import Array
from agonic.errors import CoverageError
from agonic.health import Finding, Judged, figure
from agonic.health.finding import Fact, Limit, Told
from agonic.maths.estimation.noise.student import RARE
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.maths.rotations.vectors import skew
from agonic.readable import Shown

METHOD = ("harbin-2018",)
SAME_CURRENT = 0.02
"""Share of the largest current by which stretches of one level may differ."""
MIN_STRETCHES, MAX_DRIFT = 6, 16
SURE = 5.0
"""Standard errors by which parts of the readings, or the reference, must differ to say anything."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Direction:
    """The axis (3,) in the axes of a frame's letter, with the covariance (3, 3) of the vector."""

    frame: str
    axis: Annotated[Array, Shown()]
    covariance: Annotated[Array, Shown()]

    def turn(self, frame: str, matrix: Array, spread: Array | None = None) -> Direction:
        """In other axes; `spread` is the covariance of the turn's own rotation vector there."""
        axis = matrix @ self.axis
        covariance = matrix @ self.covariance @ matrix.T
        if spread is not None:
            covariance = covariance + skew(axis) @ spread @ skew(axis).T
        return Direction(frame=frame, axis=axis, covariance=covariance)

    @property
    def sd_arcsec(self) -> Annotated[float, Shown()]:
        """Standard error of the direction about its worst axis."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance)[-1], 0.0)) / ARCSEC_RAD)

    @property
    def angles_deg(self) -> tuple[float, float]:
        """Azimuth and elevation in north-east-down; else longitude and latitude on the sphere:
        right ascension and declination in inertial axes."""
        x, y, z = self.axis
        up = -z if self.frame == "n" else z
        return float(np.degrees(np.arctan2(y, x)) % 360), float(np.degrees(np.arcsin(up)))


@dataclass(frozen=True, kw_only=True)
class Level:
    """The coil at one size of the current: constant, and how far from that of all, nT/A."""

    current_A: Annotated[float, Shown()]
    constant: Annotated[float, Shown()]
    sd: Annotated[float, Shown()]
    departure: Annotated[float, Shown()]


@dataclass(frozen=True, kw_only=True, eq=False)
class CoilFit(Judged):
    """The result of `fit_coil`.

    Parameters
    ----------
    current : (k,) of the stretches in which it was constant. read : their means, and stretches :
        the same without the ambient field, where the reference's axes are known.
    estimate : the coil's vector by the ampere in the magnetometer's axes, with its covariance.
    directions : the axis in every frame that the session leads to, by letter: m magnetometer, b or
        c platform, n north-east-down, e Earth-fixed, i inertial at `time`.
    geometric_deg, geometric_sd_arcsec : the angle to the axis as drawn.
    levels : the constant at each size of the current. p_linear : how often they differ so much by
        chance.
    """

    session: CoilSession
    current: Array
    read: Stretches
    stretches: Stretches
    estimate: CoilEstimate
    directions: Annotated[dict[str, Direction], Shown(key="axes")]
    geometric_deg: Annotated[float | None, Shown()] = None
    geometric_sd_arcsec: Annotated[float | None, Shown()] = None
    levels: Annotated[tuple[Level, ...], Shown()] = ()
    p_linear: Annotated[float, Shown()] = 1.0
    time: Annotated[float | None, Shown(key="unix_s")] = None
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def n(self) -> Annotated[int, Shown()]:
        """How many stretches of constant current."""
        return len(self.stretches.time)

    @property
    def reversals(self) -> Annotated[int, Shown()]:
        """How often the current changed its sign."""
        sign = np.sign(self.current)
        return int((np.diff(sign[sign != 0]) != 0).sum())

    @property
    def axis(self) -> Array:
        """The unit vector (3,) in the magnetometer's axes."""
        return self.directions["m"].axis

    @property
    def axis_sd_arcsec(self) -> float:
        """Its standard error about the worst axis."""
        return self.directions["m"].sd_arcsec

    @property
    def constant(self) -> Annotated[float, Shown(key="constant_nT_A")]:
        """The coil constant, nT/A."""
        return float(np.linalg.norm(self.estimate.linear))

    @property
    def constant_sd(self) -> Annotated[float, Shown(key="constant_sd_nT_A")]:
        """Its standard error, with that of the current's scale."""
        along = float(np.sqrt(self.axis**2 @ self.estimate.covariance[:, 0, 0]))
        return float(np.hypot(along, self.session.current_sd * self.constant))


def read_stretches(session: CoilSession) -> tuple[Array, Stretches, Stretches]:
    """The current (k,) of the stretches in which it is constant, their means, and the same without
    the reference's field, where its axes are known."""
    samples = session.magnetometer
    current, time = samples.current_A, samples.time
    assert time is not None, "checked with the session"
    assert current is not None, "checked with the session"
    whole = split(np.abs(np.diff(current)) > SAME_CURRENT * float(np.abs(current).max()))
    settled = (own[time[own] - time[own[0]] >= session.settle_s] for own in whole)
    rows = [own for own in settled if len(own)]
    if len(rows) < MIN_STRETCHES:
        raise CoverageError(
            f"the current has {len(rows)} stretches",
            undetermined="drift and coil together",
            turns=f"reverse it at least {MIN_STRETCHES} times",
        )
    read = average_beside(rows, samples, session.corrected, session.reference)
    seen = read
    if session.attitude is not None and read.beside is not None:
        onto_m = session.rot_pm.T @ session.attitude.rot_pn
        seen = read._replace(field=read.field - read.beside.field @ onto_m.T, beside=None)
    return average(current, rows), read, seen


def _compare(fit: CoilFit, one: CoilEstimate, *others: CoilEstimate) -> tuple[float, float]:
    """By how much the constant of some of the readings differs from that of others, or of all, and
    the standard error."""
    other = others[0].linear if others else fit.estimate.linear
    variance = sum((each.covariance for each in others), one.covariance)[:, 0, 0]
    moved = float((one.linear - other) @ fit.axis)
    return moved, float(np.sqrt(variance @ fit.axis**2))


def _find_settling(fit: CoilFit) -> Told:
    """Whether the field was still on its way after each change of the current: then the second
    halves of the stretches give another constant, by so many percent; none where too little is left
    of them."""
    session, time = fit.session, fit.stretches.time
    half_s = float(np.ptp(time)) / (len(time) - 1) / 2
    try:
        current, _, seen = read_stretches(replace(session, settle_s=session.settle_s + half_s))
    except CoverageError:
        return None
    late = estimate_coil(current, seen, fit.estimate.drift, even=len(fit.levels) > 0)
    moved, sd = _compare(fit, late)
    return 100 * abs(moved) / fit.constant if abs(moved) >= SURE * sd else None


def _find_away(fit: CoilFit) -> Told:
    """How far the axis is from the one as drawn, degrees, and what may be the cause."""
    away = fit.geometric_deg or 0.0
    back = away >= 175.0
    turned = "the coil or the sign of its current is reversed"
    return {"value": away, "cause": turned if back else "is it another coil?"}


def _find_coil_beside(fit: CoilFit) -> Told:
    """What share of the coil's field the reference sees, percent: it should see none."""
    beside = fit.read.beside
    if beside is None:
        return None
    own = fit.read._replace(field=beside.field, beside=None)
    drift = choose_drift(fit.current, own, MAX_DRIFT, even=False)
    seen = estimate_coil(fit.current, own, drift, even=False)
    sure = (np.abs(seen.linear) > SURE * np.sqrt(seen.covariance[:, 0, 0])).any()
    return 100 * float(np.linalg.norm(seen.linear)) / fit.constant if sure else None


def _find_other_field(fit: CoilFit) -> Told:
    """By how much the magnetometer's ambient field differs from the reference's, percent."""
    beside = fit.read.beside
    if beside is None:
        return None
    ambient = fit.read.counts @ (fit.read.field - fit.current[:, None] * fit.estimate.linear)
    more = float(np.linalg.norm(ambient) / np.linalg.norm(fit.read.counts @ beside.field)) - 1
    return {"value": 100 * abs(more), "way": "more" if more > 0 else "less"}


def _find_warming(fit: CoilFit) -> Told:
    """The constant of the second half of the stretches against that of the first, percent."""
    half = fit.n // 2
    if half < 16:  # stretches: fewer show no drift beside their scatter
        return None
    drift, even = min(fit.estimate.drift, half // 4), len(fit.levels) > 0
    first, second = (
        estimate_coil(fit.current[rows], fit.stretches.select(rows), drift, even=even)
        for rows in (slice(0, half), slice(half, None))
    )
    moved, sd = _compare(fit, second, first)
    share = 100 * moved / fit.constant
    return {"value": abs(share), "by": share} if abs(moved) > SURE * sd else None


def _find_nonlinear(fit: CoilFit) -> Told:
    if not fit.p_linear < RARE:
        return None
    worst = max(fit.levels, key=lambda level: abs(level.departure / level.sd))
    off = 1e6 * worst.departure / fit.constant
    return {"current": figure(worst.current_A, 3), "off": off}


def _find_even(fit: CoilFit) -> Told:
    """How many standard errors what does not reverse is from nothing."""
    even, spread = fit.estimate.even, fit.estimate.covariance[:, 1, 1]
    if not spread.any():
        return None
    out, largest = float(np.sqrt((even**2 / spread).max())), float(np.abs(fit.current).max())
    return {"value": out, "left": float(np.linalg.norm(even)) * largest**2, "largest": largest}


def _is_fixed(fit: CoilFit) -> bool:
    """Whether the axis is known in the axes of the Earth."""
    return "e" in fit.directions


FACTS = (
    Fact(
        "coil not settled",
        _find_settling,
        Limit(check=1e-3, refuse=1.0),  # percent of the constant
        "the field still changes after each change of the current: the second halves of the "
        "stretches alone give a constant that differs by {value} %",
        "give a longer settle_s in the session, and leave each current on for longer",
    ),
    Fact(
        "large current",
        lambda fit: float(np.abs(fit.current).max()),
        Limit(check=50.0),  # amperes
        "the largest current is {value} A, more than such coils carry",
        "give current_A in amperes; are these milliamperes?",
    ),
    Fact(
        "axis not as drawn",
        _find_away,
        Limit(check=5.0),  # degrees
        "the axis is {value}° from the nominal axis",
        "check the leads and the axes: {cause}",
    ),
    Fact(
        "coil in the reference",
        _find_coil_beside,
        Limit(check=1e-3),  # percent of the constant
        "the reference sees {value} % of the coil's field, so that much may be missing from the "
        "constant",
        "put the reference farther from the coil, or fit without it",
    ),
    Fact(
        "ambient field differs",
        _find_other_field,
        Limit(check=0.5),  # percent
        "without the coil the magnetometer reads {value} % {way} than the reference; if that is an "
        "error of its gain, the constant has the same error",
        "give the magnetometer's calibration, or state why the field differs",
    ),
    Fact(
        "constant drifts",
        _find_warming,
        Limit(check=0.01),  # percent of the constant
        "the second half of the readings gives a constant {by} % from that of the first: the coil, "
        "its shunt or its source warms up",
        "warm it up before, and keep the current on for the same time in both directions",
    ),
    Fact(
        "one polarity",
        lambda fit: {} if (fit.current > 0).all() or (fit.current < 0).all() else None,
        "check",
        "the current never changes its sign, so its steady errors do not cancel",
        "reverse it",
    ),
    Fact(
        "no reference",
        lambda fit: {} if fit.session.reference is None else None,
        "note",
        "the drift of the ambient field is only estimated, by a smooth curve",
        "record a reference beside it",
    ),
    Fact(
        "geodetic coordinates",
        lambda fit: {} if _is_fixed(fit) and fit.session.site.coordinates == "geodetic" else None,
        "check",
        DEFLECTION,
        "give astronomical coordinates",
    ),
    Fact(
        "no inertial axis",
        lambda fit: {} if _is_fixed(fit) and "i" not in fit.directions else None,
        "note",
        "the readings have no date for which the Earth's rotation is known, so there is no "
        "inertial axis",
        "give times as dates, or install a newer astropy-iers-data",
    ),
    Fact(
        "nonlinear",
        _find_nonlinear,
        "check",
        "at {current} A the constant is off by {off} ppm",
        "check shunt and source, and the magnetometer's linearity",
    ),
    Fact(
        "even in the current",
        _find_even,
        Limit(note=4.0),  # standard errors
        "reversing does not reverse {left} nT at {largest:g} A",
        "look for heating, or iron near the coil; the axis is free of it",
    ),
    Fact(
        "correlated residuals",
        lambda fit: float(fit.estimate.correlation.max()),
        Limit(check=2.0),  # stretches that count as one
        "residuals are correlated over {value} stretches",
        "reverse the current more often, or put the reference nearer",
    ),
)
EFFECTS = {
    "coil not settled": (
        "large current",
        "axis not as drawn",
        "coil in the reference",
        "ambient field differs",
        "constant drifts",
    )
}
