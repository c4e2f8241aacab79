"""`AlignmentFit`: how a magnetometer sits on a star sensor, and what that rests on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.maths.two_frames import (
    GROUPS,
    Solution,
    compute_rotation_vector,
    compute_turn_sd,
)
from agonic.alignment.remanence import RemanenceFit, fit_remanence
from agonic.alignment.session.observed import Observed
from agonic.alignment.session.session import Session
from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.health import Finding, Judged
from agonic.maths.rotations.frames import ARCSEC_RAD, angles_232_deg, angles_323_deg, rot_en
from agonic.maths.rotations.vectors import skew
from agonic.readable import Shown


@dataclass(frozen=True, kw_only=True, eq=False)
class AlignmentFit(Judged):
    """The result of `fit_alignment`.

    Parameters
    ----------
    calibration : field_c = rotation.apply(field_m), from the magnetometer's axes into the star
        sensor's; a `Chain` with the magnetometer's bias and matrix where they were known or solved.
    session, observed : what it was made from, and the same by orientation.
    solution : the unknowns with their information. solve : the groups that were asked for.
    undetermined : the combinations that nothing determines, in words.
    add : orientations to add, (azimuth, elevation, roll) in degrees each, the most useful first.
    wanted_sd_arcsec : what was wanted about every axis.
    """

    calibration: Alignment | Chain
    session: Session
    observed: Observed
    solution: Solution
    solve: tuple[str, ...]
    undetermined: tuple[str, ...] = ()
    add: tuple[tuple[float, float, float], ...] = ()
    wanted_sd_arcsec: float = 2.0
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @cached_property
    def platform(self) -> RemanenceFit | None:
        """The platform's own field, where the session has readings with it turned."""
        session = self.session
        if session.remanence is None:
            return None
        return fit_remanence(session.remanence, wanted_arcsec=self.wanted_sd_arcsec)

    @property
    def n(self) -> int:
        """How many orientations."""
        return len(self.observed)

    @property
    def rot_mc(self) -> Annotated[Array, Shown(key="matrix_mc")]:
        """Star sensor components into the magnetometer's, (3, 3): R3(γ) R2(β) R3(α)."""
        return self.solution.unknowns.rot_mc

    @property
    def covariance(self) -> Array:
        """Covariance (18, 18): rotation vectors of alignment (magnetometer axes) and reference
        (north, east, down), rad; pier and bias, nT; matrix xx yy zz xy xz yz."""
        return self.solution.covariance

    @cached_property
    def sd(self) -> Array:
        """Standard errors (18,) of the same."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def sd_arcsec(self) -> Annotated[Array, Shown()]:
        """Standard errors (3,) of the alignment about the magnetometer's axes."""
        return np.asarray(self.sd[GROUPS["alignment"]] / ARCSEC_RAD)

    @property
    def worst_sd_arcsec(self) -> Annotated[float, Shown()]:
        """Standard error of the alignment about the axis about which it is known least."""
        return compute_turn_sd(self.covariance) / ARCSEC_RAD

    @property
    def angles_deg(self) -> Annotated[Array, Shown(key="angles_323_deg")]:
        """α, β, γ (3,) of the 3-2-3 sequence from the star sensor to the magnetometer."""
        return angles_323_deg(self.rot_mc)

    @property
    def angles_sd_arcsec(self) -> Annotated[Array, Shown(key="angles_323_sd_arcsec")]:
        """Standard errors (3,) of α, β, γ; huge where β is near 0 or 180°."""
        jacobian = _angle_jacobian(np.radians(self.angles_deg))
        return self._compute_sd(jacobian) / ARCSEC_RAD

    @property
    def quat_wxyz(self) -> Annotated[Array, Shown()]:
        """The rotation of components from the star sensor to the magnetometer, Hamilton."""
        return np.asarray(Rotation.from_matrix(self.rot_mc).as_quat(canonical=True)[[3, 0, 1, 2]])

    @property
    def quat_sd(self) -> Annotated[Array, Shown()]:
        """Standard errors (4,) of the quaternion's components."""
        w, x, y, z = self.quat_wxyz
        jacobian = 0.5 * np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])
        return self._compute_sd(jacobian)

    @property
    def matrix_sd_arcsec(self) -> Annotated[Array, Shown()]:
        """Standard errors (3, 3) of the direction cosines, as angles."""
        across = -skew(self.rot_mc.T)  # ∂(column j)/∂turn, a row of matrices a column
        return self._compute_sd(across).T / ARCSEC_RAD

    def _compute_sd(self, jacobian: Array) -> Array:
        """Standard errors (…, k) of what the Jacobians (…, k, 3) say of the turn."""
        block = self.covariance[GROUPS["alignment"], GROUPS["alignment"]]
        variance = ((jacobian @ block) * jacobian).sum(axis=-1)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    @property
    def reference_turn_arcsec(self) -> Annotated[Array, Shown()]:
        """How the reference's axes are turned about north, east and down, (3,)."""
        return compute_rotation_vector(self.solution.unknowns.rot_nr) / ARCSEC_RAD

    @property
    def reference_angles_deg(self) -> Annotated[Array, Shown(key="reference_232_deg")]:
        """χ, ζ, η (3,) of the 2-3-2 sequence from the reference's axes to Earth-fixed ones."""
        site = self.session.site
        onto = rot_en(site.latitude_deg, site.longitude_deg)
        return angles_232_deg(onto @ self.solution.unknowns.rot_nr)

    @property
    def residuals(self) -> Array:
        """(k, 3) of each orientation, nT, magnetometer axes."""
        return self.solution.residuals

    @property
    def residuals_arcsec(self) -> Array:
        """(k,) by how much the field's direction is off."""
        expected = self.solution.measured.field - self.residuals
        along = expected / np.linalg.norm(expected, axis=1, keepdims=True)
        across = np.linalg.norm(np.cross(along, self.residuals), axis=1)
        return np.asarray(across / np.linalg.norm(expected, axis=1) / ARCSEC_RAD)

    @property
    def residual_rms(self) -> Annotated[float, Shown(key="residual_rms_nT")]:
        """Of a component, nT."""
        return float(np.sqrt((self.residuals**2).mean()))

    @property
    def rank(self) -> int:
        """How many independent combinations of the unknowns are determined."""
        return self.solution.rank

    @property
    def condition(self) -> float:
        """Condition number of the information, every unknown by what it moves the field by."""
        return self.solution.condition


def _angle_jacobian(angles_rad: Array) -> Array:
    """∂(α, β, γ)/∂turn for R = R3(γ) R2(β) R3(α) and exp([turn]×) R. Passive R_i(v) is the active
    rotation by −v, so turn = −(γ̇ z + β̇ R3(γ) y + α̇ R3(γ) R2(β) z)."""
    _, beta, gamma = angles_rad
    sine = np.sin(beta) if abs(np.sin(beta)) > 1e-9 else 1e-9
    about = -np.array(
        [
            [-sine * np.cos(gamma), np.sin(gamma), 0.0],
            [sine * np.sin(gamma), np.cos(gamma), 0.0],
            [np.cos(beta), 0.0, 1.0],
        ]
    )
    return np.asarray(np.linalg.inv(about))
