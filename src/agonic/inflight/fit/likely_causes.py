"""What could be wrong with a track, a clock or the names of axes, tried on a few readings."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, timedelta
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import apply
from agonic.errors import AgonicError
from agonic.field.place import field_along
from agonic.field.world_model import REFERENCE_RADIUS_M
from agonic.health import Finding, figure
from agonic.inflight.fit.pointing import LOWEST_ORBIT_M
from agonic.maths.earth.earth_rotation import sidereal_rad
from agonic.maths.earth.geodesy import FLATTENING
from agonic.maths.estimation.loss import cauchy, tukey
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.right_angles import describe_renaming, right_angles
from agonic.samples import Samples

if TYPE_CHECKING:
    from agonic.inflight.fit.problem import Problem
    from agonic.inflight.fit.result import InflightFit


SOME, MORE = 400, 1000
"""Readings on which mistakes of the track, and names of axes, are tried."""
FAR_BETTER = 0.5
"""A cause is named when it would leave less than this share of what is unexplained."""
CLOCK_OFF_S = (5.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0)
"""Errors of a clock, or along a track of old elements, that are tried before the nearest second."""
FAR = 0.1
"""Move of the bias over the field from which other names of the axes are tried."""


class Cause(NamedTuple):
    """What would explain the residual, and what to do."""

    words: str
    move: str


def find_impossible_track(samples: Samples) -> Cause | None:
    """A track as fast as an orbit at a height where nothing orbits."""
    latitude, longitude, time = samples.latitude_deg, samples.longitude_deg, samples.time
    if latitude is None or longitude is None or time is None or len(time) < 3:
        return None
    altitude = 0.0 if samples.altitude_m is None else float(np.median(samples.altitude_m))
    east = np.diff(np.unwrap(longitude, period=360.0)) * np.cos(np.radians(latitude[1:]))
    speed = np.radians(np.hypot(np.diff(latitude), east)) * REFERENCE_RADIUS_M / np.diff(time)
    if np.median(speed) < 3000.0 or altitude > LOWEST_ORBIT_M:
        return None
    return Cause(
        f"the track moves at {figure(float(np.median(speed)) / 1000)} km/s at a height of "
        f"{figure(altitude / 1000)} km, where nothing orbits",
        "give altitudes in metres above the ellipsoid (a column altitude_m, --altitude M for all "
        "readings), or two-line elements (--tle FILE)",
    )


def find_likely_cause(fit: InflightFit, problem: Problem, samples: Samples) -> Cause | None:
    """The usual mistake that explains the residual best, or None where none does.

    With the bias far from the ground's the mistake must explain the readings without the ground
    calibration as well: that of another sensor adds errors which change with temperature.
    """
    # no place nor time can be told by it
    if float(np.std(problem.wanted)) < 1e-3:
        return None
    found = _find_best(problem, samples, problem.samples.field)
    if found is None or problem.ground is None or not _is_far(fit, problem):
        return found
    again = _find_best(problem, samples, samples.field)
    return found if again is not None and again.move == found.move else None


def _find_best(problem: Problem, samples: Samples, field: Array) -> Cause | None:
    """The mistake that leaves least of the changes of F² along the track to the field."""
    some = samples.with_columns(field=field, unit="nT").select(problem.spread_rows(SOME))
    if some.latitude_deg is None or some.longitude_deg is None:
        return None
    now = _misfit(some)
    best, found = FAR_BETTER * now, None
    off = _find_clock_mistake(some, samples)
    # found to the second: chance does not make it
    if off is not None and (left := _misfit_after(off, some, samples)) < 0.75 * now:
        words = f"positions {off:.0f} s off in time would explain it".replace("-", "−")
        move = "check the clock of the log, and the age of two-line elements"
        best, found = min(left, best), Cause(words, move)
    for what, move, change in _list_mistakes(some):
        left = _misfit_after(change, some, samples)
        if left < best:
            best, found = left, Cause(f"{what} would explain it", move)
    return found


def _misfit(samples: Samples) -> float:
    """The share of the changes of F² that no quadratic in the readings explains, 0…1.

    |W (raw − b)|² = F² is linear in ten coefficients: enough to tell a right track from a wrong.
    Solved by reweighting, from Cauchy's loss to Tukey's: a minute of readings that are off, as
    while a sensor warms up, would otherwise find a track of its own.
    """
    expected = field_along(samples)
    if expected is None:
        return float("inf")
    raw = samples.field
    f = np.broadcast_to(expected.reference.magnitudes(len(raw)), len(raw))
    scale = float(f.mean())
    x, y, z = (raw - raw.mean(axis=0)).T / scale
    design = np.column_stack([x * x, y * y, z * z, x * y, x * z, y * z, x, y, z, np.ones(len(raw))])
    square = (f / scale) ** 2
    root = np.ones(len(square))
    for loss in (cauchy(),) * 3 + (tukey(),) * 3:
        solution = np.linalg.lstsq(design * root[:, None], square * root, rcond=None)[0]
        residuals = square - design @ solution
        left = robust_scale(residuals, design.shape[1])
        root = np.sqrt(loss.weight((residuals / max(left, 1e-12)) ** 2))
    return left / max(float(square.std()), 1e-12)


Change = float | dict[str, Any]
"""What would undo a mistake: seconds by which the track was recorded too early, or columns."""

_CLOCKS = {
    18.0: "18 s (GPS time taken for UTC)",
    -18.0: "−18 s (UTC taken for GPS time)",
    37.0: "37 s (TAI taken for UTC)",
    3600.0: "an hour",
    -3600.0: "an hour",
    43200.0: "twelve hours",
    -43200.0: "twelve hours",
}
"""Usual errors of a clock, s."""


def _misfit_after(change: Change, samples: Samples, track: Samples) -> float:
    """What is left of samples once a mistake is undone; infinite where it cannot be."""
    try:
        if isinstance(change, float):
            return _misfit(_shift_time(change, samples, track))
        return _misfit(samples.with_columns(**change))
    except (AgonicError, ValueError):
        return float("inf")


def _find_clock_mistake(samples: Samples, track: Samples) -> float | None:
    """The clock's error, s, that leaves least: near the best of a few, by parabolas."""

    def measure(seconds: float) -> float:
        return _misfit_after(seconds, samples, track)

    best = min((sign * off for off in CLOCK_OFF_S for sign in (-1.0, 1.0)), key=measure)
    step = abs(best) / 2
    for _ in range(3):
        left = np.square([measure(one) for one in (best - step, best, best + step)])
        bend = left[0] - 2 * left[1] + left[2]
        if np.isfinite(bend) and bend > 0:
            best += float(np.clip((left[0] - left[2]) / bend / 2, -1.0, 1.0)) * step
        step /= 2
    return None if abs(best) < 1.0 or not np.isfinite(measure(best)) else best


