"""`fit_coil`: the magnetic axis and the constant of a coil, from current reversals."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from agonic.alignment.findings import is_above, report, report_above
from agonic.alignment.maths.columns import (
    CoilEstimate,
    Stretches,
    average,
    choose_drift,
    estimate_coil,
    fit_columns,
    split,
)
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.laboratory import CoilSession
from agonic.alignment.session.observed import average_beside
from agonic.alignment.session.session import compute_unix_s
from agonic.arrays import Array
from agonic.errors import CoverageError, ValidityError
from agonic.health import Finding, Judged, figure
from agonic.maths.estimation.noise.student import RARE
from agonic.maths.rotations.angles import angle_deg
from agonic.maths.rotations.frames import ARCSEC_RAD, rot_en
from agonic.maths.rotations.vectors import skew
from agonic.readable import Shown


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


SURE = 5.0
"""Standard errors by which parts of the readings, or the reference, must differ to say anything."""
METHOD = ("harbin-2018",)
SAME_CURRENT = 0.02
"""Share of the largest current by which stretches of one level may differ."""
MIN_STRETCHES, MAX_DRIFT = 6, 16


def fit_coil(session: CoilSession) -> CoilFit:
    """The magnetic axis of a coil in every frame that is known, and its constant.

    With the current at +I and −I, (B₊ − B₋)/2I is the coil's vector k by the ampere: the ambient
    field and the magnetometer's bias cancel. The means of all stretches of constant current give

        y_j = k I_j + q I_j² + drift(t_j) + ambient_j,

    by least squares, so any order and sizes of the current serve. The ambient's changes are those
    of the reference, turned into the magnetometer's axes where alignment and attitude are known and
    fitted otherwise; what is left of drift is a polynomial as long as it pays.

    Parameters
    ----------
    session : readings with the current, and the chain to the frames wanted (`read_coil`).

    Returns a `CoilFit`. Raises `CoverageError` where the current changes too rarely.

    Source: patent CN 108871301 B.

    >>> from agonic.alignment.simulation.laboratory import simulate_coil
    >>> made = simulate_coil(seed=2)
    >>> fit = fit_coil(made.session)
    >>> fit.reversals, bool(fit.axis_sd_arcsec < 1.0)
    (100, True)
    """
    current, read, seen = _read(session)
    level = _levels(current)
    even = int(level.max()) > 0
    drift = choose_drift(current, seen, MAX_DRIFT, even=even)
    found = estimate_coil(current, seen, drift, even=even)
    time = None
    if session.magnetometer.epoch is not None:  # the middle of the measurement
        time = float(compute_unix_s(session.magnetometer)[[0, -1]].mean())
    directions = _directions(session, found, time)
    away, away_sd = _geometry(session, directions)
    fit = CoilFit(
        session=session,
        current=current,
        read=read,
        stretches=seen,
        estimate=found,
        directions=directions,
        time=time,
        geometric_deg=away,
        geometric_sd_arcsec=away_sd,
    )
    if even:
        levels, p = _linearity(fit, level)
        fit = replace(fit, levels=levels, p_linear=p)
    return replace(fit, findings=tuple(_examine(fit)), remarks=_describe(fit))


def _read(session: CoilSession) -> tuple[Array, Stretches, Stretches]:
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


def _levels(current: Array) -> NDArray[np.int64]:
    """The number of each stretch's size of current, from the smallest; −1 for none."""
    size = np.abs(current)
    order = np.argsort(size)
    number = np.empty(len(size), dtype=np.int64)
    step = np.diff(size[order], prepend=0.0) > SAME_CURRENT * float(size.max())
    number[order] = np.cumsum(step) - 1
    return number


