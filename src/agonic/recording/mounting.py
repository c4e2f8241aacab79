"""A sensor that sits turned in its vehicle.

By right angles: readings are turned into body axes for the fit, and its calibration is turned back,
so that it takes the readings as they are logged. At any angle: the magnitude does not see how a
sensor sits. What tells down beside it does, by the vertical part of the field
(`maths.rotations.turn_beside`): recorded roll and pitch, or what accelerometer and gyro feel. A
turn that is certain becomes part of the calibration, W → R W, with its error.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import polar

from agonic.arrays import Array, Mask
from agonic.attitude.known_heading import MountedHeading, check_turned_sensor
from agonic.attitude.latency import LatencyFit
from agonic.attitude.problem import TURN
from agonic.attitude.undo_latency import undelayed
from agonic.calibration.affine import Affine
from agonic.calibration.interference import turn_calibration, turn_field
from agonic.errors import AgonicError
from agonic.fit import Fit
from agonic.health import Finding, figure, find_mounting, find_side, find_usable_rows
from agonic.health.mounting import FAR_BETTER, RIVAL
from agonic.inertial.attitude import estimate_attitude
from agonic.logs.any_form import Given, as_samples
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.right_angles import describe_turn, right_angles
from agonic.maths.rotations.turn_beside import TurnBeside, find_turn_beside
from agonic.maths.rotations.vectors import skew
from agonic.model.posterior import LEAST_SHARE
from agonic.new_rows import find_fresh
from agonic.recording.calibrated import Calibrated, calibrate_as_named, undo_damage
from agonic.recording.choice.choose import Kind
from agonic.reference import Reference
from agonic.samples import Samples

MIN_ROWS = 200
"""Rows that can show a turn."""
SURELY = 4.0
"""Standard errors of a turn that is there: 1 in 16 000 by chance."""
MATTERS_DEG = 1.0
"""A turn that is surely larger is undone; sensors are mounted with such errors."""
SHARP_DEG = 3.0
"""Standard error of a turn, about any axis, from which it is not undone."""
MOST_MISFIT_LEFT = 0.9
"""Of these changes, what a turn that is certain leaves; in a room the field leans from place to
place, which a turn explains a little of."""
LEFT_SD = 3e-3
"""Of a calibrated field: what a fit leaves of it."""
STEEPEST_DEG = 80.0
"""A dip beyond which no heading is stated."""
MOST_DEG = 100.0
"""Where nothing tells the sign of the vertical field, a larger turn may be reversed axes."""
OF_ATTITUDE = {"axes", "attitude", "mounting"}
"""Findings by which what tells down is wrong itself."""
SMALL_DEG = 45.0
"""A larger turn that is not certain says that nothing is known of it."""


def find_turn_of(
    field: Array, samples: Samples, seen: tuple[Mask, Array], soft_iron_sd: float
) -> TurnBeside | None:
    """The turn of a sensor whose readings, or calibrated field, are (n, 3) in the rows of samples,
    down in some of them as it was `seen`; None where nothing tells it in enough of them."""
    rows, down = seen
    some = np.flatnonzero(rows & find_fresh(samples.field))
    return (
        find_turn_beside(field[some], down[some], soft_iron_sd) if len(some) >= MIN_ROWS else None
    )


def measure_down(samples: Samples) -> tuple[Mask, Array]:
    """Down (n, 3) in body axes by roll and pitch, else as an inertial unit feels it, and the usable
    rows (n,) in which it is known."""
    down = np.full((len(samples), 3), np.nan)
    if samples.roll_deg is not None and samples.pitch_deg is not None:
        down = down_b(samples.roll_deg, samples.pitch_deg)
    elif samples.acceleration is not None and samples.time is not None:
        with suppress(AgonicError):
            down = estimate_attitude(samples).down
    return np.isfinite(down).all(axis=1) & find_usable_rows(samples.field), down


def is_certain(found: TurnBeside, least_deg: float, better: float) -> bool:
    """Whether a turn is there, larger than so many degrees, and known about every axis."""
    sd = np.degrees(found.sd)
    return bool(
        np.degrees(found.angle) - sd > least_deg
        and np.degrees(found.angle) > SURELY * sd
        and sd < SHARP_DEG
        and found.misfit < better * found.unturned
        and found.misfit * RIVAL < found.rival
    )


def undo_turn(
    fit: Fit, samples: Samples, latency: LatencyFit | None, move: str, *, known: bool = False
) -> Fit:
    """The fit in the vehicle's axes where the turn of the sensor in it is certain, or where most of
    it is undone before and the rest is `known` to be no turn of an attitude that is wrong. Else the
    vehicle's heading is stated with what is not known of the turn, and what surely shows of it
    about the level axes is told; `move` says what would use roll and pitch."""
    named = {finding.name for finding in fit.findings}
    if fit.verdict == "refused" or fit.calibration.magnitude is None or OF_ATTITUDE & named:
        return fit
    if latency is not None and latency.significant and samples.time is not None:
        samples = undelayed(samples, latency.latency_s)
    field = fit.calibration.correct(samples.field)
    found = find_turn_of(field, samples, measure_down(samples), LEFT_SD)
    if found is None:
        return fit
    if known and np.degrees(found.sd) < SHARP_DEG:
        return _apply(fit, found)
    if is_certain(found, MATTERS_DEG, MOST_MISFIT_LEFT) and np.degrees(found.angle) < MOST_DEG:
        return _apply(fit, found).with_findings(describe_found(found.turn, found.sd))
    small = np.degrees(found.angle) < SMALL_DEG
    return _state_unknown(fit, found, samples, move) if small else fit


def _apply(fit: Fit, found: TurnBeside) -> Fit:
    """The fit with its field turned, and the heading's error in the vehicle."""
    by_turn = _find_heading_sd(found, fit, np.zeros(3))
    vehicle = float(np.hypot(fit.coverage.heading_sd_deg, by_turn))
    accuracy, shares = fit.accuracy, {TURN: by_turn, **fit.shares} if fit.shares else {}
    told = {name: sd for name, sd in shares.items() if sd**2 > LEAST_SHARE * vehicle**2}
    return replace(
        fit,
        shares=dict(sorted(told.items(), key=lambda one: -one[1])),
        calibration=_turn_calibration(fit.calibration, found),
        coverage=replace(fit.coverage, down=found.turn.T @ [0.0, 0.0, 1.0]),
        accuracy=accuracy and replace(accuracy, vehicle_deg=vehicle, alone=False),
    )


