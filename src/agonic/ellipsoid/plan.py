"""`plan_calibration`: how finely to turn a vehicle, and what each step will tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.maths.equation.affine import dip_residual, magnitude_residual, model_basis
from agonic.maths.equation.coverage import heading_sd_deg
from agonic.maths.equation.priors import make_prior
from agonic.maths.estimation.leastsq import inverse
from agonic.maths.rotations.attitude import rot_nb
from agonic.readable import Shown

STEPS_DEG = (90.0, 60.0, 45.0, 30.0, 20.0, 15.0, 10.0, 5.0)
"""Steps of rotation that are looked at, from the coarsest."""
FREE_DEG = 90.0
"""From this tilt on the vehicle can be turned right over."""
SOFT_IRON_SD = 0.1
"""The prior of `fit_ellipsoid`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedSets:
    """Three sets of readings, one about each axis, at one step of rotation.

    Parameters
    ----------
    step_deg : between readings. positions : in all three sets. readings : at each position, so
        that the wanted accuracy is met; 1 where none is wanted or the heading is not determined.
    attitudes_deg : (k, 3) roll, pitch, heading of the positions.
    bias_sd : (3,) nT and matrix_sd : (6,) of xx yy zz xy xz yz, by the Cramér–Rao bound.
    heading_sd_deg : of a level vehicle, rms over all headings.
    prior_share : how much of the heading's variance only the prior on soft iron limits, 0…1.
    """

    step_deg: Annotated[float, Shown()]
    positions: Annotated[int, Shown()]
    readings: Annotated[int, Shown()]
    attitudes_deg: Array
    bias_sd: Annotated[Array, Shown(key="bias_sd_nT")]
    matrix_sd: Annotated[Array, Shown()]
    heading_sd_deg: Annotated[float, Shown()]
    prior_share: float

    @property
    def determined(self) -> Annotated[bool, Shown()]:
        """Whether the readings tell more of the heading than the prior does."""
        return self.prior_share < 0.5


def plan_calibration(
    *,
    magnitude: float = 48_000.0,
    inclination_deg: float = 65.0,
    noise: float = 300.0,
    tilt_deg: float = 180.0,
    attitude_sd_deg: float | None = None,
    wanted_deg: float | None = None,
    steps_deg: Sequence[float] = STEPS_DEG,
) -> tuple[PlannedSets, ...]:
    """What three sets of readings about the three axes will tell, for each step of rotation.

        C = (Σ JᵀJ/σ² + P)⁻¹,   J the magnitude's and, with attitude, the dip's derivatives

    A vehicle that can be turned over is turned about its down, forward and right axes. One that
    tilts by less than 90° goes round level, then round with its nose up and with its side down by
    `tilt_deg`.

    Parameters
    ----------
    magnitude, inclination_deg : of the field. noise : standard deviation of one reading, nT.
    tilt_deg : how far the vehicle can be tilted; 0 is not at all.
    attitude_sd_deg : how well roll and pitch of each reading are known; `None`: not at all, so
        that only the magnitude counts.
    wanted_deg : standard error of the heading wanted; sets how many `readings` each position needs.
    steps_deg : the steps of rotation.

    Returns the sets, the coarsest first. Raises `AgonicError` for numbers that no vehicle has.

    Source: the three sets of n readings of the heading system's calibration; Cramér (1946),
    Mathematical Methods of Statistics, chapter 32.

    >>> coarse, fine = plan_calibration(steps_deg=(30, 10))
    >>> coarse.positions, fine.positions, coarse.heading_sd_deg > 1.5 * fine.heading_sd_deg
    (36, 108, True)
    """
    if not (magnitude > 0 and noise > 0 and abs(inclination_deg) < 89 and 0 <= tilt_deg <= 180):
        raise AgonicError(
            "a plan needs a magnitude and a noise above 0 nT, an inclination within ±89° and a "
            f"tilt from 0 to 180°; given were {magnitude:g}, {noise:g}, {inclination_deg:g} and "
            f"{tilt_deg:g}"
        )
    if wrong := [step for step in steps_deg if not 0 < step <= 120]:
        raise AgonicError(f"a step of rotation is from 1° to 120°, not {wrong[0]:g}°")
    made = []
    for step in sorted(steps_deg, reverse=True):
        attitudes = _list_attitudes(step, tilt_deg)
        data = _count_information(attitudes, magnitude, inclination_deg, noise, attitude_sd_deg)
        sets = _judge(step, attitudes, data, magnitude, inclination_deg, 1)
        while sets.determined and wanted_deg is not None and sets.heading_sd_deg > wanted_deg:
            short = (sets.heading_sd_deg / wanted_deg) ** 2  # the prior helps each reading less
            readings = int(np.ceil(sets.readings * short))
            sets = _judge(step, attitudes, data * readings, magnitude, inclination_deg, readings)
        made.append(sets)
    return tuple(made)


def _list_attitudes(step_deg: float, tilt_deg: float) -> Array:
    """Roll, pitch, heading (k, 3) of the three sets."""
    around = np.arange(0.0, 360.0 - 1e-9, step_deg)
    still = np.zeros_like(around)
    level = np.stack([still, still, around], axis=1)
    if tilt_deg >= FREE_DEG:
        rolled = np.stack([around, still, still], axis=1)
        pitched = np.stack([still, around, still], axis=1)
    else:
        rolled = np.stack([still + tilt_deg, still, around], axis=1)
        pitched = np.stack([still, still + tilt_deg, around], axis=1)
    return np.concatenate([level, rolled, pitched])


def _count_information(
    attitudes_deg: Array,
    magnitude: float,
    inclination_deg: float,
    noise: float,
    attitude_sd_deg: float | None,
) -> Array:
    """Σ JᵀJ/σ² (9, 9) of one reading at each attitude, at no bias and no soft iron."""
    dip = np.radians(inclination_deg)
    horizontal, vertical = magnitude * np.cos(dip), magnitude * np.sin(dip)
    rot_bn = np.swapaxes(rot_nb(*attitudes_deg.T), 1, 2)
    field = rot_bn @ np.array([horizontal, 0.0, vertical])
    basis, here = model_basis("full"), (np.zeros(3), np.eye(3))
    _, jacobian = magnitude_residual(field, *here, magnitude)
    white = jacobian @ basis / noise
    information = white.T @ white
    if attitude_sd_deg is not None:
        _, jacobian = dip_residual(field, *here, rot_bn[:, :, 2], horizontal, vertical)
        white = jacobian @ basis / np.hypot(noise, magnitude * np.radians(attitude_sd_deg))
        information = information + white.T @ white
    return np.asarray(information)


def _judge(
    step_deg: float,
    attitudes: Array,
    data: Array,
    magnitude: float,
    inclination_deg: float,
    readings: int,
) -> PlannedSets:
    """The bound with the prior, and how much of it the prior holds."""
    prior = make_prior("full", SOFT_IRON_SD)
    assert prior is not None
    _, known = prior(np.array([0.0, 0, 0, 1, 1, 1, 0, 0, 0]))
    held = known.T @ known
    covariance = inverse(data + held)
    heading = [
        heading_sd_deg(inclination_deg, magnitude, np.eye(3), part, "symmetric")
        for part in (covariance, covariance @ held @ covariance)
    ]
    sd = np.sqrt(np.diag(covariance))
    return PlannedSets(
        step_deg=float(step_deg),
        positions=len(attitudes),
        readings=readings,
        attitudes_deg=attitudes,
        bias_sd=sd[:3],
        matrix_sd=sd[3:],
        heading_sd_deg=float(heading[0]),
        prior_share=float((heading[1] / heading[0]) ** 2),
    )
