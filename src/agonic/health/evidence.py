"""What a fit gives away about the readings: plane, cap, outliers, two sensors, a changed field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.coverage import Coverage
from agonic.health.finding import Finding, figure
from agonic.maths.equation.coverage import (
    count_orientations,
    find_nearest_axis,
    find_spread_rows,
    measure_arc_deg,
    measure_thickness,
)
from agonic.maths.estimation.bias_change import find_bias_change, refit_residuals
from agonic.maths.estimation.least_median import Pair, fit_two_spheres

HEADING_REFUSED_DEG = 10.0
HEADING_DOUBTFUL_DEG = 2.0
NOISE_DOUBTFUL = 0.04  # of the field's magnitude
OUTLIERS_DOUBTFUL = 0.1
SPARE = 3  # orientations beyond the unknowns that check them
RECORD_LONGER = "record longer"
"""The advice that goes with no cause."""
HALF_CIRCLE_DEG = 180.0
SHIFT_REFUSED = 0.04  # of the field's magnitude
SHIFT_DOUBTFUL = 0.01
SHIFT_OVER_NOISE = 3.0  # less than this does not stand out of the readings


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What a magnitude fit leaves to be examined, all in the unit of the readings.

    `readings` (n, 3), `time` (n,) or None, `residuals` (n,), `weights` (n,), `normals` (n, 3) the
    unit directions in which a residual is measured; `bias` and `radius` of the readings' ellipsoid
    and `shape` (3, 3) the matrix over its mean gain; `noise`; `known_radius` what the radius is at
    least, as far as that is known; `unknowns` those that the readings have to determine.
    """

    readings: Array
    time: Array | None
    residuals: Array
    weights: Array
    normals: Array
    bias: Array
    shape: Array
    radius: float
    noise: float
    coverage: Coverage
    known_radius: float | None = None
    unknowns: int = 9
    unit: str = "nT"


def examine(evidence: Evidence, *, attitude_aided: bool = False) -> tuple[Finding, ...]:
    """The findings of a fit, the gravest first; one cause is not reported twice.

    Readings in a plane are no fault of an attitude-aided fit.
    """
    shape = None if attitude_aided else _static(evidence) or _flat(evidence)
    few = None if attitude_aided or shape else _few_orientations(evidence)
    if shape is not None or (few is not None and few.severity == "refuse"):
        return tuple(finding for finding in (shape, few) if finding is not None)
    second = None if attitude_aided else _second_population(evidence)
    changed = second or _changed(evidence) or _crowded_outliers(evidence)
    if changed is not None and changed.severity == "refuse":
        return (changed,)
    found = [check_coverage(evidence.coverage), changed, few]
    if changed is None:
        outliers = int((evidence.weights == 0.0).sum())
        found += [_noisy(evidence), check_outliers(outliers, len(evidence.weights))]
    return tuple(finding for finding in found if finding is not None)


def _static(e: Evidence) -> Finding | None:
    """Readings that hardly move: far less than the field would move them, or a ball of noise."""
    some = e.readings[find_spread_rows(e.readings, most=20_000)]
    low, high = np.percentile(some, (2, 98), axis=0)
    spread = float((high - low).max() / 2)
    at_rest = e.known_radius is not None and spread < 0.1 * e.known_radius
    if not (at_rest or (e.noise > 0.15 * e.radius and _gaussian(some))):
        return None
    return Finding(
        "static",
        "refuse",
        f"the sensor did not turn: its readings move by only ±{figure(spread)} {e.unit}",
        "turn it slowly about all three axes while recording",
    )


def _few_orientations(e: Evidence) -> Finding | None:
    """Held still in few orientations: however often each was read, it says one thing."""
    reach = min(max(8 * e.noise, 0.02 * e.radius), 0.1 * e.radius)
    enough = e.unknowns + SPARE
    count = count_orientations(e.readings[e.weights > 0], reach, enough)
    if count >= enough:
        return None
    lacking = count < e.unknowns
    left = "that do not determine it" if lacking else "and next to nothing is left to check it by"
    return Finding(
        "few orientations",
        "refuse" if lacking else "check",
        f"the sensor was held in {count} orientations only; the calibration has {e.unknowns} "
        f"unknowns, {left}",
        f"record {enough} orientations or more, well spread, or turn the sensor slowly all the way",
    )


def _some(n: int) -> Index:
    """At most twenty thousand of n rows, in order; drawn, for rows may alternate by a pattern."""
    if n <= 20_000:
        return np.arange(n)
    return np.sort(np.random.default_rng(0).choice(n, 20_000, replace=False))