def describe_found(turn: Array, sd: float) -> Finding:
    """How a sensor was found to sit, with the standard error, rad, of other angles than right."""
    known = (
        ""
        if np.array_equal(turn, np.rint(turn))
        else f", with a standard error of {figure(float(np.degrees(sd)))}°"
    )
    return Finding(
        "mounting",
        "note",
        f"the readings show that the sensor is {describe_turn(turn)}{known}; the calibration turns "
        "them into the vehicle's axes",
        "if it does not sit like that, name its axes rightly and calibrate again",
    )


def _turn_calibration(calibration: Affine, found: TurnBeside) -> Affine:
    """The calibration turned, with the error of the turn in its covariance."""
    turned = turn_field(calibration, found.turn)
    if turned.covariance is None:
        return turned
    basis = model_basis("full", FREE)
    moves = np.stack([(skew(axis) @ turned.matrix).ravel() for axis in np.eye(3)], axis=1)
    by = np.zeros((len(turned.covariance), 3))
    by[: basis.shape[1]] = np.linalg.pinv(basis)[:, 3:] @ moves
    return replace(turned, covariance=turned.covariance + by @ found.covariance @ by.T)


def _find_heading_sd(found: TurnBeside, fit: Fit, turned: Array) -> float:
    """The rms error of a level heading by errors of the turn, and by a turn that is not undone,
    degrees: about the vertical one to one, about level axes by tan I/√2."""
    dip = min(abs(fit.coverage.inclination_deg), STEEPEST_DEG)
    square = found.covariance + np.outer(turned, turned)
    level = np.tan(np.radians(dip)) ** 2 / 2 * (square[0, 0] + square[1, 1])
    return float(np.degrees(np.sqrt(square[2, 2] + level)))


