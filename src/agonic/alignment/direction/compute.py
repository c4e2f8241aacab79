"""The direction of the field at every reading, from an alignment and attitudes among the stars."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.direction.result import FieldDirection
from agonic.alignment.session.earth import EarthRotation, load_earth_rotation
from agonic.alignment.session.observed import average_attitudes
from agonic.alignment.session.session import PRESENT, Site, StarReadings, compute_unix_s
from agonic.arrays import Array, Index, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import select_columns
from agonic.calibration.steps import AnyCalibration, find_step, require_calibration, steps_of
from agonic.errors import AgonicError, FrameError
from agonic.maths.rotations.frames import rot_en
from agonic.maths.rotations.vectors import skew
from agonic.samples import Samples

SAME_MOMENT_S = 1e-6
"""Times that differ by less are one: tables are written to a microsecond."""


def field_direction(
    alignment: AnyCalibration,
    samples: Samples,
    stars: StarReadings,
    site: Site | None = None,
    *,
    noise: float | None = None,
    gap_s: float | None = None,
    earth: EarthRotation | None = None,
) -> FieldDirection:
    """The field in the axes of the stars, of the Earth and of the place, a row a reading.

        B_c = R_cm W (raw − b),   B_i = R_icᵀ… B_c,   B_e = R_ei B_i,   B_n = R_neᵀ B_e

    with the attitude R_ci interpolated to the reading's moment. The standard errors have those of
    the alignment and calibration, of the attitude, and the noise of a reading.

    Parameters
    ----------
    alignment : `Alignment` or `Chain` into the axes of the star sensor, from `fit_alignment`.
    samples : (n,) readings of the magnetometer, with dates.
    stars : (m,) attitudes, in order of time; a covariance is needed.
    site : where the instruments stand. Without, the samples' own positions give north, east and
        down (square to the ellipsoid), and without those there is none.
    noise : standard deviation of one reading on one axis, nT; `None`: the calibration's own, or 0.
    gap_s : attitudes further apart are not joined; `None`: five times their usual interval.
    earth : the table of the Earth's rotation; `None`: the installed one.

    Returns a `FieldDirection`; readings without attitude are left out and counted. Raises
    `AgonicError` where none is left or the attitudes' errors are not known, `FrameError` where the
    alignment ends in other axes than c, and `ValidityError` outside the table of the Earth's
    rotation.

    Source: CN108871301B, equations 1 to 9; IERS Conventions (2010), chapter 5.

    >>> import agonic as ag
    >>> night = ag.alignment.simulate_session(seed=1).session
    >>> fit = ag.fit_alignment(night)
    >>> found = field_direction(fit.calibration, night.magnetometer, night.star, night.site)
    >>> len(found), round(float(found.declination_deg.mean()), 1)
    (456, 4.2)
    """
    known = require_into_stars(alignment)
    gap = choose_gap(stars) if gap_s is None else gap_s
    found = compute_direction(known, samples, stars, site, noise, gap, earth)
    if found is None:
        moments = compute_unix_s(samples)
        raise AgonicError(
            f"none of {len(samples)} readings has an attitude: the readings run from "
            f"{moments.min():.1f} to {moments.max():.1f} and the attitudes from "
            f"{stars.time[0]:.1f} to {stars.time[-1]:.1f} UTC seconds since 1970; check dates and "
            "time zones, or allow longer gaps"
        )
    return found


def require_into_stars(alignment: AnyCalibration) -> AnyCalibration:
    """The calibration, which must end in the axes of a star sensor."""
    known = require_calibration(alignment)
    if known.frame_out != "c":
        raise FrameError(
            "the direction of the field needs an alignment with a star sensor (agonic fit "
            "alignment)",
            left=known.frame_out,
            right="c",
        )
    return known


def compute_direction(
    known: AnyCalibration,
    samples: Samples,
    stars: StarReadings,
    site: Site | None,
    noise: float | None,
    gap_s: float,
    earth: EarthRotation | None = None,
) -> FieldDirection | None:
    """The direction at the readings that have an attitude, or `None` where none has."""
    earth = earth or load_earth_rotation()
    moments, covariance, straight = compute_unix_s(samples), require_covariance(stars), stars.rot_ci
    if PRESENT in (stars.refraction, stars.aberration):
        if site is None:
            raise AgonicError(
                "refraction or aberration is still in the attitudes; the place is needed to take "
                "it out"
            )
        straight = average_attitudes(site, stars, earth)[0]
    rows, rot_ci, spread = interpolate_attitudes(
        moments, stars.time, straight, covariance, stars.orientation, gap_s
    )
    if not len(rows):
        return None
    seen, time = samples.select(rows), moments[rows]
    field_c, common, notes = _correct(known, seen)
    white = _choose_noise(known, noise) ** 2 * np.eye(3)
    across = skew(field_c)
    random = across @ spread @ np.swapaxes(across, 1, 2) + white
    rot_ic, rot_ei = np.swapaxes(rot_ci, 1, 2), earth.rot_ei(time)
    field_i, covariance_i = _turn(rot_ic, field_c), _turn_covariance(rot_ic, common + random)
    rot_ni, latitude, longitude = None, seen.latitude_deg, seen.longitude_deg
    if site is not None:
        rot_ni = rot_en(site.latitude_deg, site.longitude_deg).T @ rot_ei
    elif latitude is not None and longitude is not None:
        rot_ni = np.swapaxes(rot_en(latitude, longitude), 1, 2) @ rot_ei
    else:
        notes += ("no place is known, so north, east and down cannot be computed",)
    return FieldDirection(
        rows=rows,
        time=time,
        field_c=field_c,
        field_i=field_i,
        field_e=_turn(rot_ei, field_i),
        field_n=None if rot_ni is None else _turn(rot_ni, field_i),
        covariance_i=covariance_i,
        covariance_n=None if rot_ni is None else _turn_covariance(rot_ni, covariance_i),
        random_covariance_i=_turn_covariance(rot_ic, random),
        left_out=len(samples) - len(rows),
        sensor=samples.name,
        notes=notes,
    )


def require_covariance(stars: StarReadings) -> Array:
    if stars.covariance is None:
        raise AgonicError(
            "the errors of the attitudes are not known; give the standard errors of one attitude "
            "across and about the boresight (across_sd_arcsec, about_sd_arcsec)"
        )
    return stars.covariance


def choose_gap(stars: StarReadings) -> float:
    """Five times the usual interval of the attitudes within an orientation, s."""
    same = np.diff(stars.orientation) == 0
    steps = np.diff(stars.time)[same]
    return 5.0 * float(np.median(steps)) if len(steps) else np.inf


def _correct(known: AnyCalibration, samples: Samples) -> tuple[Array, Array, tuple[str, ...]]:
    """The field (n, 3) in star sensor axes, its covariance, and what is not in that."""
    columns, raw = select_columns(known, samples), samples.field
    field = known.correct(raw, **columns)
    bare = [step.kind for step in steps_of(known) if step.covariance is None]
    if bare:
        lacking = f"the standard errors leave out those of {' and '.join(bare)}: it states none"
        return field, np.zeros((len(raw), 3, 3)), (lacking,)
    return field, known.uncertainty(raw, **columns), ()


def _choose_noise(known: AnyCalibration, noise: float | None) -> float:
    """Standard deviation of one reading on one axis, nT: given, or the calibration's own."""
    own = find_step(known, Affine)
    if noise is not None or own is None or own.noise is None:
        return noise or 0.0
    return own.noise * float(np.cbrt(abs(np.linalg.det(own.matrix))))


