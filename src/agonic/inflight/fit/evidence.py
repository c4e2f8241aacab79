"""What a fit in flight is worth: what is undetermined, left out, or wrong with the reference."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from agonic.field.world_model import REFERENCE_RADIUS_M
from agonic.health import Finding, Limit, check_scale, figure, inspect, sort_findings
from agonic.inflight.fit import likely_causes
from agonic.inflight.fit.ground_errors import states_covariance
from agonic.inflight.fit.interval_choice import find_step, sum_stretches
from agonic.inflight.fit.pointing import LOWEST_ORBIT_M
from agonic.inflight.fit.result import InflightFit
from agonic.inflight.fit.solve import find_start, fit_rows
from agonic.inflight.fit.terms import DEGREE
from agonic.inflight.fit.torquers import list_torquer_findings
from agonic.inflight.simulation.kepler import GRAVITATION_M3_S2
from agonic.maths.equation.coverage import find_nearest_axis
from agonic.maths.equation.gauge import mean_gain
from agonic.samples import Samples

if TYPE_CHECKING:
    from agonic.inflight.fit.problem import Problem

MANY = 4
"""Intervals of the bias from which a step, or other gains, are looked for in their place."""
LIMITS = {
    # change of the mean gain that is spoken of: what shrinks one axis alone is another
    "gain": Limit(0.005),
    # below it heights may be off instead, by 35 km: F falls with r³
    "gain by heights": Limit(0.015),
    # residuals over those with a spline, and over those with a steady drift, that are no step
    "step over spline": Limit(1.05),
    "step over drift": Limit(0.97),
    # intervals in an orbit; a spline needs four for what goes round once, and two hold slow heat
    "intervals in an orbit": Limit(3.0),
    # scatter over the field from which the usual mistakes are tried, and the reference is doubted
    "mistakes": Limit(0.003),
    "reference": Limit(0.015),
    # share of the residual that is correlated, from which they are tried however small it is
    "correlated": Limit(0.8),
    # standard error of a bias over the field
    "undetermined": Limit(0.02, 0.1),
    "outliers": Limit(0.1),  # of the readings
    "attitude": Limit(5.0, 20.0),  # ° between the field and its direction, median
}


def examine(
    fit: InflightFit, problem: Problem, samples: Samples, allowed: Sequence[Finding] = ()
) -> InflightFit:
    """The fit with findings, refusals first, and remarks; `allowed` is said of what the standard
    errors were grown by.
    """
    off = abs(find_other_gain(fit, problem) - 1)
    by_gains, gains = LIMITS["gain by heights"].grade(off), list[Finding]()
    if LIMITS["gain"].grade(off):
        what = (
            f"gains that are {figure(100 * off)} % off those of the ground explain the record as "
            f"well as the {fit.drift.intervals} intervals of the bias do"
        )
        move = "check units and the magnitude that the ground calibration was made for, and "
        move += 'heights; solve for the matrix too (solve="full", --solve full)'
        gains = [Finding("gains changed", "check", what, move)]
    found = [
        *(f for f in inspect(samples) if f.name not in ("gaps", "repeated readings")),
        *_reference(fit, problem, samples),
        *gains,
        *(() if by_gains else likely_causes.judge_ground_axes(fit, problem, samples)),
        *(() if by_gains else _judge_course(fit, problem, samples)),
        *allowed,
        *filter(None, [check_scale(mean_gain(fit.after.matrix), fit.after.unit_in)]),
        *_judge_rows(fit, samples),
        *_check_undetermined(fit, problem.magnitude),
        *list_torquer_findings(problem.torquers),
    ]
    fit = replace(fit, findings=sort_findings(found))
    return fit if fit.verdict == "refused" else replace(fit, remarks=_remarks(fit, problem))


def find_period_s(samples: Samples) -> float | None:
    """How long a circular orbit of the height takes, s; None where the log is of no orbit.

    T = 2π √(a³/GM)
    """
    if samples.altitude_m is None or np.median(samples.altitude_m) < LOWEST_ORBIT_M:
        return None
    radius = REFERENCE_RADIUS_M + float(np.median(samples.altitude_m))
    return float(2 * np.pi * np.sqrt(radius**3 / GRAVITATION_M3_S2))


def _find_short_interval_s(fit: InflightFit, samples: Samples) -> tuple[float, float] | None:
    """The interval of the bias, s, and the orbit's period, where there are more than three in an
    orbit; else None."""
    period = find_period_s(samples)
    if period is None or not fit.drift.changes:
        return None
    interval = (fit.drift.stop - fit.drift.start) / fit.drift.intervals
    short = LIMITS["intervals in an orbit"].grade(period / interval)
    return (interval, period) if short else None


def _judge_course(fit: InflightFit, problem: Problem, samples: Samples) -> Iterator[Finding]:
    """A bias whose many intervals one step explains as well, or that changes within an orbit as
    only what goes round with it does."""
    count, swing = fit.drift.intervals, _find_short_interval_s(fit, samples)
    if count >= MANY:
        plain = replace(problem, direction=None)
        smooth = fit_rows(plain, find_start(plain), problem.used, count)
        step = find_step(sum_stretches(plain, smooth, count), count)
        over_drift = step.left / step.left_by_drift
        worse = LIMITS["step over spline"].grade(step.left)
        if not worse and not LIMITS["step over drift"].grade(over_drift):
            at_s = fit.drift.start + step.time * (fit.drift.stop - fit.drift.start)
            yield Finding(
                "bias stepped",
                "check",
                f"the bias stepped by {figure(step.size * problem.magnitude)} nT near "
                f"t = {at_s:.0f} s, which explains the record as well as the {count} intervals of "
                "the bias do",
                "see what was switched, moved or exchanged then, and fit before and after it apart "
                "(--between)",
            )
            return
    if swing is not None:
        yield Finding(
            "bias follows the orbit",
            "check",
            f"the bias needs a knot every {figure(swing[0] / 60)} min, and an orbit takes "
            f"{figure(swing[1] / 60)}: rather than the bias of the sensor it follows an error of "
            "the clock or the track, sunlight, or heat, and its standard errors do not hold",
            "check clock, date and heights; fit with the temperature and the currents on board "
            "(--temperature, --with), and where the bias changes slowly give --knots",
        )


def find_other_gain(fit: InflightFit, problem: Problem) -> float:
    """The mean gain over that of the ground, with which a constant bias explains the record better
    for its nine numbers than the intervals for theirs; 1 where it does not.

    Akaike's criterion: n log(s/s₀) below the count of numbers that are saved, with n readings that
    count and s, s₀ what is left.
    """
    if problem.ground is None or fit.solve == "full" or fit.drift.intervals < MANY:
        return 1.0
    freed = replace(problem.settings, solve="full")
    plain = replace(problem, ground=None, direction=None, settings=freed)
    constant = fit_rows(plain, find_start(problem), problem.used, 0)
    left = constant.noise["magnitude"].sd * problem.magnitude
    saved = 3 * (fit.drift.intervals + DEGREE - 1) - (6 if fit.solve == "bias" else 3)
    if fit.n / fit.correlation * np.log(left / fit.noise) > saved:
        return 1.0
    return float(np.mean(constant.solution.params[3:6]))


def _reference(fit: InflightFit, problem: Problem, samples: Samples) -> Iterator[Finding]:
    """A track that cannot be, or a residual that a common mistake would explain."""
    impossible = likely_causes.find_impossible_track(samples)
    if impossible is not None:
        yield Finding("track", "refuse", *impossible)
        return
    share = fit.noise / problem.magnitude
    told = LIMITS["mistakes"].grade(share) or LIMITS["correlated"].grade(
        fit.lasting_nT / max(fit.noise, 1e-300)
    )
    if not told and _find_short_interval_s(fit, samples) is None:
        return
    cause = likely_causes.find_likely_cause(fit, problem, samples)
    what = f"the magnitude scatters by {figure(fit.noise)} nT about the reference"
    if cause is not None:
        yield Finding("reference", "refuse", f"{what}; {cause.words}", cause.move)
    elif LIMITS["reference"].grade(share):
        yield Finding(
            "reference",
            "check",
            f"{what}: much more than errors of models",
            "check times, positions, units and the date; look for currents on board",
        )


def _check_undetermined(fit: InflightFit, magnitude: float) -> Iterator[Finding]:
    """A direction of the bias that the track never showed."""
    variances, axes = np.linalg.eigh(fit.covariance[:3, :3])
    worst = float(np.sqrt(max(variances[-1], 0.0)))
    severity = LIMITS["undetermined"].grade(worst / magnitude)
    if severity is None:
        return
    axis = find_nearest_axis(axes[:, -1])
    yield Finding(
        "bias undetermined",
        severity,
        f"the standard error of the bias near {axis} is {figure(worst)} nT",
        "use a longer record, or one in which the spacecraft turns"
        + ("" if fit.ground is None else "; solve for the bias alone (--solve bias)"),
    )


def _judge_rows(fit: InflightFit, samples: Samples) -> Iterator[Finding]:
    """Readings in axes of the Earth, readings left out, an attitude that the field contradicts."""
    if samples.frame == "n":
        yield Finding(
            "axes of the Earth",
            "check",
            "the readings are components north, east and down, so bias and gains of a sensor "
            "cannot be found from them",
            "give the readings in the axes of the sensor",
        )
    share = 1.0 - np.count_nonzero(fit.weights > 0) / max(fit.n, 1)
    if LIMITS["outliers"].grade(share):
        yield Finding(
            "left out in flight",
            "check",
            f"{figure(100 * share)} % of the readings do not fit and were left out",
            "exclude the times when torquers or transmitters were on",
        )
    off = fit.median_direction_error_deg or 0.0
    if severity := LIMITS["attitude"].grade(off):
        yield Finding(
            "attitude in flight",
            severity,
            f"the field misses its direction by {figure(off)}° (median)",
            "check the attitude: its order of turns, its sign, its time; fit the magnitude alone",
        )


def _remarks(fit: InflightFit, problem: Problem) -> tuple[str, ...]:
    """How good the result is, in words."""
    sd = fit.sd
    said = [f"standard error: bias {figure(float(sd[:3].max()))} nT"]
    if problem.ground is not None:
        said.append(
            f"the bias is {figure(float(np.linalg.norm(fit.change.bias)))} nT from that of the "
            "ground"
        )
        if problem.scale_free:
            by = np.repeat([0.0, 1 / 3, 0.0], 3)
            said.append(
                "the ground calibration was made without a known magnitude: its scale is found "
                f"here, {mean_gain(fit.change.matrix):.4f} ± "
                f"{np.sqrt(by @ fit.covariance @ by):.4f}"
            )
        if not states_covariance(problem.ground):
            said.append(
                "the ground calibration states no standard errors, so its gains are taken as exact"
            )
    if fit.drift.changes:
        ends, _ = fit.drift.at(np.array([fit.drift.start, fit.drift.stop]))
        moved = float(np.linalg.norm(ends[1] - ends[0]))
        said.append(f"the bias drifted by {figure(moved)} nT over the record")
    if (off := fit.median_direction_error_deg) is not None:
        said.append(f"the field misses its direction by {figure(off)}° (median)")
    lasts = ""
    if fit.correlation >= 1.05:
        lasts = f" (effective sample size: 1/{figure(fit.correlation)} of the readings)"
        if fit.lasting_s:
            size, long = figure(fit.lasting_nT), figure(fit.lasting_s)
            lasts = f", of which {size} nT are correlated over {long} s{lasts}"
    return *said, f"residuals: {figure(fit.noise)} nT{lasts}"