def _state_unknown(fit: Fit, found: TurnBeside, samples: Samples, move: str) -> Fit:
    """The fit with what a turn about the level axes adds to the vehicle's heading; one about the
    vertical shifts all headings alike and is not judged."""
    level = found.about * [1.0, 1.0, 0.0]
    covariance = found.covariance.copy()
    covariance[2] = covariance[:, 2] = 0.0
    own = fit.coverage.heading_sd_deg
    unknown = _find_heading_sd(found._replace(covariance=covariance), fit, level)
    vehicle = float(np.hypot(own, unknown))
    size = float(np.linalg.norm(level))
    sd = float(np.sqrt(level @ covariance @ level)) / max(size, 1e-12)
    if samples.roll_deg is None:
        return fit
    if fit.accuracy is not None:
        fit = replace(fit, accuracy=replace(fit.accuracy, vehicle_deg=vehicle))
    by_angle = np.tan(np.radians(min(abs(fit.coverage.inclination_deg), STEEPEST_DEG))) / np.sqrt(2)
    surely = np.degrees(size - SURELY / 2 * sd) * by_angle > own and size > SURELY * sd
    size_deg, sd_deg = np.degrees([size, sd]).tolist()
    mounted = MountedHeading(own, vehicle, size_deg, turn_sd_deg=sd_deg)
    worse = found.misfit > MOST_MISFIT_LEFT * found.unturned or found.misfit * RIVAL > found.rival
    told = check_turned_sensor(mounted, turned=True) if surely and not worse else None
    if told is None:
        return fit
    coverage = replace(fit.coverage, heading_sd_deg=vehicle)
    return replace(fit, coverage=coverage).with_findings(replace(told, move=move))


STEEP_DEG = 10.0
LEAST_DEG = 8.0
"""Turns up to this size are found by the fit itself."""
SOFT_IRON_SD = 0.1
"""Of raw readings, over the mean gain."""
NOT_FOLLOWED = {"attitude", "mounting", "axes", "heading"}
"""Names of findings by which the attitude is not that of the turned sensor either."""


def calibrate(
    samples: Given,
    reference: Reference | ArrayLike | None = None,
    *,
    unit: str | None = None,
    kind: Kind = "auto",
    **settings: Any,
) -> Calibrated:
    """Calibrate one magnetometer and verify it on held-out parts of its own log.

    A sensor that sits turned by right angles is calibrated in the vehicle's axes, where roll and
    pitch, or an accelerometer, tell that turn far better than any other and the fit of the turned
    readings holds, dip included; `status` then says so.

    The log is cut into blocks of time; each row is judged by a fit to the blocks that do not hold
    it (two folds of alternate blocks; where half a log determines too little, a fit without each
    block). The calibration itself uses all rows.

    Parameters
    ----------
    samples : as in `fit_ellipsoid`. reference : as there, (n,) or constant, or as in `fit_levelled`
        and `fit_vector`. unit : of samples that are given as plain numbers.
    kind : "ellipsoid", "levelled", "inertial", "vector", "interference", or "auto": vector where an
        independent heading is known, levelled where roll and pitch are, inertial where an
        accelerometer is, each with the field of the place; ellipsoid otherwise, or where it is sure
        enough by itself. A latency that stands out is undone first, and a current on
        board joins the fit where it matters.
    settings : those of the fit.

    Raises `CoverageError` where nothing can be fitted at all.

    >>> from agonic.simulation import simulate
    >>> calibrate(simulate("tumble").samples, Reference.constant(50_000)).verdict
    'good'
    """
    meant, known, wrong = undo_damage(as_samples(samples, unit), Reference.of(reference, unit))
    found = find_turn(meant, known) if kind == "auto" else None
    if found is not None:
        turned = calibrate_as_named(_turn(meant, found.turn), known, kind=kind, **settings)
        named = {finding.name for finding in turned.objections}
        if turned.verdict != "refused" and not NOT_FOLLOWED & named:
            made = turn_back(_undo_rest(turned, known=True), found.turn)
            return _report_turn(made, found).with_finding(*wrong)
    made = calibrate_as_named(meant, known, kind=kind, **settings)
    return _undo_rest(made).with_finding(*wrong)


