"""A sensor that sits in the vehicle by right angles: readings turned into body axes for the fit,
and its calibration turned back, so that it takes the readings as they are logged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.mounting import turn_calibration
from agonic.errors import AgonicError
from agonic.health import (
    FEWEST,
    Finding,
    find_mounting,
    find_side,
    find_usable_rows,
)
from agonic.inertial.attitude import feel_attitude
from agonic.logs.any_form import Given, as_samples
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.mounting import describe_mounting
from agonic.recording.calibrated import Calibrated, calibrate_as_named
from agonic.recording.choice.choose import Kind
from agonic.reference import Reference
from agonic.samples import Samples

STEEP_DEG = 10.0


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
    meant, known = as_samples(samples, unit), Reference.of(reference)
    turn = find_turn(meant, known) if kind == "auto" else None
    if turn is not None:
        turned = calibrate_as_named(turn_readings(meant, turn), known, kind=kind, **settings)
        if turned.verdict != "refused" and turned.method != "ellipsoid":
            return _tell_turn(turn_back(turned, turn), turn)
    return calibrate_as_named(meant, known, kind=kind, **settings)


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
    if rows.sum() < FEWEST:
        return None
    readings, down = samples.field[rows], down[rows]
    turn = find_mounting(readings, down)
    upside_down = turn is not None and find_side(readings, down, turn, dip) < 0
    return None if upside_down else turn


def _tell_turn(result: Calibrated, turn: Array) -> Calibrated:
    """The result, saying how the sensor was found to sit."""
    found = Finding(
        "mounting",
        "note",
        f"the readings show that the sensor is mounted so that {describe_mounting(turn)}; the "
        "calibration turns them into the vehicle's axes",
        "if it does not sit like that, name its axes rightly and calibrate again",
    )
    return result.with_finding(found)


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