def _gaussian(readings: Array) -> bool:
    """Whether readings look like noise: they jump as far as they range, and pile up in the middle.

    Kurtosis is near 3 for noise, where a turning sensor has 1.8; or they flicker between a few
    levels.
    """
    sd = np.maximum(readings.std(axis=0), 1e-300)
    jumps = np.diff(readings, axis=0).std(axis=0) / (np.sqrt(2) * sd)
    few_levels = max(len(np.unique(column)) for column in readings.T) < 8
    kurtosis = (((readings - readings.mean(axis=0)) / sd) ** 4).mean()
    return bool(jumps.max() > 0.5 and (few_levels or kurtosis > 2.5))


def _flat(e: Evidence) -> Finding | None:
    """Readings in a plane, or nearly: the centre along its normal is not determined."""
    used = e.readings[(e.weights > 0) | (e.weights == 0).all()]
    thick, normal = max(
        (measure_thickness(used[rows]) for rows in (_some(len(used)), find_spread_rows(used))),
        key=lambda measured: measured[0],
    )
    if thick > 0.1:
        return None
    axis = find_nearest_axis(normal)
    noise_thickness = 2.4 * e.noise / e.radius
    in_one_plane = thick < max(0.02, 1.5 * noise_thickness)
    arc = measure_arc_deg(used)
    if in_one_plane and arc < HALF_CIRCLE_DEG:
        span = f"an arc of some {round(arc, -1):.0f}°"
        what = f"all readings lie on {span} in one plane (its normal is near {axis})"
        return Finding(
            "plane",
            "refuse",
            f"{what}: bias and gain along {axis} are not determined, nor well in the plane",
            "turn all the way round at several headings, with the nose up, down and banked",
        )
    if in_one_plane:
        what = f"all readings lie in one plane (its normal is near {axis})"
    else:
        tilt = np.degrees(np.arcsin(min(thick, 1.0)))
        what = f"all readings lie near one plane (normal near {axis}, tilt about {tilt:.0f}° only)"
    return Finding(
        "plane" if in_one_plane else "small tilt",
        "refuse",
        f"{what}: bias and gain along {axis} are not determined",
        "tilt the nose up and down and bank by 30° or more at several headings",
    )


def _changed(e: Evidence) -> Finding | None:
    """A bias that was another for a while, by more than the noise can hide."""
    rows = find_spread_rows(e.readings, most=20_000)
    found = find_bias_change(*_on_the_surface(e, rows))
    if found is None or found.significance < 30:
        return None
    if found.shift < max(SHIFT_DOUBTFUL * e.radius, SHIFT_OVER_NOISE * found.noise):
        return None
    edges = np.append(rows, len(e.readings))[[found.start, found.stop]]
    return _change_finding(e, edges, found.shift)


def _on_the_surface(e: Evidence, rows: Index) -> tuple[Array, Array, Array]:
    """Residuals, normals, and the foot points relative to the centre, over the radius."""
    residuals, normals = e.residuals[rows], e.normals[rows]
    feet = e.readings[rows] - residuals[:, None] * normals
    return residuals, normals, (feet - e.bias) / e.radius


def _crowded_outliers(e: Evidence) -> Finding | None:
    """Outliers that come in one stretch: the fit holds for the rest of the log only."""
    outlier = e.weights == 0.0
    if not OUTLIERS_DOUBTFUL < outlier.mean() < 1.0:
        return None
    edges, crowding = _stretch(outlier)
    if crowding < 0.5:
        return None
    return _change_finding(e, edges, np.sqrt(3) * float(np.median(np.abs(e.residuals[outlier]))))


def _second_population(e: Evidence) -> Finding | None:
    """Two sensors in one log, or a field that changed: the readings lie on two spheres."""
    rows = _some(len(e.readings))
    pair = _pair(e, rows)
    if pair is None:
        return None
    second = pair.side[pair.side != 0] > 0
    share = float(second.mean())
    if (second[1:] != second[:-1]).mean() > share * (1 - share):  # half of what chance would give
        return Finding(
            "two sensors mixed",
            "refuse",
            f"{100 * min(share, 1 - share):.0f} % of the readings lie on a second sphere, row by "
            "row among the others: two sensors are mixed in one log",
            "separate them (a sensor column, --sensor) and calibrate each by itself",
        )
    edges, crowding = _stretch(second)
    if crowding < 0.3:
        return None
    return _change_finding(e, rows[pair.side != 0][edges], pair.shift * e.radius)


