"""A sensor that sits in the vehicle by right angles: readings turned into body axes for the fit,
and its calibration turned back, so that it takes the readings as they are logged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.mounting import turn_calibration
from agonic.errors import AgonicError
from agonic.health import FEWEST, Finding, find_mounting, find_usable_rows, sentences
from agonic.inertial.attitude import feel_attitude
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.mounting import describe_mounting
from agonic.recording.calibrated import Calibrated, calibrate
from agonic.recording.choice import Kind
from agonic.reference import Reference
from agonic.samples import Samples

STEEP_DEG = 10.0


def calibrate_mounted(
    samples: Samples, reference: Reference | None, *, kind: Kind = "auto", **settings: Any
) -> Calibrated:
    """What `calibrate` makes of it; of a sensor that sits turned, in the vehicle's axes.

    The turn is applied where roll and pitch, or an accelerometer, tell it far better than any
    other, and the fit of the turned readings holds, dip included.
    """
    turn = find_turn(samples, reference) if kind == "auto" else None
    if turn is not None:
        turned = calibrate(turn_readings(samples, turn), reference, kind=kind, **settings)
        if turned.verdict != "refused" and turned.method != "ellipsoid":
            return _tell_turn(turn_back(turned, turn), turn)
    return calibrate(samples, reference, kind=kind, **settings)


def find_turn(samples: Samples, reference: Reference | None) -> Array | None:
    """The turn (3, 3) from the sensor's axes to the vehicle's that the log tells for certain.

    The vertical part of the field has to be steep enough for its sign to be seen, for roll counted
    the wrong way round looks like a sensor that lies on its back.
    """
    if reference is None or samples.frame == "b":
        return None
    dip = reference.inclination_deg
    if dip is None or abs(dip) < STEEP_DEG:
        return None
    if samples.roll_deg is not None and samples.pitch_deg is not None:
        down = down_b(samples.roll_deg, samples.pitch_deg)
    elif samples.acceleration is not None:
        down = feel_attitude(samples).down
    else:
        return None
    rows = np.isfinite(down).all(axis=1) & find_usable_rows(samples.field)
    return find_mounting(samples.field[rows], down[rows]) if rows.sum() >= FEWEST else None


def _tell_turn(result: Calibrated, turn: Array) -> Calibrated:
    """The result, saying how the sensor was found to sit."""
    found = Finding(
        "mounting",
        "note",
        f"the readings show that the sensor is mounted so that {describe_mounting(turn)}; the "
        "calibration turns them into the vehicle's axes",
        "if it does not sit like that, name its axes rightly and calibrate again",
    )
    fit = result.fit.with_findings(found)
    return replace(result, fit=fit, status=f"{result.status} {sentences(found.sentence)}")


def turn_readings(samples: Samples, turn: Array) -> Samples:
    """The samples with their readings in body axes; raises `AgonicError` where they are there."""
    if samples.frame == "b":
        raise AgonicError(
            f"the log has the readings of {samples.name} in body axes, by the orientation that the "
            "autopilot was given; correct that one (COMPASS_ORIENT, CAL_MAGn_ROT) and log again"
        )
    note = f"readings turned into body axes: {describe_mounting(turn)}"
    return samples.with_columns(field=samples.field @ turn.T, notes=(*samples.notes, note))


def turn_back(result: Calibrated, turn: Array) -> Calibrated:
    """The result for readings in the axes of the sensor, its field in those of the body.

    field = W (R raw − b) = (W R) (raw − Rᵀb).
    """
    samples = result.samples
    logged = samples.with_columns(field=samples.field @ turn)
    fit = replace(result.fit, calibration=turn_calibration(result.fit.calibration, turn))
    reason = f"{result.reason}; the sensor is mounted so that {describe_mounting(turn)}"
    return replace(result, samples=logged, fit=fit, reason=reason)