def _directions(
    session: CoilSession, found: CoilEstimate, time: float | None
) -> dict[str, Direction]:
    """The axis in all frames to which the chain leads."""
    size = float(np.linalg.norm(found.linear))
    axis = found.linear / size
    across = np.eye(3) - np.outer(axis, axis)
    covariance = across @ np.diag(found.covariance[:, 0, 0]) @ across / size**2
    last = Direction(frame="m", axis=axis, covariance=covariance)
    known = {"m": last}
    alignment, attitude, site = session.alignment, session.attitude, session.site
    if alignment is not None:
        last = last.turn(alignment.frame_out, session.rot_pm, alignment.covariance)
        known[last.frame] = last
    if attitude is None:
        return known
    # the attitude's error stands in the platform's axes, before the turn into north-east-down
    tilted = last.turn(last.frame, np.eye(3), attitude.covariance)
    known["n"] = tilted.turn("n", attitude.rot_pn.T)
    if site is not None:
        known["e"] = known["n"].turn("e", rot_en(site.latitude_deg, site.longitude_deg))
        with suppress(ValidityError):  # where the Earth's rotation is not known
            if time is not None:
                known["i"] = known["e"].turn("i", load_earth_rotation().rot_ei([time])[0].T)
    return known


def _geometry(
    session: CoilSession, directions: dict[str, Direction]
) -> tuple[float | None, float | None]:
    """The angle to the axis as drawn, and its standard error."""
    if session.geometric_axis is None:
        return None, None
    drawn = session.geometric_axis / np.linalg.norm(session.geometric_axis)
    here = directions[session.geometric_frame]
    away = here.axis - drawn * (here.axis @ drawn)
    sd = here.sd_arcsec
    if float(np.linalg.norm(away)) > 2 * sd * ARCSEC_RAD:  # nearer, the angle has no direction
        # the angle grows as the axis moves away from the drawn one, square to the axis itself
        along = away - here.axis * (away @ here.axis)
        along = along / np.linalg.norm(along)
        sd = float(np.sqrt(along @ here.covariance @ along)) / ARCSEC_RAD
    return float(angle_deg(here.axis, drawn)), sd


def _linearity(fit: CoilFit, level: NDArray[np.int64]) -> tuple[tuple[Level, ...], float]:
    """The constant at each level, and how often by chance they differ so much."""
    scale = float(np.abs(fit.current).max())
    columns = (level[:, None] == np.arange(level.max() + 1)) * fit.current[:, None] / scale
    found = fit_columns(fit.stretches, columns, fit.estimate.drift)
    each = found.coefficients / scale
    sd = np.sqrt(np.diag(found.spread)[:, None] * found.variance) / scale
    along, error = each @ fit.axis, np.sqrt((sd**2) @ fit.axis**2)
    mean = float((along / error**2).sum() / (1 / error**2).sum())
    chi2 = float((((along - mean) / error) ** 2).sum())
    sizes = [float(np.abs(fit.current[level == k]).mean()) for k in range(len(along))]
    levels = tuple(
        Level(current_A=size, constant=float(a), sd=float(e), departure=float(a - mean))
        for size, a, e in zip(sizes, along, error, strict=True)
    )
    return levels, float(chdtrc(len(along) - 1, chi2))


def _describe(fit: CoilFit) -> tuple[str, ...]:
    """How good it is, in sentences."""
    said = (
        f"constant {figure(fit.constant, 7)} ± {figure(fit.constant_sd)} nT/A from "
        f"{fit.reversals} reversals",
        f"standard error of the axis: {figure(fit.axis_sd_arcsec)}″ in the magnetometer's axes",
    )
    if fit.geometric_deg is None or fit.geometric_sd_arcsec is None:
        return said
    away = f"{figure(3600 * fit.geometric_deg, 4)}″ ± {figure(fit.geometric_sd_arcsec)}″"
    return (*said, f"the axis is {away} from the nominal axis")


