"""`PairFit`: the calibrations of an accelerometer and a magnetometer, what they rest on, and what
is wrong or worth knowing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup
from agonic.health import Finding, Judged, figure
from agonic.health.finding import Fact, Limit, Told
from agonic.inertial.maths.shots import BIAS_A, BIAS_M, DIP, MATRIX_M, SHAPE_A
from agonic.inertial.pair.problem import DIP_SD, Problem
from agonic.inertial.pair.solve import MOST_LEFT_OUT
from agonic.readable import Shown


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """The direction in the accelerometer's axes that was kept on targets, and how well it is known.
    `axis` (3,) of length one; `sd_deg` about the worst of the two axes across it; `scatter_deg` of
    single sightings, the calibration's own errors left out."""

    axis: Array
    sd_deg: float
    scatter_deg: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PairFit(Judged):
    """The result of `fit_pair`.

    Parameters
    ----------
    calibration : of the magnetometer, into body axes; accelerometer : of the accelerometer, into
        the same, m/s². Body axes have x along the sight; without one they are the accelerometer's.
    covariance : (24, 24) of the accelerometer's and then the magnetometer's `FREE_PARAMETERS`.
    rot_am : magnetometer components into the accelerometer's, (3, 3), soft iron apart.
    turn_sd_deg : (3,) of that turn about the accelerometer's axes.
    inclination_deg, inclination_sd_deg : of the field, down positive.
    free_inclination_deg, free_inclination_sd_deg : the same, without what is known of the place.
    sight : the direction kept on targets, or `None` without.
    noise : (2,) of one reading of the accelerometer, m/s², and of the magnetometer, in its unit.
    heading_sd_deg, slope_sd_deg : rms standard errors, from the calibrations, of the magnetic
        azimuth of the body's x axis and of its slope, over all attitudes in which it is within 60°
        of level.
    residuals : (n, 5) of the shots in units of their standard deviations: size of gravity, size of
        the field, dip, elevation and azimuth of the sight; NaN where there is none.
    shot : (n,) the number of each, from 1: of the station, or the row.
    target : (n,) the number of its target, 0 for none. left_out : indices of shots not used.
    prior_only : what the prior alone holds, in words. to_add : attitudes that would help most.
    """

    calibration: Affine
    accelerometer: Affine
    covariance: Annotated[Array, Shown()]
    rot_am: Array
    turn_sd_deg: Annotated[Array, Shown()]
    inclination_deg: Annotated[float, Shown()]
    inclination_sd_deg: Annotated[float, Shown()]
    free_inclination_deg: float
    free_inclination_sd_deg: float
    sight: Sight | None
    noise: Annotated[Array, Shown()]
    heading_sd_deg: Annotated[float, Shown()]
    slope_sd_deg: Annotated[float, Shown()]
    residuals: Array
    shot: Index
    target: Index
    left_out: Index
    prior_only: tuple[str, ...] = ()
    to_add: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """How many attitudes."""
        return len(self.shot)

    @property
    def turn_deg(self) -> Annotated[float, Shown()]:
        """By how much the two sensors are turned against each other."""
        return float(np.degrees(Rotation.from_matrix(self.rot_am).magnitude()))

    def make_setup(self, **settings: Any) -> Setup:
        """The setup of an instrument that reads its heading with both calibrations, at rest."""
        return Setup(
            compasses=(Compass(calibration=self.calibration),),
            accelerometer=self.accelerometer,
            **{"tilt": "accelerometer", "tilt_sd_deg": self._tilt_sd_deg(), **settings},
        )

    def _tilt_sd_deg(self) -> float:
        """Of one reading of the accelerometer; its calibration adds its own error."""
        share = float(self.noise[0] / abs(self.accelerometer.magnitude or np.nan))
        return float(np.degrees(share))


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


class Solved(NamedTuple):
    """A fit, the problem that it solves, and whether more shots than may be left out disagree."""

    fit: PairFit
    problem: Problem
    disagreeing: bool


def _name_contradicting(solved: Solved) -> Told:
    fit = solved.fit
    names = ", ".join(str(fit.shot[i]) for i in fit.left_out)
    return {"names": names} if solved.disagreeing and len(fit.left_out) else None


