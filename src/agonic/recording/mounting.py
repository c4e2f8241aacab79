"""A sensor that sits in the vehicle by right angles: readings turned into body axes for the fit,
and its calibration turned back, so that it takes the readings as they are logged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import polar

from agonic.arrays import Array
from agonic.calibration.mounting import turn_calibration
from agonic.errors import AgonicError
from agonic.health import find_mounting, find_side, find_usable_rows
from agonic.health.mounting import FAR_BETTER
from agonic.logs.any_form import Given, as_samples
from agonic.maths.rotations.mounting import describe_turn, right_angles
from agonic.maths.rotations.turn_beside import TurnBeside
from agonic.recording.calibrated import Calibrated, calibrate_as_named, undo_damage
from agonic.recording.choice.choose import Kind
from agonic.recording.turned_sensor import (
    MOST_DEG,
    describe_found,
    find_turn_of,
    is_certain,
    measure_down,
    undo_turn,
)
from agonic.reference import Reference
from agonic.samples import Samples

STEEP_DEG = 10.0
LEAST_DEG = 8.0
"""Turns up to this size are found by the fit itself."""
SOFT_IRON_SD = 0.1
"""Of raw readings, over the mean gain."""
IN_BODY_AXES = "which the log has them in by the orientation that was set: that one is wrong"
REORIENT = (
    "correct the orientation of this compass by that turn (COMPASS_ORIENT, CAL_MAGn_ROT) and "
    "calibrate a new log; exported numbers hold for the present one only"
)
"""Of readings that the autopilot has turned already."""
NOT_FOLLOWED = {"attitude", "mounting", "axes", "heading"}
"""Names of findings by which the attitude is not that of the turned sensor either."""
ASK_FOR_PLACE = (
    "say where and when the log was recorded (--at LAT,LON, --date), and the calibration turns the "
    "sensor to roll and pitch; look how the sensor sits, and set their zero with the vehicle level"
)
ASK_FOR_ATTITUDE = (
    "leave out --method, and the calibration turns the sensor to roll and pitch; look how the "
    "sensor sits, and set their zero with the vehicle level"
)
"""What makes use of a turn that a fit to the magnitude leaves in the readings."""


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
        if turned.verdict != "refused" and not NOT_FOLLOWED & _list_names(turned):
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
    move = ASK_FOR_ATTITUDE if kind in ("vector", "horizontal-vertical") else ASK_FOR_PLACE
    at = (result.fit, result.samples, result.latency, move)
    return replace(result, fit=undo_turn(*at, known=known))


def _report_turn(result: Calibrated, found: TurnBeside) -> Calibrated:
    """The result, saying how the sensor sits, by the calibration itself."""
    turn = found.turn
    if not np.array_equal(turn, np.rint(turn)):
        turn = polar(result.calibration.matrix)[0]
    told = describe_found(turn, found.sd)
    if result.samples.frame == "b":
        told = replace(told, severity="check", what=f"{told.what}, {IN_BODY_AXES}", move=REORIENT)
    return result.with_finding(told)


def _list_names(result: Calibrated) -> set[str]:
    return {finding.name for finding in result.objections}


def find_turn(samples: Samples, reference: Reference | None) -> TurnBeside | None:
    """The turn from the sensor's axes to the vehicle's that the log tells for certain: at any
    angle, or, where a vehicle hardly tilts, among those by right angles.

    The sign of the vertical field tells it from reversed axes, where a place is known and it is
    steep enough; roll counted the wrong way round looks like a sensor that lies on its back.
    """
    found = find_turn_of(samples.field, samples, SOFT_IRON_SD)
    down = measure_down(samples)
    if found is None or down is None:
        return None
    rows = np.isfinite(down).all(axis=1) & find_usable_rows(samples.field)
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
    """The result for readings in the axes of the sensor, its field in those of the body.

    field = W (R raw − b) = (W R) (raw − Rᵀb).
    """
    samples = result.samples
    logged = samples.with_columns(field=samples.field @ turn)
    fit = replace(result.fit, calibration=turn_calibration(result.fit.calibration, turn))
    reason = f"{result.reason}; the sensor is {describe_turn(turn)}"
    return replace(result, samples=logged, fit=fit, reason=reason)
