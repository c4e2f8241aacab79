"""`PairFit`: the calibrations of an accelerometer and a magnetometer, what they rest on, and what
is wrong or worth knowing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup
from agonic.health import Finding, Judged, figure
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


def examine(fit: PairFit, problem: Problem, disagreeing: bool) -> Iterator[Finding]:
    """The findings of a fit: shots, scatter, what is open, what the dip says."""
    if len(fit.left_out):
        names = ", ".join(str(fit.shot[i]) for i in fit.left_out)
        one, many = len(fit.left_out) == 1, len(fit.left_out) > MOST_LEFT_OUT / 2 * fit.n
        which = f"shot {names} does" if one else f"shots {names} do"
        if disagreeing:
            what = f"more than a quarter of the shots contradict the others, {names} first"
            move = "look for iron, a phone or a lamp near it, and for shots that were not at rest"
            yield Finding("shots disagree", "refuse", what, move)
        else:
            yield Finding(
                "shot left out",
                "check" if many else "note",
                f"{which} not fit the others and {'was' if one else 'were'} left out",
                "repeat it: it was not at rest, off its target, or near iron",
            )
    yield from _check_scatter(fit)
    if problem.missed:
        names = ", ".join(f"{name:g}" for name in problem.missed)
        yield Finding(
            "target missed",
            "check",
            f"the sight was not kept on target {names}: so the target was ignored",
            "roll the instrument about its sight, on the target all the time; 0 is a shot at no "
            "target",
        )
    if fit.sight is not None and fit.sight.scatter_deg >= UNSTEADY_DEG:
        yield Finding(
            "sight not kept",
            "refuse" if fit.sight.scatter_deg > ASTRAY_DEG else "check",
            f"on one target the sight scatters by {figure(fit.sight.scatter_deg)}°",
            "keep it on the target through the whole roll, from a fixed spot and a few metres off; "
            "a shot at no target has the number 0",
        )
    add, known = f"add shots: {'; '.join(fit.to_add[:4])}", f"{figure(fit.heading_sd_deg)}°"
    if fit.heading_sd_deg > OPEN_DEG:
        what = f"{fit.n} shots leave the heading uncertain by {known}"
        yield Finding("attitudes missing", "refuse", what, add)
    elif fit.heading_sd_deg > LOOSE_DEG:
        yield Finding(
            "heading loose", "check", f"the standard error of the heading is {known}", add
        )
    yield from _check_signs(fit, problem)


def _check_scatter(fit: PairFit) -> Iterator[Finding]:
    """By how much of itself gravity, and the field, scatters from shot to shot."""
    gain = float(np.cbrt(abs(np.linalg.det(fit.calibration.matrix))))
    size = float(fit.calibration.magnitude or np.nan) / gain
    felt = float(fit.noise[0] / (fit.accelerometer.magnitude or np.nan))
    share = float(fit.noise[1] / size)
    if felt >= SHAKY:
        what = f"gravity scatters by {figure(100 * felt)} % from shot to shot"
        move = "put it down or lean it against something for each shot"
        yield Finding("not at rest", "refuse" if felt > MOVING else "check", what, move)
    if share >= SHAKY:
        what = f"the field scatters by {figure(100 * share)} % from shot to shot"
        move = "turn the instrument about one spot away from iron, with nothing magnetic on you"
        yield Finding("field varies", "refuse" if share > MOVING else "check", what, move)


def _check_signs(fit: PairFit, problem: Problem) -> Iterator[Finding]:
    """What the dip says of the signs of the axes."""
    if problem.prior.information[DIP, DIP] > 0:
        if problem.scale.gravity < 0:
            what = "the log has gravity itself, down, where specific force was expected: "
            yield Finding("gravity reversed", "note", f"{what}sign changed")
        expected = float(np.degrees(problem.prior.mean[DIP]))
        off = abs(fit.free_inclination_deg - expected)
        if off > 4 * float(np.hypot(fit.free_inclination_sd_deg, np.degrees(DIP_SD))):
            dip = f"{fit.free_inclination_deg:.1f}°"
            what = f"the field dips by {dip} and {expected:.1f}° is expected here"
            move = "check the place, and look for iron: under a roof or in a car the dip differs"
            yield Finding("dip", "refuse" if off > 15 else "check", what, move)
    elif fit.inclination_deg <= 0:
        yield Finding(
            "field points up",
            "check",
            f"the field points up by {-fit.inclination_deg:.1f}°: right in the southern "
            "hemisphere; elsewhere the log has gravity itself where the specific force belongs, "
            "and headings turn the wrong way",
            "say where it was recorded (--at LAT,LON): then the sign is found and corrected",
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
