"""`GravityFit`: how a magnetometer and an accelerometer sit on each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.maths.gravity import GravityEstimate
from agonic.alignment.maths.two_frames import compute_turn_sd
from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.health import Finding, Judged


@dataclass(frozen=True, kw_only=True, eq=False)
class GravityFit(Judged):
    """The result of `fit_gravity`.

    Parameters
    ----------
    calibration : field_b = rotation.apply(field_m), b the accelerometer's axes; after the
        magnetometer's own calibration where one was given.
    estimate : rotation, vertical intensity, bias, covariance, residuals by orientation.
    down, field : (k, 3) of the orientations at rest. gravity : (k,) its size as it was read.
    magnitude : of the field, nT or raw.
    """

    calibration: Alignment | Chain
    estimate: GravityEstimate
    down: Array
    field: Array
    gravity: Array
    magnitude: float
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """How many orientations."""
        return len(self.down)

    @property
    def rot_bm(self) -> Array:
        """Magnetometer components into the accelerometer's, (3, 3)."""
        return self.estimate.rotation

    @property
    def angle_deg(self) -> float:
        """By how much the two are turned against each other."""
        return float(np.degrees(Rotation.from_matrix(self.rot_bm).magnitude()))

    @property
    def sd_deg(self) -> Array:
        """Standard errors (3,) of the turn about the accelerometer's axes."""
        return np.asarray(np.degrees(np.sqrt(np.diag(self.estimate.covariance)[:3])))

    @property
    def worst_sd_deg(self) -> float:
        """About the axis about which it is known least."""
        return float(np.degrees(compute_turn_sd(self.estimate.covariance)))

    @property
    def inclination_deg(self) -> float:
        """Of the field, down positive, by magnetometer and accelerometer alone."""
        return float(np.degrees(np.arcsin(np.clip(self.estimate.vertical / self.magnitude, -1, 1))))
