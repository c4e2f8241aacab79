"""`PairFit`: the calibrations of an accelerometer and a magnetometer, and what they rest on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup
from agonic.health import Finding, Judged
from agonic.readable import Shown


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """The direction in the accelerometer's axes that was kept on targets, and how well it is known.

    `axis` (3,) of length one; `sd_deg` about the worst of the two axes across it; `scatter_deg` of
    single sightings, the calibration's own errors left out.
    """

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
        """The setup of an instrument that reads its heading with both calibrations, at rest.

        Parameters: `settings` of `Setup` beside these, as `declination_deg`.
        """
        return Setup(
            compasses=(Compass(calibration=self.calibration),),
            accelerometer=self.accelerometer,
            **{"tilt": "accelerometer", "tilt_sd_deg": self._tilt_sd_deg(), **settings},
        )

    def _tilt_sd_deg(self) -> float:
        """Of one reading of the accelerometer; its calibration adds its own error."""
        share = float(self.noise[0] / abs(self.accelerometer.magnitude or np.nan))
        return float(np.degrees(share))