def _name_left_out(solved: Solved) -> Told:
    fit, count = solved.fit, len(solved.fit.left_out)
    if solved.disagreeing or not count:
        return None
    names = ", ".join(str(fit.shot[i]) for i in fit.left_out)
    which, were = (f"shot {names} does", "was") if count == 1 else (f"shots {names} do", "were")
    return {"value": count / fit.n, "which": which, "were": were}


def _measure_field(solved: Solved) -> Told:
    calibration = solved.fit.calibration
    gain = float(np.cbrt(abs(np.linalg.det(calibration.matrix))))
    return 100 * float(solved.fit.noise[1]) * gain / float(calibration.magnitude or np.nan)


def _measure_gravity(solved: Solved) -> Told:
    return 100 * float(solved.fit.noise[0] / (solved.fit.accelerometer.magnitude or np.nan))


def _measure_heading(solved: Solved) -> Told:
    fit = solved.fit
    add = "; ".join(fit.to_add[:4])
    return {"value": fit.heading_sd_deg, "n": fit.n, "add": f"add shots: {add}"}


def _knows_dip(solved: Solved) -> bool:
    return bool(solved.problem.prior.information[DIP, DIP] > 0)


def _measure_dip(solved: Solved) -> Told:
    fit = solved.fit
    expected = float(np.degrees(solved.problem.prior.mean[DIP]))
    off = abs(fit.free_inclination_deg - expected)
    sure = off > 4 * float(np.hypot(fit.free_inclination_sd_deg, np.degrees(DIP_SD)))
    if not _knows_dip(solved) or not sure:
        return None
    return {"value": off, "dip": fit.free_inclination_deg, "expected": expected}


FACTS = (
    Fact(
        "shots disagree",
        _name_contradicting,
        "refuse",
        "more than a quarter of the shots contradict the others, {names} first",
        "look for iron, a phone or a lamp near it, and for shots that were not at rest",
    ),
    Fact(
        "shot left out",
        _name_left_out,
        Limit(note=0.0, check=MOST_LEFT_OUT / 2),
        "{which} not fit the others and {were} left out",
        "repeat it: it was not at rest, off its target, or near iron",
    ),
    Fact(
        "not at rest",
        _measure_gravity,
        Limit(2.0, 6.0),
        "gravity scatters by {value} % from shot to shot",
        "put it down or lean it against something for each shot",
    ),
    Fact(
        "field varies",
        _measure_field,
        Limit(2.0, 6.0),
        "the field scatters by {value} % from shot to shot",
        "turn the instrument about one spot away from iron, with nothing magnetic on you",
    ),
    Fact(
        "target missed",
        lambda solved: (
            {"names": ", ".join(f"{name:g}" for name in missed)}
            if (missed := solved.problem.missed)
            else None
        ),
        "check",
        "the sight was not kept on target {names}: so the target was ignored",
        "roll the instrument about its sight, on the target all the time; 0 is a shot at no target",
    ),
    Fact(
        "sight not kept",
        lambda solved: solved.fit.sight and solved.fit.sight.scatter_deg,
        Limit(1.0, 5.0),
        "on one target the sight scatters by {value}°",
        "keep it on the target through the whole roll, from a fixed spot and a few metres off; a "
        "shot at no target has the number 0",
    ),
    Fact(
        "attitudes missing",
        _measure_heading,
        Limit(0.5, 2.0),
        "{n} shots leave the heading uncertain by {value}°",
        "{add}",
    ),
    Fact(
        "gravity reversed",
        lambda solved: {} if _knows_dip(solved) and solved.problem.scale.gravity < 0 else None,
        "note",
        "the log has gravity itself, down, where specific force was expected: sign changed",
    ),
    Fact(
        "dip",
        _measure_dip,
        Limit(0.0, 15.0),
        "the field dips by {dip:.1f}° and {expected:.1f}° is expected here",
        "check the place, and look for iron: under a roof or in a car the dip differs",
    ),
    Fact(
        "field points up",
        lambda solved: None if _knows_dip(solved) else -solved.fit.inclination_deg,
        Limit(0.0),
        "the field points up by {value:.1f}°: right in the southern hemisphere; elsewhere the log "
        "has gravity itself where the specific force belongs, and headings turn the wrong way",
        "say where it was recorded (--at LAT,LON): then the sign is found and corrected",
    ),
)


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
    """The combinations of unknowns of which the prior tells more than the shots, in words. The
    share of the prior in what is known is an eigenvalue of LᵀCL, W = LLᵀ its information."""
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