def _undo_rest(result: Calibrated, *, known: bool = False) -> Calibrated:
    """The result of a fit by the magnitude, which does not see how the sensor is turned in its
    vehicle, with that turn undone; all of it where most is `known`."""
    if result.method != "ellipsoid":
        return result
    kind = None if result.reference is None else result.reference.kind
    ask = "say where and when the log was recorded (--at LAT,LON, --date)"
    if kind in ("vector", "horizontal-vertical"):
        ask = "leave out --method"
    move = (
        f"{ask}, and the calibration turns the sensor to roll and pitch; look how the sensor sits, "
        "and set their zero with the vehicle level"
    )
    fit = undo_turn(result.fit, result.samples, result.latency, move, known=known)
    return replace(result, fit=fit)


def _report_turn(result: Calibrated, found: TurnBeside) -> Calibrated:
    """The result, saying how the sensor sits, by the calibration itself."""
    turn = found.turn
    if not np.array_equal(turn, np.rint(turn)):
        turn = polar(result.calibration.matrix)[0]
    told = describe_found(turn, found.sd)
    if result.samples.frame == "b":
        told = replace(
            told,
            severity="check",
            what=f"{told.what}, which the log has them in by the orientation that was set: that "
            "one is wrong",
            move="correct the orientation of this compass by that turn (COMPASS_ORIENT, "
            "CAL_MAGn_ROT) and calibrate a new log; exported numbers hold for the present one only",
        )
    return result.with_finding(told)


def find_turn(samples: Samples, reference: Reference | None) -> TurnBeside | None:
    """The turn from the sensor's axes to the vehicle's that the log tells for certain: at any
    angle, or, where a vehicle hardly tilts, among those by right angles. The sign of the vertical
    field tells it from reversed axes, where a place is known and it is steep enough; roll counted
    the wrong way round looks like a sensor that lies on its back."""
    rows, down = seen = measure_down(samples)
    found = find_turn_of(samples.field, samples, seen, SOFT_IRON_SD)
    if found is None:
        return None
    readings, down = samples.field[rows], down[rows]
    sure = is_certain(found, LEAST_DEG, FAR_BETTER)
    right = find_nearest(found.turn) if sure else find_mounting(readings, down)
    if right is not None:
        found = found._replace(turn=right)
    elif not sure:
        return None
    dip = None if reference is None else reference.inclination_deg
    if dip is not None and abs(dip) > STEEP_DEG:
        return None if find_side(readings, down, found.turn, dip) < 0 else found
    return found if sure and np.degrees(found.angle) < MOST_DEG else None


def find_nearest(turn: Array) -> Array | None:
    """The turn by right angles that is so near that a fit finds the rest, if any."""
    trace = np.einsum("ij,kij->k", turn, right_angles())
    nearest = int(np.argmax(trace))
    off = np.degrees(np.arccos(np.clip((trace[nearest] - 1) / 2, -1.0, 1.0)))
    return right_angles()[nearest] if off < LEAST_DEG else None


def turn_readings(samples: Samples, turn: Array) -> Samples:
    """The samples with their readings in body axes; raises `AgonicError` where they are there."""
    if samples.frame == "b":
        raise AgonicError(
            f"the log has the readings of {samples.name} in body axes, by the orientation that the "
            "autopilot was given; correct that one (COMPASS_ORIENT, CAL_MAGn_ROT) and log again"
        )
    return _turn(samples, turn)


def _turn(samples: Samples, turn: Array) -> Samples:
    note = f"readings turned into body axes: the sensor is {describe_turn(turn)}"
    return samples.with_columns(field=samples.field @ turn.T, notes=(*samples.notes, note))


def turn_back(result: Calibrated, turn: Array) -> Calibrated:
    """The result for readings in the axes of the sensor, its field in those of the body. field = W
    (R raw − b) = (W R) (raw − Rᵀb)."""
    samples = result.samples
    logged = samples.with_columns(field=samples.field @ turn)
    fit = replace(result.fit, calibration=turn_calibration(result.fit.calibration, turn))
    reason = f"{result.reason}; the sensor is {describe_turn(turn)}"
    return replace(result, samples=logged, fit=fit, reason=reason)