def _examine(fit: CoilFit) -> Iterator[Finding]:
    """The findings of a fit. A coil that does not settle spoils what shows the mistakes."""
    settling = list(_judge_settling(fit))
    yield from settling
    largest, away = float(np.abs(fit.current).max()), fit.geometric_deg or 0.0
    if not settling:
        yield from report_above("large current", largest, largest=largest)
        turned = "the coil or the sign of its current is reversed"
        cause = (
            turned
            if away > 90.0 and not is_above("axis not as drawn", 180.0 - away)
            else ("is it another coil?")
        )
        yield from report_above("axis not as drawn", away, away=away, cause=cause)
        yield from _check_reference(fit)
        yield from _check_drift(fit)
    if (fit.current > 0).all() or (fit.current < 0).all():
        yield report("one polarity")
    if fit.session.reference is None:
        yield report("no reference")
    site, fixed = fit.session.site, "e" in fit.directions
    if fixed and site is not None and site.coordinates == "geodetic":
        yield report("geodetic coordinates", otherwise="")
    if fixed and "i" not in fit.directions:
        yield report("no inertial axis")
    if fit.p_linear < RARE:
        worst = max(fit.levels, key=lambda level: abs(level.departure / level.sd))
        off = 1e6 * worst.departure / fit.constant
        yield report("nonlinear", current=figure(worst.current_A, 3), off=off)
    even, spread = fit.estimate.even, fit.estimate.covariance[:, 1, 1]
    if spread.any():
        out, left = float(np.sqrt((even**2 / spread).max())), float(np.linalg.norm(even))
        yield from report_above("even in the current", out, left=left * largest**2, largest=largest)
    length = float(fit.estimate.correlation.max())
    yield from report_above("correlated residuals", length, length=length)


def _compare(fit: CoilFit, one: CoilEstimate, *others: CoilEstimate) -> tuple[float, float]:
    """By how much the constant of some of the readings differs from that of others, or of all, and
    the standard error."""
    other = others[0].linear if others else fit.estimate.linear
    variance = sum((each.covariance for each in others), one.covariance)[:, 0, 0]
    moved = float((one.linear - other) @ fit.axis)
    return moved, float(np.sqrt(variance @ fit.axis**2))


def _judge_settling(fit: CoilFit) -> Iterator[Finding]:
    """Whether the field was still on its way after each change of the current: then the second
    halves of the stretches give another constant; none where too little is left of them."""
    session, time = fit.session, fit.stretches.time
    half_s = float(np.ptp(time)) / (len(time) - 1) / 2
    try:
        current, _, seen = _read(replace(session, settle_s=session.settle_s + half_s))
    except CoverageError:
        return
    late = estimate_coil(current, seen, fit.estimate.drift, even=len(fit.levels) > 0)
    moved, sd = _compare(fit, late)
    share = abs(moved) / fit.constant
    if abs(moved) >= SURE * sd and is_above("coil not settled", share):
        yield report("coil not settled", "refuse" if share > 0.01 else "check", by=100 * share)


def _check_reference(fit: CoilFit) -> Iterator[Finding]:
    """What the reference says: of the coil it should see nothing, of the ambient field all."""
    beside = fit.read.beside
    if beside is None:
        return
    own = fit.read._replace(field=beside.field, beside=None)
    drift = choose_drift(fit.current, own, MAX_DRIFT, even=False)
    seen = estimate_coil(fit.current, own, drift, even=False)
    share = float(np.linalg.norm(seen.linear)) / fit.constant
    if (np.abs(seen.linear) > SURE * np.sqrt(seen.covariance[:, 0, 0])).any():
        yield from report_above("coil in the reference", share, share=100 * share)
    ambient = fit.read.counts @ (fit.read.field - fit.current[:, None] * fit.estimate.linear)
    more = float(np.linalg.norm(ambient) / np.linalg.norm(fit.read.counts @ beside.field)) - 1
    way = "more" if more > 0 else "less"
    yield from report_above("ambient field differs", abs(more), by=100 * abs(more), way=way)


def _check_drift(fit: CoilFit) -> Iterator[Finding]:
    """The constant of the first half of the stretches against that of the second."""
    half = fit.n // 2
    if half < 16:  # stretches: fewer show no drift beside their scatter
        return
    drift, even = min(fit.estimate.drift, half // 4), len(fit.levels) > 0
    first, second = (
        estimate_coil(fit.current[rows], fit.stretches.select(rows), drift, even=even)
        for rows in (slice(0, half), slice(half, None))
    )
    moved, sd = _compare(fit, second, first)
    share = moved / fit.constant
    if abs(moved) > SURE * sd:
        yield from report_above("constant drifts", abs(share), by=100 * share)
