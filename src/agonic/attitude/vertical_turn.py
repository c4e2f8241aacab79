"""How a sensor calibrated by the magnitude alone sits beside roll and pitch, without a place.

The magnitude does not see how a sensor is turned in its vehicle. Its vertical part does: of a field
f in the sensor's axes and down d by roll and pitch, (f + δ × f)·d is the same in every row for the
turn δ alone. A turn about the vertical shifts all headings by one angle and is not judged.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.attitude.delay import undelayed
from agonic.attitude.fit import TURN_SIGNIFICANT
from agonic.attitude.latency import LatencyFit
from agonic.attitude.mounted_heading import MountedHeading, check_turned_sensor
from agonic.fit import Fit
from agonic.health import find_usable_rows
from agonic.maths.estimation.inference.wald import wald
from agonic.maths.estimation.leastsq import inverse
from agonic.maths.estimation.loss import tukey
from agonic.maths.estimation.noise.noise_with_memory import STRETCHES, Stretches, find_memory
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.one_pass import median
from agonic.maths.rotations.attitude import down_b
from agonic.new_rows import find_fresh
from agonic.samples import Samples

TURN_SD_DEG = 2.0
"""How far sensors are turned in their vehicles, before the log is asked."""
FEWEST = 200
"""Rows that can show it."""
EXPLAINED = 0.9
"""Of the scatter of the vertical part: what a turn leaves at most, a fifth of the variance being
its own. In a room the field leans from place to place, which a turn explains a little of."""
STEEPEST_DEG = 80.0
"""A dip beyond which no heading is stated."""
SURELY = 2.0
"""Standard errors that the size of a turn is lessened by before it counts."""
_BATCHES = 16  # the errors of attitudes, and of a room's field, last for seconds
_GEOMETRIES = slice(0, 1), slice(1, 4)
"""Slow errors are in the vertical part itself, or turn the attitude."""
_MOST = 4000
_LEAST_NOISE = 0.002  # of the field
_ITERATIONS = 12


class VerticalTurn(NamedTuple):
    """The turn δ (3,) in radians that makes the vertical part steady, `level_deg` the size of its
    part about x and y, `level_sd_deg` the standard error of that and `rms_deg` what is to be
    expected of it, found and unknown together, `p_value` the test of it, the dip that the log
    shows, degrees, and what is `left` of the scatter of the vertical part."""

    turn: Array
    level_deg: float
    level_sd_deg: float
    rms_deg: float
    p_value: float
    dip_deg: float
    left: float

    @property
    def surely_deg(self) -> float:
        """The turn about x and y that is there at least."""
        unclear = self.p_value >= TURN_SIGNIFICANT or self.left > EXPLAINED
        if unclear or abs(self.dip_deg) > STEEPEST_DEG:
            return 0.0
        return max(self.level_deg - SURELY * self.level_sd_deg, 0.0)


def tell_turn(fit: Fit, samples: Samples, latency: LatencyFit | None, move: str) -> Fit:
    """The fit with what a turn of the sensor in its vehicle adds to the error of the vehicle's
    heading, tan I · |δ| / √2 rms, and with a finding where roll and pitch show that there is one.

    Parameters: `move` says what would use roll and pitch.
    """
    named = {finding.name for finding in fit.findings}
    if samples.roll_deg is None or samples.pitch_deg is None or "axes" in named:
        return fit
    if fit.verdict == "refused" or (rows := _choose_rows(samples, latency)) is None:
        return fit
    found = find_vertical_turn(fit, rows)
    own = fit.coverage.heading_sd_deg
    by_degree = np.tan(np.radians(abs(fit.coverage.inclination_deg))) / np.sqrt(2)
    vehicle = float(np.hypot(own, by_degree * found.rms_deg))
    mounted = MountedHeading(own, vehicle, found.level_deg, turn_sd_deg=found.level_sd_deg)
    surely = by_degree * found.surely_deg > own
    told = check_turned_sensor(mounted, turned=True) if surely else None
    if fit.accuracy is not None:
        fit = replace(fit, accuracy=replace(fit.accuracy, vehicle_deg=vehicle))
    if told is None:
        return fit
    coverage = replace(fit.coverage, heading_sd_deg=vehicle)
    return replace(fit, coverage=coverage).with_findings(replace(told, move=move))


def find_vertical_turn(fit: Fit, samples: Samples) -> VerticalTurn:
    """The turn by least squares on f·d = c + δ·(d × f) − d·S ε, ε the errors of the calibration.

    ε has the covariance of the fit, at a known scale, for a field of no size has a steady vertical
    part as well. Errors of the attitude last, and look like a turn while they do.
    """
    rows, wanted = _equations(fit, samples)
    prior = np.ones(rows.shape[1])
    prior[:4] = [0.0, *np.full(3, np.radians(TURN_SD_DEG) ** -2)]
    noise, weights = max(float(wanted.std()), _LEAST_NOISE), np.ones(len(wanted))
    for _ in range(_ITERATIONS):
        weighed = rows * (weights / noise**2)[:, None]
        spread = inverse(weighed.T @ rows + np.diag(prior))
        found = spread @ (weighed.T @ wanted)
        left = wanted - rows @ found
        noise = max(MAD_TO_SD * median(np.abs(left)), _LEAST_NOISE)
        weights = tukey().weight((left / noise) ** 2)
    covariance = spread + spread @ _scatter(rows, left / noise, weights, noise, spread) @ spread
    unturned = np.r_[0, np.arange(4, len(prior))]
    plain, weighed = rows[:, unturned], weighed[:, unturned]
    without = np.linalg.solve(weighed.T @ plain + np.diag(prior[unturned]), weighed.T @ wanted)
    before = MAD_TO_SD * median(np.abs(wanted - plain @ without))
    level, known = found[1:3], covariance[1:3, 1:3]
    size = float(np.linalg.norm(level))
    return VerticalTurn(
        turn=found[1:4],
        level_deg=float(np.degrees(size)),
        level_sd_deg=float(np.degrees(np.sqrt(level @ known @ level) / max(size, 1e-12))),
        rms_deg=float(np.degrees(np.sqrt(level @ level + np.trace(known)))),
        p_value=wald(level, known, _BATCHES).p_value,
        dip_deg=float(np.degrees(np.arcsin(np.clip(found[0], -1.0, 1.0)))),
        left=noise / max(before, _LEAST_NOISE),
    )


def _scatter(rows: Array, z: Array, weights: Array, noise: float, spread: Array) -> Array:
    """How the gradient (m,) of the fit scatters, by residuals z (n,) over their noise: errors that
    last stand in the field or turn the attitude, and products of residuals show how long. Batches
    that outlast them show the same by themselves; what says more counts.
    """
    by = rows / noise
    along = np.column_stack([np.ones(len(z)), by[:, 1:4]])
    each = -(-len(z) // STRETCHES)
    memory = find_memory(Stretches.of(z, by, weights, along, each), spread, _GEOMETRIES)
    scores = (weights * z)[:, None] * by
    sums = np.stack([part.sum(axis=0) for part in np.array_split(scores, _BATCHES)])
    seen = [sums.T @ sums * _BATCHES / (_BATCHES - 1)]
    if memory is not None:
        seen.append(memory.scatter)
    return max(seen, key=lambda found: float(np.trace((spread @ found @ spread)[1:3, 1:3])))


def _choose_rows(samples: Samples, latency: LatencyFit | None) -> Samples | None:
    """Rows with a reading of their own at the moment of their attitude, evenly spaced."""
    own = np.flatnonzero(find_fresh(samples.field) & find_usable_rows(samples.field))
    if len(own) and latency is not None and latency.significant:
        samples = undelayed(samples.select(own), latency.latency_s)
        own = np.arange(len(samples))
    if len(own) < FEWEST:
        return None
    return samples.select(own[:: max(1, len(own) // _MOST)])


def _equations(fit: Fit, samples: Samples) -> tuple[Array, Array]:
    """The rows (n, 4 + m) of c, δ and the m errors of the calibration in their own scale, and the
    vertical part (n,) of the field, its size being 1."""
    calibration, roll, pitch = fit.calibration, samples.roll_deg, samples.pitch_deg
    assert calibration.magnitude is not None
    assert roll is not None
    assert pitch is not None
    down = down_b(roll, pitch)
    field = calibration.correct(samples.field) / calibration.magnitude
    moves = calibration.sensitivity(samples.field) / calibration.magnitude
    slopes = np.einsum("nij,ni->nj", moves, down) @ _root(_at_known_scale(fit))
    rows = np.column_stack([np.ones(len(down)), np.cross(down, field), slopes])
    return rows, np.einsum("ni,ni->n", field, down)


def _at_known_scale(fit: Fit) -> Array:
    """The covariance of bias and matrix where the mean gain, tr W⁻¹ δW / 3, is known."""
    size = len(fit.calibration.parameters)
    covariance = fit.covariance[:size, :size]
    gain = np.zeros(size)
    inverse = np.linalg.inv(fit.calibration.matrix)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1))
    symmetric = size == 9
    for k, (i, j) in enumerate(pairs[: size - 3]):
        gain[3 + k] = inverse[j, i] + (inverse[i, j] if symmetric and i != j else 0.0)
    moved = covariance @ gain
    variance = float(gain @ moved)
    return covariance - np.outer(moved, moved) / variance if variance > 0 else covariance


def _root(covariance: Array) -> Array:
    """A with A Aᵀ the covariance."""
    values, axes = np.linalg.eigh(covariance)
    return np.asarray(axes * np.sqrt(np.maximum(values, 0.0)))
