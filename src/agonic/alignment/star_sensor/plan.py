"""`plan_alignment`: the orientations of a session, and the standard errors to expect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from agonic.alignment.maths.two_frames import (
    GROUPS,
    SIZE,
    Measured,
    Unknowns,
    compute_information,
    compute_turn_sd,
    invert,
    make_prior,
    predict_raw,
    weigh,
)
from agonic.alignment.session.session import make_diagonal
from agonic.arrays import Array
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.health import figure
from agonic.maths.rotations.frames import ARCSEC_RAD, from_323_deg, rot_cn
from agonic.readable import Shown

Orientation = tuple[float, float, float]


def list_candidates(lowest_deg: float = 40.0) -> list[Orientation]:
    """Azimuth, elevation and roll of a star sensor that sees no horizon, degrees."""
    turns = np.arange(0.0, 360.0, 45.0)
    heights = [e for e in (90.0, 65.0, 40.0) if e > lowest_deg] + [lowest_deg]
    return [
        (float(azimuth), float(height), float(roll))
        for height in heights
        for azimuth in (turns if height < 90.0 else (0.0,))
        for roll in turns
    ]


def predict_information(at: Unknowns, like: Measured, chosen: list[Orientation]) -> Array:
    """What one more orientation each would add, JᵀC⁻¹J (j, 18, 18), as noisy as those before."""
    count = len(chosen)
    reference = np.broadcast_to(like.reference.mean(axis=0), (count, 3))
    turned = np.median(like.attitude_covariance, axis=0)
    attitude = rot_cn(*np.array(chosen).T)
    one = Measured(
        field=predict_raw(at, attitude, reference),
        reference=reference,
        rot_cn=attitude,
        attitude_covariance=np.broadcast_to(turned, (count, 3, 3)),
        noise=np.full(count, np.median(like.noise)),
        reference_noise=np.full(count, np.median(like.reference_noise)),
    )
    return compute_information(at, one)


def choose_additions(
    information: Array,
    each: Array,
    chosen: list[Orientation],
    prior: Array,
    magnitude: float,
) -> Iterator[tuple[float, int]]:
    """Which of `chosen` to add one after the other, each the one that shrinks the worst most, and
    before it the largest standard error, nT, of a combination of the free unknowns. `information`
    (18, 18) and `prior` (18,) are what is known already."""
    known = weigh(information, prior, magnitude)
    parts = weigh(each, np.where(np.isfinite(prior), 0.0, np.inf), magnitude)
    added: set[int] = set()
    while True:
        worst = float(1 / np.sqrt(max(np.linalg.eigvalsh(known)[0], 1e-30)))
        tried = known + parts
        floor = 1e-12 * np.trace(known + parts.mean(axis=0)) * np.eye(len(known))
        volume = np.trace(np.linalg.inv(tried + floor), axis1=1, axis2=2)
        if len(added) < len(chosen):  # none twice before all were taken
            volume[list(added)] = np.inf
        best = int(np.argmin(volume))
        yield worst, best
        added.add(best)
        known = known + parts[best]


def describe_combination(combination: Array, at: Unknowns, like: Measured) -> str:
    """A combination (18,) of the unknowns in words, the groups with the largest shares first; those
    below a twentieth are not named."""
    field_n = at.rot_nr @ like.reference.mean(axis=0)
    along_n = field_n / np.linalg.norm(field_n)
    shares = {g: float((combination[rows] ** 2).sum()) for g, rows in GROUPS.items()}
    named = sorted((g for g in shares if shares[g] > 0.05), key=lambda g: -shares[g])
    return " together with ".join(
        _words(group, combination[GROUPS[group]], along_n, like) for group in named
    )


def _words(group: str, part: Array, along_n: Array, like: Measured) -> str:
    """One group's part of a combination."""
    if group == "matrix":
        gain = abs(part[:3].sum()) / np.sqrt(3) / np.linalg.norm(part)
        return "the common gain of the magnetometer" if gain > 0.9 else "the magnetometer's matrix"
    unit = part / np.linalg.norm(part)
    if group in ("reference", "pier"):
        what = "a turn of the reference about" if group == "reference" else "the pier offset along"
        if abs(unit @ along_n) > 0.99:
            return f"{what} the field"
        return f"{what} {_direction(unit, ('north', 'east', 'down'))}"
    mean = like.field.mean(axis=0)
    fixed = np.linalg.norm(mean) > 0.9 * np.linalg.norm(like.field, axis=1).mean()
    what = "the turn of the alignment about" if group == "alignment" else "the bias along"
    if fixed and abs(unit @ mean) > 0.98 * np.linalg.norm(mean):
        return f"{what} the field, which is the same in all orientations"
    return f"{what} {_direction(unit, ('x', 'y', 'z'))}"


