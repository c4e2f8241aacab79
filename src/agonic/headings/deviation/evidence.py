"""What a swing leaves to be examined: headings that are missing, outliers, what the curve omits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtrc, fdtrc, stdtr

from agonic.arrays import Array, Mask
from agonic.calibration.deviation import Deviation, name_heading
from agonic.headings.deviation.readings import SwingReadings
from agonic.headings.maths import swing_plan
from agonic.health import Finding, Limit, figure, sort_findings
from agonic.maths.estimation.noise.residuals import correlation_length
from agonic.maths.rotations import deviation as kernel

LIMITS = {
    "amplified": Limit(3.0, 10.0),  # standard error over that of as many headings evenly spread
    "gap": Limit(120.0, 179.9),  # °; from half a circle on the headings lie in one half
    "uncertain": Limit(2.0, 10.0),  # °, standard error of the curve, rms over all headings
    "heel": Limit(1.0),  # °, rms of heel that no other term explains
    "scatter": Limit(5.0),  # °
    "outlier": Limit(0.5, 5.0),  # °; where too few others outweigh it
    "outliers": Limit(0.1),  # of the readings
    "third harmonic": Limit(1.0),  # °
    "drift": Limit(0.5),  # ° from the first reading to the last
    "drifting": Limit(0.8),  # probability: fewer than one in a hundred swings without drift
    "deviation": Limit(0.5),  # °, rms: sights by hand do not tell less from none
}
CHANCES = {"outlier": 0.003, "third harmonic": 0.01, "drift": 0.001, "no deviation": 0.05}
"""How often chance may do as much as is found."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """The readings, the solution, and the card made of it.

    `chosen` (9,) marks the terms that were fitted; `weighted` says whether the robust loss was free
    to leave out outliers, `drifting` how likely the reference drifted, `estimated` that the
    reference follows a compass.
    """

    readings: SwingReadings
    solved: kernel.DeviationSolution
    card: Deviation
    chosen: Mask
    stated_noise_deg: float | None
    weighted: bool
    drifting: float
    estimated: bool

    @cached_property
    def rows(self) -> Array:
        """The columns of the terms that were fitted, (n, k)."""
        return self.readings.rows[:, self.chosen]


def examine(evidence: Evidence) -> tuple[Finding, ...]:
    """The findings, the gravest first; one cause is not reported twice."""
    shape = _headings(evidence) or _heel(evidence)
    if shape is not None and shape.severity == "refuse":
        return (shape,)
    outlier = _outlier(evidence)
    spread = (_uncertain(evidence), _scatter(evidence))
    if outlier is not None and not evidence.weighted:  # it is the cause of both
        spread = (None, None)
    others = [_drift(evidence), _third(evidence), _find_dependence(evidence)]
    if evidence.card.least_turn <= 0:  # it changes faster than the heading
        others.append(
            Finding(
                "folded",
                "refuse",
                "the compass turns back while the vehicle turns on, so one reading stands for "
                "several headings",
                "move the compass away from iron and magnets, or calibrate the magnetometer first",
            )
        )
    if evidence.readings.left_out:
        others.append(
            Finding(
                "incomplete readings",
                "note",
                f"{evidence.readings.left_out} readings lack a number and were left out",
            )
        )
    return sort_findings((shape, outlier, *spread, *others))


def list_headings(headings_deg: Array) -> str:
    """Headings in words."""
    names = [name_heading(float(h)) for h in headings_deg]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _headings(evidence: Evidence) -> Finding | None:
    """Headings that do not go round, or too few of them."""
    headings, level = swing_plan.find_visited(evidence.readings.compass), evidence.chosen[:5]
    n, terms = len(headings), evidence.card.terms
    gap = swing_plan.compute_largest_gap_deg(headings)
    amplified = swing_plan.compute_amplification(headings, level)
    spread = LIMITS["amplified"].grade(amplified)
    missing = swing_plan.find_missing_deg(headings, level, 2.0)
    move = (
        f"steer also {list_headings(missing)}" if len(missing) else "steer twice as many headings"
    )
    seen = f"what was steered ({n} heading{'' if n == 1 else 's'}, widest gap {gap:.0f}°)"
    named = "A to E" if terms == "ABCDE" else ", ".join(terms)
    if "refuse" in (LIMITS["gap"].grade(gap if terms != "A" else 0.0), spread):
        return Finding("headings", "refuse", f"{seen} does not determine {named}", move)
    readings, k = evidence.rows.shape
    if (n <= len(terms) or readings <= k) and evidence.stated_noise_deg is None:
        return Finding(
            "headings",
            "refuse",
            f"{readings} readings on {n} headings for {k} terms leave none to check the card",
            f"{move}, or state the noise of one reading",
        )
    if spread or LIMITS["gap"].grade(gap):
        return Finding("headings", "check", f"{seen} hardly determines {named}", move)
    return None


def _heel(evidence: Evidence) -> Finding | None:
    """Heel that is too small, or goes with the heading so that a level term explains it."""
    rows, own = evidence.rows, int(evidence.chosen[:5].sum())
    for k, name in enumerate(np.array(kernel.HEEL)[evidence.chosen[5:]], start=own):
        others = np.delete(rows, k, axis=1)
        left = rows[:, k] - others @ np.linalg.lstsq(others, rows[:, k], rcond=None)[0]
        rms = float(np.sqrt(np.mean(left**2)))
        if not LIMITS["heel"].grade(rms):
            way = name.split("_")[0]
            both = "to port and to starboard" if way == "roll" else "nose up and nose down"
            return Finding(
                "heel",
                "refuse",
                f"the swing does not determine what {way} does: only {rms:.1f}° of it is "
                "independent of the heading",
                f"on each heading tilt the vehicle {both}, 5° or more, or leave {way} out",
            )
    return None


def _uncertain(evidence: Evidence) -> Finding | None:
    """A curve whose standard error is large, whatever the reason."""
    sd = float(np.sqrt(np.mean(evidence.card.sd_at(swing_plan.CIRCLE_DEG) ** 2)))
    severity = LIMITS["uncertain"].grade(sd)
    if severity is None:
        return None
    length = evidence.solved.correlation
    slow = f"; errors are correlated over {figure(length)} readings in a row" if length > 2 else ""
    return Finding(
        "uncertain",
        severity,
        f"the standard error of the curve is {figure(sd)}°{slow}",
        "stay longer on headings all round, or swing again in calmer conditions",
    )


def _outlier(evidence: Evidence) -> Finding | None:
    """Readings far from the curve of the others."""
    if evidence.weighted:
        share = float(np.mean(evidence.solved.weights == 0))
        if share == 0.0:
            return None
        return Finding(
            "outlying headings",
            "check" if LIMITS["outliers"].grade(share) else "note",
            f"{figure(100 * share)} % of the readings are outliers and were left out",
            "look for moments when the vehicle turned or a current was switched",
        )
    # externally studentised residuals against Student's t, with Bonferroni's bound for the largest
    rows, e = evidence.rows, evidence.solved.residuals
    n, k = rows.shape
    if n - k < 2:
        return None
    free = np.maximum(1 - np.einsum("ij,jk,ik->i", rows, np.linalg.pinv(rows.T @ rows), rows), 1e-9)
    rest = np.maximum(e @ e - e**2 / free, 1e-12) / (n - k - 1)
    rest = np.maximum(rest, evidence.readings.rounding_deg**2)  # readings that were rounded alike
    t = np.abs(e) / np.sqrt(rest * free)
    worst = int(t.argmax())
    off = float(abs(e[worst]) / free[worst])
    chance = 2 * n * float(stdtr(n - k - 1, -t[worst]))
    severity = LIMITS["outlier"].grade(off)
    if chance >= CHANCES["outlier"] or severity is None:
        return None
    return Finding(
        "outlying headings",
        severity,
        f"the reading at compass {name_heading(float(evidence.readings.compass[worst]))} is "
        f"{figure(off)}° from the curve of the others",
        "look for a mistake (east for west, a wrong digit) and steer that heading again",
    )


def _scatter(evidence: Evidence) -> Finding | None:
    """Residuals that are large, or larger than the stated noise."""
    noise, stated = evidence.solved.noise, evidence.stated_noise_deg
    exceeded = stated is not None and evidence.card.freedom is not None
    if not exceeded and not LIMITS["scatter"].grade(noise):
        return None
    beyond = f", more than the {figure(stated)}° that were stated" if stated and exceeded else ""
    return Finding(
        "scatter",
        "check",
        f"readings scatter by {figure(noise)}° about the curve{beyond}",
        "hold each heading until the compass is at rest, away from other iron",
    )


def _fit_more_columns(evidence: Evidence, *columns: Array) -> tuple[Array, Array]:
    """What further columns (n,) explain of the residuals beside the terms, and its covariance."""
    w = evidence.solved.weights if evidence.weighted else np.ones(len(evidence.rows))
    rows = np.column_stack([evidence.rows, *columns])
    inverse = np.linalg.pinv((rows * w[:, None]).T @ rows)
    found = inverse @ (rows * w[:, None]).T @ evidence.solved.residuals
    left = evidence.solved.residuals - rows @ found  # its noise is not that with the pattern in it
    variance = float(w @ left**2) / max(float(w.sum()) - rows.shape[1], 1.0)
    k = len(columns)
    return found[-k:], inverse[-k:, -k:] * variance * correlation_length(left, w)


def _drift(evidence: Evidence) -> Finding | None:
    """A steady change in the order of the readings: the residuals' slope against Student's t."""
    n, k = evidence.rows.shape
    used = int((evidence.solved.weights > 0).sum()) if evidence.weighted else n
    if used - k < 3:
        return None
    found, covariance = _fit_more_columns(evidence, np.linspace(-0.5, 0.5, n))
    size = abs(float(found[0]))
    t = size / np.sqrt(max(float(covariance[0, 0]), 1e-24))
    if LIMITS["drift"].grade(size) and 2 * stdtr(used - k - 1, -t) <= CHANCES["drift"]:
        what = f"the deviation changes by {figure(size)}° from the first reading to the last"
    elif LIMITS["drifting"].grade(evidence.drifting):
        what = "the readings drift in the order they were taken"
    else:
        return None
    return Finding(
        "drift",
        "check",
        f"{what}, beside what the heading explains",
        "steer the first heading again: if it reads otherwise the reference drifts; let it settle, "
        "or swing once more the other way round",
    )


def _third(evidence: Evidence) -> Finding | None:
    """A third harmonic in the residuals of many readings: more than A to E can hold."""
    if not evidence.weighted or "D" not in evidence.card.terms:
        return None
    psi = np.radians(evidence.readings.compass)
    found, covariance = _fit_more_columns(evidence, np.sin(3 * psi), np.cos(3 * psi))
    chance = float(chdtrc(2, found @ np.linalg.pinv(covariance) @ found))
    size = float(np.hypot(*found))
    if not LIMITS["third harmonic"].grade(size) or chance > CHANCES["third harmonic"]:
        return None
    return Finding(
        "third harmonic",
        "check",
        f"a part of {figure(size)}° that changes three times round the circle remains",
        "the deviation is too large for A to E: compensate the compass, or calibrate the "
        "magnetometer, and swing again",
    )


def _find_dependence(evidence: Evidence) -> Finding | None:
    """Whether the reference is no other than the compass: no deviation, where there is one."""
    rows, solved = evidence.rows, evidence.solved
    fitted, left = rows @ solved.params, solved.residuals[solved.weights > 0]
    k, freedom = rows.shape[1], len(left) - rows.shape[1]
    rms = float(np.sqrt(np.mean(fitted**2)))
    # whether all terms together are what noise makes of none, by F
    noise = max(float(left @ left) / max(freedom, 1) * solved.correlation, 1e-24)
    chance = float(fdtrc(k, freedom, fitted @ fitted / (k * noise))) if freedom > 0 else 0.0
    if evidence.estimated:
        what = "the reference is an estimate that follows a compass itself"
    elif k == 1:
        return None
    elif float(np.ptp(evidence.readings.difference)) <= 1e-6:
        what = "compass and reference differ by the same on every heading, to the last digit"
    elif not LIMITS["deviation"].grade(rms) and chance > CHANCES["no deviation"]:
        what = f"compass and reference differ by no more than noise, {figure(rms)}° rms"
    else:
        return None
    return Finding(
        "readings alike",
        "check",
        f"{what}; where one is derived from the other the card means nothing",
        "take the reference from something that does not depend on magnetism: a surveyed line, "
        "two antennas, the sun",
    )