def _turn(rotation: Array, vectors: Array) -> Array:
    """Rotations (n, 3, 3) of vectors (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", rotation, vectors))


def _turn_covariance(rotation: Array, covariance: Array) -> Array:
    """Covariances (n, 3, 3) in the axes that rotations (n, 3, 3) lead to."""
    return np.asarray(rotation @ covariance @ np.swapaxes(rotation, 1, 2))


def interpolate_attitudes(
    moments: Array, time: Array, rotation: Array, covariance: Array, number: Index, gap_s: float
) -> tuple[Index, Array, Array]:
    """Attitudes at moments (n,) from those read at times (m,), in order: the rows of the moments
    (k,) that have one, matrices (k, 3, 3) and covariances (k, 3, 3), rad².

        R(t) = exp(s θ) R₀,   θ = log(R₁ R₀ᵀ),   s = (t − t₀) / (t₁ − t₀)        (slerp)
        C(t) = (1 − s)² C₀ + s² C₁ + (s(1 − s)/2)² d dᵀ

    d is the second difference of the neighbours where it stands out of their noise: what a platform
    that speeds up does between two readings. A moment at which an attitude was read has that one.
    Other moments outside the times, in a gap of more than `gap_s`, or between readings of different
    `number` (m,) have no attitude and are left out.

    Source: Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985.
    """
    after, read, between = find_neighbours(moments, time, number, gap_s)
    joined = are_joined(time, number, gap_s)
    rows = np.flatnonzero(read | between)
    right = after[rows]
    left = np.where(read[rows], right, right - 1)
    step = np.where(read[rows], 1.0, time[right] - time[left])
    share = np.where(read[rows], 0.0, (moments[rows] - time[left]) / step)[:, None]
    turn = Rotation.from_matrix(rotation[1:] @ np.swapaxes(rotation[:-1], 1, 2)).as_rotvec()
    change = _second_differences(turn, time, covariance, joined)
    turn, change = (np.concatenate([each, np.zeros((1, 3))])[left] for each in (turn, change))
    attitude = Rotation.from_rotvec(share * turn).as_matrix() @ rotation[left]
    s = share[:, :, None]
    spread = (1 - s) ** 2 * covariance[left] + s**2 * covariance[right]
    bend = (s * (1 - s) / 2) * change[:, :, None]
    return rows, attitude, spread + bend @ np.swapaxes(bend, 1, 2)


def are_joined(time: Array, number: Index, gap_s: float) -> Mask:
    """Whether attitudes (m,) are interpolated to the next, (m − 1,)."""
    return np.asarray((np.diff(time) <= gap_s) & (np.diff(number) == 0))


def find_neighbours(
    moments: Array, time: Array, number: Index, gap_s: float
) -> tuple[Index, Mask, Mask]:
    """The attitude at or after each moment (n,), whether one was read then, and whether the moment
    lies between two that are joined."""
    after = np.minimum(np.searchsorted(time, moments - SAME_MOMENT_S), len(time) - 1)
    read = np.abs(time[after] - moments) <= SAME_MOMENT_S
    between = (moments > time[0]) & (moments < time[-1])
    between[between] = are_joined(time, number, gap_s)[after[between] - 1]
    return after, read, between


def _second_differences(turn: Array, time: Array, covariance: Array, joined: Mask) -> Array:
    """By how much the turn of each interval differs from its joined neighbours' (m − 1, 3), rad.
    Differences within three standard deviations of the attitudes' own noise are zero: for equal
    steps their variance is that of R₀ − 2R₁ + R₂, six times one attitude's."""
    step = np.diff(time)[:, None]
    rate = turn / step
    change = np.zeros_like(turn)
    difference = np.abs(np.diff(rate, axis=0)) * (step[:-1] + step[1:]) / 2
    difference *= (joined[:-1] & joined[1:])[:, None]
    change[1:] = difference
    change[:-1] = np.maximum(change[:-1], difference)
    noise = 6 * np.diagonal(covariance, axis1=1, axis2=2)
    return np.where(change**2 > 9.0 * np.maximum(noise[:-1], noise[1:]), change, 0.0)
