"""What two calibrations by shots rest on, and what is wrong or worth knowing."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.health import Finding, figure
from agonic.inertial.maths.shots import BIAS_A, BIAS_M, DIP, MATRIX_M, SHAPE_A
from agonic.inertial.pair.problem import DIP_SD, Problem
from agonic.inertial.pair.result import PairFit
from agonic.inertial.pair.solve import MOST_LEFT_OUT

OPEN_DEG, LOOSE_DEG = 2.0, 0.5
"""Standard errors of the heading above which it is not determined, and is worth a word."""
SHAKY, MOVING = 0.02, 0.06
"""Share of gravity, and of the field, that shots may scatter by: to look at, and too much."""
UNSTEADY_DEG, ASTRAY_DEG = 1.0, 5.0
"""Scatter of the sight on a target: to look at, and no target at all."""
MOSTLY = 0.5
"""A combination is held by the prior where that tells more of it than the shots."""
_CLEAR = 0.45
_AXES, _PAIRS = "xyz", ("xx", "yy", "zz", "xy", "xz", "yz")
_NAMES = (
    *(f"accelerometer bias {a}" for a in _AXES),
    *(f"accelerometer {'scale' if p[0] == p[1] else 'cross term'} {p}" for p in _PAIRS),
    *(f"magnetometer bias {a}" for a in _AXES),
    *(f"magnetometer matrix {a}{b}" for a in _AXES for b in _AXES),
)


def examine(fit: PairFit, problem: Problem, disagreeing: bool) -> tuple[Finding, ...]:
    """The findings of a fit: shots, scatter, what is open, what the dip says."""
    checks = (
        _check_left_out(fit, disagreeing),
        _scatter(fit),
        _varies(fit),
        _check_missed(problem),
        _off_target(fit),
        _open(fit),
        *_signs(fit, problem),
    )
    return tuple(found for found in checks if found is not None)


def describe(fit: PairFit) -> tuple[str, ...]:
    """How good it is, in sentences."""
    what = "the sight's azimuth" if fit.sight is not None else "the heading"
    said = [
        f"standard error: {what} {figure(fit.heading_sd_deg)}°, its slope "
        f"{figure(fit.slope_sd_deg)}°, in all directions within 60° of level",
        f"the field dips by {fit.inclination_deg:.2f}° ± {figure(fit.inclination_sd_deg)}°",
    ]
    if fit.sight is not None:
        targets = len(np.unique(fit.target[fit.target > 0]))
        scatter = figure(fit.sight.scatter_deg)
        said.append(f"single sightings scatter by {scatter}° on {targets} targets")
    return tuple(said)


def find_prior_only(problem: Problem, covariance: Array) -> tuple[str, ...]:
    """The combinations of unknowns of which the prior tells more than the shots, in words.

    The share of the prior in what is known is an eigenvalue of LᵀCL, W = LLᵀ its information.
    """
    known = np.r_[BIAS_A, SHAPE_A, BIAS_M, MATRIX_M]
    root = np.linalg.cholesky(problem.prior.information[np.ix_(known, known)])
    shares, vectors = np.linalg.eigh(root.T @ covariance[np.ix_(known, known)] @ root)
    said = []
    for share, vector in sorted(zip(shares, vectors.T, strict=True), key=lambda one: -one[0]):
        if share > MOSTLY:
            large = np.flatnonzero(np.abs(vector) > _CLEAR * np.abs(vector).max())
            named = ", ".join(
                _NAMES[known[i]] for i in large[np.argsort(-np.abs(vector[large]))][:3]
            )
            said.append(f"{named}: {100 * min(share, 1.0):.0f} %")
    return tuple(said)


def _check_left_out(fit: PairFit, disagreeing: bool) -> Finding | None:
    if not len(fit.left_out):
        return None
    names = ", ".join(str(fit.shot[i]) for i in fit.left_out)
    many = len(fit.left_out) > MOST_LEFT_OUT / 2 * fit.n
    which = f"shot {names} does" if len(fit.left_out) == 1 else f"shots {names} do"
    if disagreeing:
        what = f"more than a quarter of the shots contradict the others, {names} first"
        move = "look for iron, a phone or a lamp near it, and for shots that were not at rest"
        return Finding("shots disagree", "refuse", what, move)
    return Finding(
        "shot left out",
        "check" if many else "note",
        f"{which} not fit the others and {'was' if len(fit.left_out) == 1 else 'were'} left out",
        "repeat it: it was not at rest, off its target, or near iron",
    )


def _scatter(fit: PairFit) -> Finding | None:
    share = float(fit.noise[0] / (fit.accelerometer.magnitude or np.nan))
    if share < SHAKY:
        return None
    return Finding(
        "not at rest",
        "refuse" if share > MOVING else "check",
        f"gravity scatters by {figure(100 * share)} % from shot to shot",
        "put it down or lean it against something for each shot",
    )


def _varies(fit: PairFit) -> Finding | None:
    share = float(fit.noise[1] / _size(fit))
    if share < SHAKY:
        return None
    return Finding(
        "field varies",
        "refuse" if share > MOVING else "check",
        f"the field scatters by {figure(100 * share)} % from shot to shot",
        "turn the instrument about one spot away from iron, with nothing magnetic on you",
    )


def _size(fit: PairFit) -> float:
    """The field, in the unit of the readings."""
    gain = float(np.cbrt(abs(np.linalg.det(fit.calibration.matrix))))
    return float(fit.calibration.magnitude or np.nan) / gain


def _check_missed(problem: Problem) -> Finding | None:
    if not problem.missed:
        return None
    names = ", ".join(f"{name:g}" for name in problem.missed)
    return Finding(
        "target missed",
        "check",
        f"the sight was not kept on target {names}: so the target was ignored",
        "roll the instrument about its sight, on the target all the time; 0 is a shot at no target",
    )


def _off_target(fit: PairFit) -> Finding | None:
    if fit.sight is None or fit.sight.scatter_deg < UNSTEADY_DEG:
        return None
    wrong = fit.sight.scatter_deg > ASTRAY_DEG
    return Finding(
        "sight not kept",
        "refuse" if wrong else "check",
        f"on one target the sight scatters by {figure(fit.sight.scatter_deg)}°",
        "keep it on the target through the whole roll, from a fixed spot and a few metres off; a "
        "shot at no target has the number 0",
    )


def _open(fit: PairFit) -> Finding | None:
    if not fit.heading_sd_deg > LOOSE_DEG:
        return None
    add = "; ".join(fit.to_add[:4])
    if fit.heading_sd_deg > OPEN_DEG:
        what = f"{fit.n} shots leave the heading uncertain by {figure(fit.heading_sd_deg)}°"
        return Finding("attitudes missing", "refuse", what, f"add shots: {add}")
    what = f"the standard error of the heading is {figure(fit.heading_sd_deg)}°"
    return Finding("heading loose", "check", what, f"add shots: {add}")


def _signs(fit: PairFit, problem: Problem) -> list[Finding | None]:
    """What the dip says of the signs of the axes."""
    known = problem.prior.information[DIP, DIP] > 0
    if not known:
        return [_unknown_side(fit)]
    expected = float(np.degrees(problem.prior.mean[DIP]))
    off = fit.free_inclination_deg - expected
    found: list[Finding | None] = []
    if problem.scale.gravity < 0:
        what = "the log has gravity itself, down, where specific force was expected: sign changed"
        found.append(Finding("gravity reversed", "note", what))
    sd = float(np.hypot(fit.free_inclination_sd_deg, np.degrees(DIP_SD)))
    if abs(off) > 4 * sd:
        dip = f"{fit.free_inclination_deg:.1f}°"
        what = f"the field dips by {dip} and {expected:.1f}° is expected here"
        move = "check the place, and look for iron: under a roof or in a car the dip differs"
        found.append(Finding("dip", "refuse" if abs(off) > 15 else "check", what, move))
    return found


def _unknown_side(fit: PairFit) -> Finding | None:
    if fit.inclination_deg > 0:
        return None
    return Finding(
        "field points up",
        "check",
        f"the field points up by {-fit.inclination_deg:.1f}°: right in the southern hemisphere; "
        "elsewhere the log has gravity itself where the specific force belongs, and headings turn "
        "the wrong way",
        "say where it was recorded (--at LAT,LON): then the sign is found and corrected",
    )