def _direction(unit: Array, axes: tuple[str, str, str]) -> str:
    """A direction by its components along named axes; up to its sign."""
    unit = unit * np.sign(unit[np.argmax(np.abs(unit))])
    parts = [
        f"{figure(float(c))} {axis}" for c, axis in zip(unit, axes, strict=True) if abs(c) > 0.1
    ]
    return axes[int(np.argmax(unit))] if unit.max() > 0.99 else "(" + ", ".join(parts) + ")"


MIN_ORIENTATIONS, MAX_ORIENTATIONS = 4, 120
"""Of a plan; with fewer nothing shows a mistake."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AlignmentPlan:
    """Orientations to take, in order, and the standard errors to expect.

    `orientations` are azimuth, elevation and roll of the star sensor, degrees (roll 0: its first
    axis points to the horizon below); `readings` how many of each instrument in each; `sd_arcsec`
    (k,) the alignment's about its worst axis after 1, 2, … orientations, infinite until it is
    determined; `sd` (18,) of all unknowns at the end, rad and nT.
    """

    orientations: tuple[Orientation, ...]
    readings: Annotated[int, Shown()]
    solve: Annotated[tuple[str, ...], Shown()]
    field_n: Annotated[Array, Shown(key="field_n_nT")]
    wanted_sd_arcsec: float
    sd_arcsec: Annotated[Array, Shown()]
    sd: Annotated[Array, Shown()]

    @property
    def worst_sd_arcsec(self) -> Annotated[float, Shown()]:
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
    sds = (wanted_sd_arcsec, noise, reference_noise, across_sd_arcsec, about_sd_arcsec)
    if readings < 1 or not all(sd > 0 for sd in sds) or not 0 <= lowest_elevation_deg < 90:
        raise AgonicError(
            "a plan needs at least one reading, noise and wanted standard error above 0, and a "
            "lowest elevation from 0 to 90°"
        )
    for group in solve:
        check_choice("solve", group, tuple(GROUPS))
    field = np.asarray(field_n, dtype=np.float64)
    magnitude = float(np.linalg.norm(field))
    at = Unknowns(rot_mc=from_323_deg(*mounting_deg))
    root = np.sqrt(readings)
    like = Measured(
        field=field[None],
        reference=field[None],
        rot_cn=np.eye(3)[None],
        attitude_covariance=make_diagonal(across_sd_arcsec, about_sd_arcsec)[None] / readings,
        noise=np.array([noise / root]),
        reference_noise=np.array([reference_noise / root]),
    )
    prior = make_prior({"alignment", *solve}, pier_sd, reference_sd_arcsec)
    chosen = list_candidates(lowest_elevation_deg)
    each, known = predict_information(at, like, chosen), np.zeros((SIZE, SIZE))
    picked, worst = [], []
    for _, k in choose_additions(known, each, chosen, prior, magnitude):
        picked.append(chosen[k])
        known = known + each[k]
        covariance = invert(known, prior)
        sd = compute_turn_sd(covariance) / ARCSEC_RAD
        worst.append(sd if sd < 36_000 else np.inf)
        enough = len(picked) >= MIN_ORIENTATIONS and sd <= wanted_sd_arcsec
        if enough or len(picked) == MAX_ORIENTATIONS:
            break
    if sd > wanted_sd_arcsec:
        left = f"{sd:.2g}″" if np.isfinite(worst[-1]) else "undetermined"
        raise CoverageError(
            f"{MAX_ORIENTATIONS} orientations leave the alignment at {left}, not "
            f"{wanted_sd_arcsec:g}″; take more readings, a better star sensor or pier difference",
            undetermined=f"the alignment to {wanted_sd_arcsec:g}″",
        )
    return AlignmentPlan(
        orientations=tuple(picked),
        readings=readings,
        solve=tuple(g for g in GROUPS if np.isfinite(prior[GROUPS[g]]).all()),
        field_n=field,
        wanted_sd_arcsec=wanted_sd_arcsec,
        sd_arcsec=np.array(worst),
        sd=np.sqrt(np.diag(covariance)),
    )