def _shift_time(seconds: float, samples: Samples, track: Samples) -> Samples:
    """The samples as they would be if their track was recorded so many seconds later."""
    assert samples.time is not None
    assert track.time is not None
    then = samples.time + seconds
    within = (then >= track.time[0]) & (then <= track.time[-1])
    if within.sum() < 0.3 * len(then):
        raise ValueError("moving the times leaves too little of the track")
    moved = {
        name: np.interp(then, track.time, np.unwrap(values, period=360.0))
        for name in ("latitude_deg", "longitude_deg", "altitude_m")
        if (values := getattr(track, name)) is not None
    }
    moved["longitude_deg"] = wrap_deg(moved["longitude_deg"])
    return samples.with_columns(**moved).select(within)


def _list_mistakes(samples: Samples) -> Iterator[tuple[str, str, Change]]:
    """The usual mistakes, what to do about each, and the change that would undo it."""
    for seconds, words in _CLOCKS.items():
        yield f"positions {words} off in time", "check the time scale", seconds
    latitude, longitude = samples.latitude_deg, samples.longitude_deg
    assert latitude is not None
    assert longitude is not None
    move = "count longitude positive east"
    yield "longitudes counted west", move, {"longitude_deg": -longitude}
    exchanged = {"latitude_deg": np.clip(longitude, -90, 90), "longitude_deg": latitude}
    yield "latitude and longitude exchanged", "exchange the two columns", exchanged
    move = "count latitude positive north"
    yield "latitudes with the sign reversed", move, {"latitude_deg": -latitude}
    if samples.epoch is not None:  # the track if its longitudes were right ascensions
        epoch = samples.epoch if samples.epoch.tzinfo else samples.epoch.replace(tzinfo=UTC)
        turned = np.degrees(sidereal_rad(epoch.timestamp() + np.asarray(samples.time)))
        move = "turn positions into Earth-fixed axes with the sidereal time"
        fixed = {"longitude_deg": wrap_deg(longitude - turned)}
        yield "longitudes among the stars (inertial axes)", move, fixed
    # tan of a geocentric latitude on the ellipsoid is (1 − f)² of that of the geodetic one
    tangent = np.tan(np.radians(np.clip(latitude, -89.99, 89.99))) / (1.0 - FLATTENING) ** 2
    geodetic = {"latitude_deg": np.degrees(np.arctan(tangent))}
    yield "geocentric latitudes", "give geodetic latitudes", geodetic
    if np.abs(latitude).max() < 1.6 and np.abs(longitude).max() < 6.4:
        turns = {"latitude_deg": np.degrees(latitude), "longitude_deg": np.degrees(longitude)}
        yield "positions in radians", "give positions in degrees", turns
    altitude = np.zeros(len(samples)) if samples.altitude_m is None else samples.altitude_m
    if altitude.max() < 3000.0:
        yield "altitudes in kilometres", "give altitudes in metres", {"altitude_m": altitude * 1e3}
        orbit = {"altitude_m": np.full(len(samples), 4e5)}
        yield "an orbit some 400 km high", "add the altitude", orbit
    if altitude.min() > 3e6:
        what = "distances from the Earth's centre taken for altitudes"
        above = {"altitude_m": altitude - REFERENCE_RADIUS_M}
        yield what, "give the height above the ellipsoid", above
    for years in (-50, -30, -20, -10, 10, 20, 30, 50):  # only decades change the field so much
        then = samples.epoch and samples.epoch + timedelta(days=365.25 * years)
        if then and 1900 <= then.year < 2030:
            yield f"a date near {then.year}", "check the date of the log", {"epoch": then}


