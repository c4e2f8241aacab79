"""What a fit gives away about the readings: plane, cap, strays, two sensors, a magnet half-way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agonic.coverage import Coverage
from agonic.health.finding import Finding
from agonic.kernels.changes import Break, find_break
from agonic.kernels.consensus import two_spheres
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
    mixture = _changed(evidence) or _second_population(evidence)
    if mixture is not None:
        return (mixture,)
    found = (undetermined(evidence.coverage), _noisy(evidence), _strays(evidence))
    return tuple(finding for finding in found if finding is not None)


def _static(e: Evidence) -> Finding | None:
    """Readings that hardly move: far less than the field would move them, or a ball of noise."""
    low, high = np.percentile(_some(e.readings), (2, 98), axis=0)
    spread = float((high - low).max() / 2)
    small = spread < 0.1 * (e.known_radius or e.radius)
    if not (small or (e.noise > 0.15 * e.radius and _gaussian(_some(e.readings)))):
        return None
    return Finding(
        "static",
        "refuse",
        f"the sensor did not turn: its readings move by only ±{spread:.3g} and look like noise",
        "turn it slowly about all three axes while recording",
    )


def _some(rows: Array) -> Array:
    """At most some twenty thousand rows, evenly taken: enough for a percentile."""
    return rows[:: max(1, len(rows) // 20_000)]


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
    thick, normal = thickness(_some(e.readings[e.weights > 0]))
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
    """Two sensors in one log, or a field that changed: the readings lie on two spheres."""
    if e.noise < 0.03 * e.radius and (e.weights == 0.0).mean() < 0.12:
        return None
    rows = np.arange(0, len(e.readings), max(1, len(e.readings) // 20_000))
    middle = np.median(e.readings[rows], axis=0)
    found = two_spheres((e.readings[rows] - middle) / e.radius)
    if found is None:
        return None
    second, shift = found
    # a population that comes or goes bends the running count; one mixed in row by row does not
    count = np.cumsum(second - second.mean())
    if np.ptp(count) < max(0.03 * len(count), np.sqrt(len(count))):
        share = 100 * min(second.mean(), 1 - second.mean())
        return Finding(
            "two sensors mixed",
            "refuse",
            f"{share:.0f} % of the readings lie on a second sphere, row by row among the others: "
            "two sensors are mixed in one log",
            "separate them (a sensor column, --sensor) and calibrate each by itself",
        )
    edge = min(int(np.argmax(count)), int(np.argmin(count)))
    edge = edge if edge > 0.02 * len(count) else max(int(np.argmax(count)), int(np.argmin(count)))
    return _change_finding(e, int(rows[edge]), shift * e.radius)


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
