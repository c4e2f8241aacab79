"""`plan_alignment`: the orientations of a session, and what they will tell, before the night."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from agonic.alignment.maths import two_frames as kernel
from agonic.alignment.maths.two_frames import (
    GROUPS,
    SIZE,
    Measured,
    compute_turn_sd,
    invert,
    make_prior,
)
from agonic.alignment.star_sensor.orientations import (
    Orientation,
    choose_additions,
    compute_information,
    list_candidates,
)
from agonic.arrays import Array
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.maths.rotations.frames import ARCSEC_RAD, from_323_deg

FEWEST, MOST = 4, 120
"""Orientations of a plan; with fewer nothing tells a mistake."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AlignmentPlan:
    """Orientations to take, in order, and the standard errors to expect.

    `orientations` are azimuth, elevation and roll of the star sensor, degrees (roll 0: its first
    axis points to the horizon below); `readings` how many of each instrument in each; `sd_arcsec`
    (k,) the alignment's about its worst axis after 1, 2, … orientations, infinite until it is
    determined; `sd` (18,) of all unknowns at the end, rad and nT.
    """

    orientations: tuple[Orientation, ...]
    readings: int
    solve: tuple[str, ...]
    field_n: Array
    wanted_sd_arcsec: float
    sd_arcsec: Array
    sd: Array

    @property
    def worst_sd_arcsec(self) -> float:
        """The alignment's standard error about its worst axis at the end."""
        return float(self.sd_arcsec[-1])


def plan_alignment(
    field_n: ArrayLike,
    *,
    wanted_sd_arcsec: float = 1.0,
    solve: Sequence[str] = ("alignment",),
    readings: int = 20,
    noise: float = 0.5,
    reference_noise: float = 0.3,
    across_sd_arcsec: float = 3.0,
    about_sd_arcsec: float = 20.0,
    pier_sd: float | None = None,
    reference_sd_arcsec: float | None = None,
    lowest_elevation_deg: float = 40.0,
    mounting_deg: Sequence[float] = (0.0, 0.0, 0.0),
) -> AlignmentPlan:
    """The orientations that bring the alignment to a wanted standard error, fewest first.

    Each next one is that of 136 or more, spread over the sky, which shrinks the covariance
    (Σ JᵀC⁻¹J)⁻¹ most.

    Parameters
    ----------
    field_n : (3,) the field at the site, north, east, down, nT.
    wanted_sd_arcsec : about the worst axis. solve : as in `fit_alignment`.
    readings : of each instrument in each orientation. noise, reference_noise : nT, of a reading on
        one axis. across_sd_arcsec, about_sd_arcsec : of an attitude across and about the boresight.
    pier_sd, reference_sd_arcsec : how well the difference of the piers, nT, and the axes of the
        reference are known, where they are uncertain.
    lowest_elevation_deg : the star sensor sees nothing below it.
    mounting_deg : nominal 3-2-3 angles from the star sensor to the magnetometer.

    Returns an `AlignmentPlan`. Raises `CoverageError` where no orientations reach the wanted
    standard error, and `AgonicError` for numbers that are no plan.

    Source: patent CN 108871301 B, for the residual; V. V. Fedorov, Theory of Optimal Experiments,
    Academic Press 1972, for the choice of one point after the other.

    >>> plan = plan_alignment([18_870, 1_390, 45_750], wanted_sd_arcsec=2.0)
    >>> len(plan.orientations) >= 4, plan.worst_sd_arcsec <= 2.0
    (True, True)
    """
    numbers = (wanted_sd_arcsec, noise, reference_noise, across_sd_arcsec, about_sd_arcsec)
    if readings < 1 or not all(n > 0 for n in numbers) or not 0 <= lowest_elevation_deg < 90:
        raise AgonicError(
            "a plan needs a reading or more, noise and wanted standard error above 0, and a lowest "
            "elevation from 0 to 90°"
        )
    for group in solve:
        check_choice("solve", group, tuple(GROUPS))
    field = np.asarray(field_n, dtype=np.float64)
    magnitude = float(np.linalg.norm(field))
    at = kernel.start_unknowns()._replace(rot_mc=from_323_deg(*mounting_deg))
    like = _like(field, readings, noise, reference_noise, across_sd_arcsec, about_sd_arcsec)
    prior = make_prior({"alignment", *solve}, pier_sd, reference_sd_arcsec)
    chosen = list_candidates(lowest_elevation_deg)
    each = compute_information(at, like, chosen)

    def covariance(picked: list[int]) -> Array:
        return invert(each[picked].sum(axis=0), prior)

    def enough(picked: list[int], worst: float) -> bool:
        sd = compute_turn_sd(covariance(picked)) / ARCSEC_RAD
        return len(picked) == MOST or (len(picked) >= FEWEST and sd <= wanted_sd_arcsec)

    picked = choose_additions(np.zeros((SIZE, SIZE)), each, chosen, prior, magnitude, enough)
    sds = [compute_turn_sd(covariance(picked[:k])) / ARCSEC_RAD for k in range(1, len(picked) + 1)]
    if sds[-1] > wanted_sd_arcsec:
        raise CoverageError(
            f"{MOST} orientations leave the alignment at {_said(sds[-1])}, not "
            f"{wanted_sd_arcsec:g}″; take more readings, a better star sensor or pier difference",
            undetermined=f"the alignment to {wanted_sd_arcsec:g}″",
        )
    return AlignmentPlan(
        orientations=tuple(chosen[k] for k in picked),
        readings=readings,
        solve=tuple(g for g in GROUPS if np.isfinite(prior[GROUPS[g]]).all()),
        field_n=field,
        wanted_sd_arcsec=wanted_sd_arcsec,
        sd_arcsec=np.array([sd if sd < 36_000 else np.inf for sd in sds]),
        sd=np.sqrt(np.diag(covariance(picked))),
    )


def _like(
    field: Array, readings: int, noise: float, reference_noise: float, across: float, about: float
) -> Measured:
    """One orientation of the kind that is planned."""
    root = np.sqrt(readings)
    star = np.diag((np.array([across, across, about]) * ARCSEC_RAD / root) ** 2)
    return Measured(
        field=field[None],
        reference=field[None],
        rot_cn=np.eye(3)[None],
        attitude_covariance=star[None],
        noise=np.array([noise / root]),
        reference_noise=np.array([reference_noise / root]),
    )


def _said(sd_arcsec: float) -> str:
    return "undetermined" if sd_arcsec > 36_000 else f"{sd_arcsec:.2g}″"