def _pair(e: Evidence, rows: Index) -> Pair | None:
    """Two spheres of radius about one through readings that one ellipsoid does not hold, or None.

    Sought among calibrated readings where the fit holds for most of them, otherwise among raw
    ones; accepted where the pair leaves much less than one full ellipsoid (noise alone makes the
    nearer of any two spheres 0.7 times as far as one, or more).
    """
    holds = e.noise < 0.03 * e.radius
    if holds and (e.weights == 0.0).mean() < 0.12:
        return None
    readings = (e.readings[rows] - e.bias) / e.radius
    pair = fit_two_spheres(readings @ e.shape.T if holds else readings)
    if pair is None:
        return None
    left = np.abs(refit_residuals(*_on_the_surface(e, rows))) / e.radius
    better = np.minimum(pair.distance, 0.2).mean() < 0.65 * np.minimum(left, 0.2).mean()
    return pair if better else None


def _stretch(member: Mask) -> tuple[Index, float]:
    """The two rows between which members crowd, and how much: 1 all in one stretch, 0 evenly.

    A crowd bends the running count of members less their share; evenly mixed ones do not.
    """
    share = float(member.mean())
    count = np.cumsum(member - share)
    crowding = float(np.ptp(count)) / (len(member) * max(share * (1 - share), 1e-12))
    return np.sort([np.argmin(count), np.argmax(count)]), crowding


def _change_finding(e: Evidence, edges: Index, shift: float) -> Finding:
    """The finding that the bias was another between two rows, or from one row on."""
    n = len(e.readings)
    inner = [int(row) for row in edges if 0.01 * n < row < 0.99 * n]
    if e.time is None:
        moments = [f"row {row}" for row in inner]
    else:
        moments = [f"t = {e.time[row] - e.time[0]:.1f} s" for row in inner]
    return Finding(
        "field changed",
        "refuse" if shift >= SHIFT_REFUSED * e.radius else "check",
        f"the bias moved by about {figure(shift)} {e.unit} ({100 * shift / e.radius:.0f} % of the "
        f"field) near {' and '.join(moments)}: something magnetic, or a "
        "current, was added or removed",
        "calibrate the stretches before and after separately, with everything in its final place",
    )


def check_coverage(c: Coverage) -> Finding | None:
    """A heading that the directions visited leave uncertain."""
    if c.heading_sd_deg < HEADING_DOUBTFUL_DEG:
        return None
    refused = c.heading_sd_deg >= HEADING_REFUSED_DEG
    return Finding(
        "coverage",
        "refuse" if refused else "check",
        f"the directions visited ({100 * c.filled:.0f} % of the sphere) leave the heading "
        f"uncertain by {figure(c.heading_sd_deg)}°",
        c.turns or f"{RECORD_LONGER}, turning slowly about all three axes",
    )


def _noisy(e: Evidence) -> Finding | None:
    if e.noise < NOISE_DOUBTFUL * e.radius:
        return None
    return Finding(
        "disturbed",
        "check",
        f"readings scatter by {100 * e.noise / e.radius:.1f} % of the field about the best "
        "calibration: the field was not the same everywhere",
        "record away from steel, magnets and currents, keeping the sensor in one place",
    )


def check_outliers(count: int, total: int) -> Finding | None:
    """Readings that the loss left out, so many of all.

    >>> check_outliers(3, 1000).sentence
    '3 readings (0.3 %) do not fit and were left out'
    """
    if not count:
        return None
    share = count / total
    doubtful = share > OUTLIERS_DOUBTFUL
    return Finding(
        "outliers",
        "check" if doubtful else "note",
        f"{count} readings ({figure(100 * share)} %) do not fit and were left out",
        "look for disturbances at those times" if doubtful else "",
    )


def check_bias_drift(shift: float, radius: float, when: str, unit: str) -> Finding:
    """A bias that is not the same throughout, by less than a change that spoils the fit.

    Parameters: `shift` of the bias from the part before `when` to the part after.

    >>> check_bias_drift(12.0, 50_000.0, "t = 3600 s", "nT").severity
    'note'
    """
    doubtful = shift >= SHIFT_DOUBTFUL * radius
    return Finding(
        "bias moves",
        "check" if doubtful else "note",
        f"the bias before and after {when} differs by {figure(shift)} {unit}, more than chance "
        "allows: it changed once, or drifts",
        "calibrate the parts separately, or follow it over time" if doubtful else "",
    )
