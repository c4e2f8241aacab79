"""`CoilFit`: where a coil's field points, and how much of it an ampere gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from agonic.alignment.maths.columns import CoilEstimate
from agonic.alignment.maths.stretches import Stretches
from agonic.alignment.session.laboratory import CoilSession
from agonic.arrays import Array
from agonic.health import Finding, Judged
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.maths.rotations.vectors import skew
from agonic.readable import Shown


@dataclass(frozen=True, kw_only=True, eq=False)
class Direction:
    """The axis (3,) in the axes of a frame's letter, with the covariance (3, 3) of the vector."""

    frame: str
    axis: Annotated[Array, Shown()]
    covariance: Annotated[Array, Shown()]

    def turn(self, frame: str, matrix: Array, spread: Array | None = None) -> Direction:
        """In other axes; `spread` is the covariance of the turn's own rotation vector there."""
        axis = matrix @ self.axis
        covariance = matrix @ self.covariance @ matrix.T
        if spread is not None:
            covariance = covariance + skew(axis) @ spread @ skew(axis).T
        return Direction(frame=frame, axis=axis, covariance=covariance)

    @property
    def sd_arcsec(self) -> Annotated[float, Shown()]:
        """Standard error of the direction about its worst axis."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance)[-1], 0.0)) / ARCSEC_RAD)

    @property
    def angles_deg(self) -> tuple[float, float]:
        """Azimuth and elevation in north-east-down; else longitude and latitude on the sphere:
        right ascension and declination in inertial axes."""
        x, y, z = self.axis
        up = -z if self.frame == "n" else z
        return float(np.degrees(np.arctan2(y, x)) % 360), float(np.degrees(np.arcsin(up)))


@dataclass(frozen=True, kw_only=True)
class Level:
    """The coil at one size of the current: constant, and how far from that of all, nT/A."""

    current_A: Annotated[float, Shown()]
    constant: Annotated[float, Shown()]
    sd: Annotated[float, Shown()]
    departure: Annotated[float, Shown()]


@dataclass(frozen=True, kw_only=True, eq=False)
class CoilFit(Judged):
    """The result of `fit_coil`.

    Parameters
    ----------
    current : (k,) of the stretches in which it was constant. read : their means, and stretches :
        the same without the ambient field, where the reference's axes are known.
    estimate : the coil's vector by the ampere in the magnetometer's axes, with its covariance.
    directions : the axis in every frame that the session leads to, by letter: m magnetometer, b or
        c platform, n north-east-down, e Earth-fixed, i inertial at `time`.
    geometric_deg, geometric_sd_arcsec : the angle to the axis as drawn.
    levels : the constant at each size of the current. p_linear : how often they differ so much by
        chance.
    """

    session: CoilSession
    current: Array
    read: Stretches
    stretches: Stretches
    estimate: CoilEstimate
    directions: Annotated[dict[str, Direction], Shown(key="axes")]
    geometric_deg: Annotated[float | None, Shown()] = None
    geometric_sd_arcsec: Annotated[float | None, Shown()] = None
    levels: Annotated[tuple[Level, ...], Shown()] = ()
    p_linear: Annotated[float, Shown()] = 1.0
    time: Annotated[float | None, Shown(key="unix_s")] = None
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def n(self) -> Annotated[int, Shown()]:
        """How many stretches of constant current."""
        return len(self.stretches.time)

    @property
    def reversals(self) -> Annotated[int, Shown()]:
        """How often the current changed its sign."""
        sign = np.sign(self.current)
        return int((np.diff(sign[sign != 0]) != 0).sum())

    @property
    def axis(self) -> Array:
        """The unit vector (3,) in the magnetometer's axes."""
        return self.directions["m"].axis

    @property
    def axis_sd_arcsec(self) -> float:
        """Its standard error about the worst axis."""
        return self.directions["m"].sd_arcsec

    @property
    def constant(self) -> Annotated[float, Shown(key="constant_nT_A")]:
        """The coil constant, nT/A."""
        return float(np.linalg.norm(self.estimate.linear))

    @property
    def constant_sd(self) -> Annotated[float, Shown(key="constant_sd_nT_A")]:
        """Its standard error, with that of the current's scale."""
        along = float(np.sqrt(self.axis**2 @ self.estimate.covariance[:, 0, 0]))
        return float(np.hypot(along, self.session.current_sd * self.constant))