def judge_ground_axes(fit: InflightFit, problem: Problem, samples: Samples) -> Iterator[Finding]:
    """A bias so far from the ground's that the axes, or the sensor, are others: nothing else leaves
    it near that of the ground with other names of the axes, and far from it without."""
    moved = float(np.linalg.norm(fit.change.bias))
    if problem.ground is None or moved < FAR * problem.magnitude:
        return
    what = f"the bias is {figure(moved)} nT from that of the ground"
    names, left, plain = _find_nearest(problem, samples)
    if names and left < min(min(moved, plain) / 3, FAR * problem.magnitude):
        move = "give the readings in the axes in which the sensor was calibrated"
        what = f"{what}, and {figure(left)} nT if since then {names}"
        yield Finding("axes of the ground calibration", "refuse", what, move)
    elif _is_far(fit, problem):
        share = f"{figure(100 * moved / problem.magnitude)} % of the field"
        move = "check that the calibration is of this sensor, in these axes and this unit"
        yield Finding("axes of the ground calibration", "check", f"{what}, {share}", move)


def _is_far(fit: InflightFit, problem: Problem) -> bool:
    """Whether the bias moved since the ground by more than hardware hardly makes."""
    return bool(np.linalg.norm(fit.change.bias) >= 0.25 * problem.magnitude)  # hardware hardly does


def _find_nearest(problem: Problem, samples: Samples) -> tuple[str, float, float]:
    """What is wrong with the names of the axes where others leave the bias nearest to the ground's,
    among all with which the magnitude is as constant, no words where nothing is; how far it is
    then, nT; and how far with the names that they have.

    The bias is that of |u − b| = F, linear in b and |b|²: |u|² − F² = 2 u·b − |b|².
    """
    assert problem.ground is not None
    rows = problem.spread_rows(MORE)
    some, wanted, tried = samples.select(rows), problem.wanted[rows], []
    for turn in np.concatenate([right_angles(), -right_angles()]):
        field = apply(problem.ground, some.with_columns(field=some.field @ turn.T)).field
        field = field / problem.magnitude
        design = np.column_stack([2.0 * field, np.ones(len(field))])
        known = np.einsum("ni,ni->n", field, field) - wanted**2
        solution = np.linalg.lstsq(design, known, rcond=None)[0]
        size = float(np.linalg.norm(solution[:3])) * problem.magnitude
        tried.append((size, robust_scale(known - design @ solution, 4), turn))
    limit = 1.1 * min(left for _, left, _ in tried)  # up to which others do as well
    moved, _, turn = min((one for one in tried if one[1] <= limit), key=lambda one: one[0])
    words = "" if np.array_equal(turn, np.eye(3)) else describe_renaming(turn)
    return words, moved, tried[0][0]
