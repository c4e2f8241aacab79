"""What a fit gives away about the readings: plane, cap, strays, two sensors, a magnet half-way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agonic.coverage import Coverage
from agonic.health.finding import Finding
from agonic.kernels.changes import Break, find_break
from agonic.kernels.consensus import least_median_sphere
from agonic.kernels.coverage import nearest_axis, thickness

Array = NDArray[np.float64]

HEADING_REFUSED_DEG = 5.0
HEADING_DOUBTFUL_DEG = 2.0
NOISE_DOUBTFUL = 0.04  # of the field's magnitude
STRAYS_DOUBTFUL = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What a magnitude fit leaves to be examined, all in the unit of the readings.

    `readings` (n, 3), `time` (n,) or None, `residuals` (n,), `weights` (n,), `normals` (n, 3) the
    unit directions in which a residual is measured, `radius` of the readings' ellipsoid, `noise`.
    """

    readings: Array
    time: Array | None
    residuals: Array
    weights: Array
    normals: Array
    radius: float
    noise: float
    correlation: float
    coverage: Coverage
    known_radius: float | None = None


def examine(evidence: Evidence) -> tuple[Finding, ...]:
    """The findings of a fit, the gravest first; one cause is not reported twice."""
    shape = _static(evidence) or _flat(evidence)
    if shape is not None:
        return (shape,)
    mixture = _second_population(evidence) or _changed(evidence)
    if mixture is not None:
        return (mixture,)
    found = (undetermined(evidence.coverage), _noisy(evidence), _strays(evidence))
    return tuple(finding for finding in found if finding is not None)


def _static(e: Evidence) -> Finding | None:
    """Readings that hardly move: a ball of noise, or far less than the field would move them."""
    low, high = np.percentile(e.readings, (2, 98), axis=0)
    spread = float((high - low).max() / 2)
    ball = e.noise > 0.2 * e.radius
    small = spread < 0.1 * (e.known_radius or e.radius)
    if not (ball or small):
        return None
    return Finding(
        "static",
        "refuse",
        f"the sensor did not turn: its readings move by only ±{spread:.3g} and look like noise",
        "turn it slowly about all three axes while recording",
    )


def _flat(e: Evidence) -> Finding | None:
    """Readings in a plane, or nearly: the centre along its normal is not determined."""
    thick, normal = thickness(e.readings[e.weights > 0])
    if thick > 0.1:
        return None
    axis = nearest_axis(normal)
    noise_thickness = 2.4 * e.noise / e.radius
    if thick < max(0.02, 1.5 * noise_thickness):
        what = f"all readings lie in one plane (its normal is near {axis})"
    else:
        tilt = np.degrees(np.arcsin(min(thick, 1.0)))
        what = f"all readings lie near one plane (normal near {axis}, tilt about {tilt:.0f}° only)"
    return Finding(
        "plane" if "in one plane" in what else "small tilt",
        "refuse",
        f"{what}: bias and gain along {axis} are not determined",
        "tilt the nose up and down and bank by 30° or more at several headings",
    )


def _second_population(e: Evidence) -> Finding | None:
    """Two sensors in one log, or a field that changed for good: the strays fit a sphere too."""
    stray = e.weights == 0.0
    if stray.mean() < 0.12 or stray.sum() < 30:
        return None
    points = e.readings[stray] / e.radius
    centre = points.mean(axis=0)
    bias, gain = least_median_sphere(points - centre, np.ones(1))
    away = np.abs(np.linalg.norm(points - centre - bias, axis=1) - 1 / gain)
    if float(np.median(away)) > 0.06 or not 0.4 < 1 / gain < 2.5:
        return None
    shift = float(np.linalg.norm((centre + bias) * e.radius - _centre(e, ~stray)))
    changes = int(np.count_nonzero(np.diff(_smoothed(stray))))
    if changes > 0.02 * min(stray.sum(), (~stray).sum()) + 8:
        return Finding(
            "two sensors mixed",
            "refuse",
            f"{100 * stray.mean():.0f} % of the readings lie on a second sphere, row by row among "
            "the others: two sensors are mixed in one log",
            "separate them (a sensor column, --sensor) and calibrate each by itself",
        )
    edge = int(np.flatnonzero(np.diff(_smoothed(stray)))[0])
    return _change_finding(e, edge, shift)


def _smoothed(stray: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Majority of each 9 neighbouring rows, so that single strays do not count as changes."""
    return np.asarray(np.convolve(stray, np.ones(9), mode="same") > 4.5)


def _centre(e: Evidence, rows: NDArray[np.bool_]) -> Array:
    """Centre of the ellipsoid as the believed rows and their residuals place it."""
    surface = e.readings[rows] - e.residuals[rows, None] * e.normals[rows]
    return np.asarray((surface - e.radius * e.normals[rows]).mean(axis=0))


def _changed(e: Evidence) -> Finding | None:
    """A bias that moved once during the log by more than the noise allows."""
    found: Break | None = find_break(e.residuals, e.normals)
    if found is None or found.explained < 0.35 or found.significance < 30 * e.correlation:
        return None
    if found.shift < 0.015 * e.radius:
        return None
    return _change_finding(e, found.row, found.shift)


def _change_finding(e: Evidence, row: int, shift: float) -> Finding:
    when = f"row {row}" if e.time is None else f"t = {e.time[row] - e.time[0]:.1f} s"
    return Finding(
        "field changed",
        "refuse",
        f"the bias moved by about {shift:.3g} ({100 * shift / e.radius:.0f} % of the field) near "
        f"{when}: a magnet or iron came or went",
        "calibrate the stretches before and after separately, with everything in its final place",
    )


def undetermined(c: Coverage) -> Finding | None:
    """A heading that the directions visited leave uncertain."""
    if c.heading_sd_deg < HEADING_DOUBTFUL_DEG:
        return None
    refused = c.heading_sd_deg >= HEADING_REFUSED_DEG
    return Finding(
        "coverage",
        "refuse" if refused else "check",
        f"the directions visited ({100 * c.filled:.0f} % of the sphere) leave the heading "
        f"uncertain by {c.heading_sd_deg:.2g}°",
        c.turns or "record longer, turning slowly about all three axes",
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


def _strays(e: Evidence) -> Finding | None:
    stray = e.weights == 0.0
    if not stray.any():
        return None
    share = float(stray.mean())
    doubtful = share > STRAYS_DOUBTFUL
    return Finding(
        "outliers",
        "check" if doubtful else "note",
        f"{int(stray.sum())} readings ({100 * share:.2g} %) do not fit and were left out",
        "look for disturbances at those times" if doubtful else "",
    )
