"""Calibrations of a sensor that sits in the vehicle by right angles."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
from agonic.maths.equation.affine import FREE, join, model_basis, split


def turn_calibration(calibration: Affine, turn: Array) -> Affine:
    """A calibration of turned readings, for the readings as they were; turn (3, 3) by which."""
    return _turn(calibration, turn, np.eye(3))


def turn_field(calibration: Affine, turn: Array) -> Affine:
    """A calibration whose field is turned into body axes; turn (3, 3) by which."""
    return _turn(calibration, np.eye(3), turn)


def _turn(calibration: Affine, first: Array, last: Array) -> Affine:
    """The calibration of readings that are turned first, and its field at last."""
    held = {f.name: getattr(calibration, f.name) for f in fields(calibration)}
    held |= {
        "bias": first.T @ calibration.bias,
        "matrix": last @ calibration.matrix @ first,
        "gauge": FREE,
        "frame_out": "b",
        "covariance": _turn_covariance(calibration, first, last),
    }
    if isinstance(calibration, Interference):
        held["coefficients"] = first.T @ calibration.coefficients
    return type(calibration)(**held)


def _turn_covariance(calibration: Affine, first: Array, last: Array) -> Array | None:
    if calibration.covariance is None:
        return None
    before, after = model_basis("full", calibration.gauge), model_basis("full", FREE)
    bias, matrix = split(before.T)
    local = join(bias @ first, last @ matrix @ first)
    columns = np.linalg.lstsq(after, local.T, rcond=None)[0]
    k = before.shape[1]
    more = len(calibration.covariance) - k  # coefficients of sources, axis by axis
    change = np.zeros((len(columns) + more, k + more))
    change[: len(columns), :k] = columns
    change[len(columns) :, k:] = np.kron(first.T, np.eye(more // 3)) if more else 0.0
    return np.asarray(change @ calibration.covariance @ change.T)
