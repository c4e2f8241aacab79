"""`fit_gravity`: the rotation from a magnetometer to an accelerometer, by gravity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.alignment.calibration import make_calibration, make_provenance
from agonic.alignment.gravity.evidence import describe, examine
from agonic.alignment.gravity.result import GravityFit
from agonic.alignment.maths import gravity as kernel
from agonic.alignment.maths.stretches import average, find_rows
from agonic.alignment.session.session import correct_field
from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.errors import LogError
from agonic.maths.estimation.changes.rest import find_rest
from agonic.maths.rotations.tilt import down_from_force
from agonic.samples import Samples

METHOD = ("kok-2016",)
FEWEST = 6


def fit_gravity(
    samples: Samples, calibration: Calibration | None = None, *, bias: bool = False
) -> GravityFit:
    """The rotation from a magnetometer's axes to those of an accelerometer on the same body.

    At one place the angle between field and gravity is constant, so in every orientation at rest
    d · R (m − b) = Z, with d the direction of down that the accelerometer reads.

    Parameters
    ----------
    samples : with acceleration; the orientations at rest are those of `station`, or are found.
    calibration : of the magnetometer, applied first. bias : whether a bias is sought as well.

    Returns a `GravityFit`, refused where the orientations leave the turn open. Raises `LogError`
    without acceleration or with too few orientations at rest.

    Source: M. Kok, T. B. Schön, IEEE Sensors Journal 16(14), 2016: the constant inner product of
    field and gravity.

    >>> from agonic.alignment.simulation.gravity import simulate_gravity
    >>> made = simulate_gravity(seed=1)
    >>> fit = fit_gravity(made.samples)
    >>> fit.n, bool(fit.worst_sd_deg < 0.1)
    (24, True)
    """
    if samples.acceleration is None:
        raise LogError(f"{samples.name} was logged without acceleration; record the accelerometer")
    field = correct_field(samples, calibration)
    down, means, gravity = _orientations(samples, samples.acceleration, field)
    need = FEWEST + (3 if bias else 0)
    if len(down) < need:
        raise LogError(
            f"{len(down)} orientations at rest were found and {need} are needed; hold the body "
            "still for two seconds on each side, and tilted between"
        )
    found = kernel.estimate(down, means, bias=bias, gravity=gravity)
    fit = GravityFit(
        calibration=make_calibration(
            found.rotation.T,
            found.rotation.T @ found.covariance[:3, :3] @ found.rotation,
            samples,
            make_provenance(
                () if samples.source is None else (samples.source,),
                {samples.name: samples.field},
                {"fit": "gravity", "bias": bias},
                *METHOD,
            ),
            frame="b",
            before=calibration,
        ),
        estimate=found,
        down=down,
        field=means,
        gravity=gravity,
        magnitude=float(np.linalg.norm(means - found.bias, axis=1).mean()),
    )
    judged = replace(fit, findings=examine(fit, samples.latitude_deg))
    return judged if judged.verdict == "refused" else replace(judged, remarks=describe(fit))


def _orientations(samples: Samples, force: Array, field: Array) -> tuple[Array, Array, Array]:
    """Down (k, 3), field (k, 3) and the size of gravity (k,) of the orientations at rest."""
    if samples.station is not None:
        number = samples.station.astype(np.int64)
    elif samples.time is None:
        raise LogError("what stands still follows from times; log them, or number the stations")
    else:
        number = find_rest(samples.time, force, field)
    still = number >= 0
    if not still.any():
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    rows = find_rows(number, np.unique(number[still]))
    forces = average(force, rows)
    return down_from_force(forces), average(field, rows), np.linalg.norm(forces, axis=1)
