"""`Observed`: a session as one observation an orientation, on which every fit rests.

The platform stands still while its orientation lasts, so all relations are linear in means: nothing
is lost, whatever the rates of the three instruments.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from agonic.alignment.session.earth import EarthRotation, load_earth_rotation
from agonic.alignment.session.session import PRESENT, Session, Site, StarReadings, compute_unix_s
from agonic.arrays import Array, Index
from agonic.errors import AgonicError
from agonic.maths.earth.starlight import apply_aberration, apply_refraction, observer_velocity_i
from agonic.maths.rotations.frames import rot_en
from agonic.maths.rotations.vectors import find_smallest_rotation


@dataclass(frozen=True, kw_only=True, eq=False)
class Observed:
    """What each of k orientations says: means, and the covariances of the means.

    Parameters
    ----------
    orientation : (k,) numbers. time : (k,) UTC seconds since 1970.
    field : (k, 3) of the magnetometer, nT. reference : (k, 3) in the reference's axes, at the same
        moments.
    rot_cn : (k, 3, 3) north-east-down into star sensor components.
    star_covariance : (k, 3, 3) rad², camera axes. noise, reference_noise : (k,) nT.
    boresight_i : (k, 3). readings : (k, 2) of star sensor and magnetometer.
    star_noise : (2,) rad, of one reading across and about the boresight: the scatter within
        orientations, NaN where there is none to tell.
    """

    orientation: NDArray[np.int64]
    time: Array
    field: Array
    reference: Array
    rot_cn: Array
    star_covariance: Array
    noise: Array
    reference_noise: Array
    boresight_i: Array
    readings: NDArray[np.int64]
    star_noise: Array

    def __len__(self) -> int:
        return len(self.orientation)

    @property
    def boresight_n(self) -> Array:
        """Where the star sensor looks, (k, 3) north, east, down."""
        return self.rot_cn[:, 2]

    @property
    def elevation_deg(self) -> Array:
        """How high it looks."""
        return np.asarray(np.degrees(np.arcsin(np.clip(-self.boresight_n[:, 2], -1, 1))))


def observe(session: Session, earth: EarthRotation | None = None) -> Observed:
    """The session as one observation an orientation.

        rot_cn = rot_ci · rot_eiᵀ · rot_en

    of every star reading, averaged over the orientation as rotation vectors. Raises `AgonicError`
    where neither a standard deviation is stated nor the scatter tells it, and `ValidityError`
    outside the table of the Earth's rotation.
    """
    star, site = session.star, session.site
    attitude, rot_ei = average_attitudes(site, star, earth or load_earth_rotation())
    rot_ne = rot_en(site.latitude_deg, site.longitude_deg).T
    rot_cn = attitude @ np.swapaxes(rot_ne @ rot_ei, 1, 2)
    rows = _rows(star.orientation, session.orientations)
    first = rot_cn[[own[0] for own in rows]]
    turns = _turns(rot_cn, first, rows)
    star_noise = _star_scatter(turns, rows)
    means, spreads = _means(turns, _covariance(star, star_noise), rows)
    fields = _Fields(session)
    boresight = np.array([attitude[own, 2].mean(axis=0) for own in rows])
    return Observed(
        orientation=session.orientations,
        time=np.array([star.time[own].mean() for own in rows]),
        field=fields.field,
        reference=fields.reference,
        rot_cn=Rotation.from_rotvec(means).as_matrix() @ first,
        star_covariance=spreads,
        noise=fields.sd(session.noise, 0, "magnetometer") / np.sqrt(fields.counts),
        reference_noise=fields.sd(session.reference_noise, 1, "reference") * fields.weight,
        boresight_i=boresight / np.linalg.norm(boresight, axis=1, keepdims=True),
        readings=np.stack([[len(own) for own in rows], fields.counts], axis=1),
        star_noise=star_noise,
    )


def average_attitudes(site: Site, star: StarReadings, earth: EarthRotation) -> tuple[Array, Array]:
    """True attitudes rot_ci (n, 3, 3), with what the air and motion did taken out, and rot_ei.

    The sensor sees a star of direction u at Q u and reports rot_ci Q, so rot_ci = reported Qᵀ.
    """
    rotation_ei = earth.rot_ei(star.time)
    turn = compute_apparent_turn(site, star, rotation_ei)
    return star.rot_ci @ np.swapaxes(turn, 1, 2), rotation_ei


def compute_apparent_turn(site: Site, star: StarReadings, rotation_ei: Array) -> Array:
    """Q (n, 3, 3): from where the boresight's stars are to where they are seen, inertial."""
    rotation_in = np.swapaxes(rotation_ei, 1, 2) @ rot_en(site.latitude_deg, site.longitude_deg)
    seen = star.boresight_i
    if star.aberration == PRESENT:
        east = rotation_in[:, :, 1]
        seen = apply_aberration(seen, observer_velocity_i(star.time, east, site.latitude_deg))
    if star.refraction == PRESENT:
        seen = apply_refraction(seen, -rotation_in[:, :, 2], site.air)
    return find_smallest_rotation(star.boresight_i, seen)


def _rows(numbers: NDArray[np.int64], wanted: NDArray[np.int64]) -> list[Index]:
    """The rows of each orientation."""
    return [np.flatnonzero(numbers == number) for number in wanted]


def _sum_each(values: Array, rows: list[Index]) -> Array:
    """Sums of values (n, …) over the rows of each orientation, (k, …)."""
    first = np.cumsum([0, *(len(own) for own in rows[:-1])])
    return np.asarray(np.add.reduceat(values[np.concatenate(rows)], first, axis=0))


def _turns(rot_cn: Array, first: Array, rows: list[Index]) -> Array:
    """Rotation vectors (n, 3), camera axes, from the first attitude of its orientation to each."""
    from_first = rot_cn.copy()
    for own, start in zip(rows, first, strict=True):
        from_first[own] = rot_cn[own] @ start.T
    return np.asarray(Rotation.from_matrix(from_first).as_rotvec())


def _means(turns: Array, covariance: Array, rows: list[Index]) -> tuple[Array, Array]:
    """The weighted mean of the turns of each orientation, (k, 3), and their covariances."""
    weights = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    information = _sum_each(weights, rows)
    spreads = np.asarray(np.linalg.inv(information), dtype=np.float64)
    weighted = _sum_each((weights @ turns[..., None])[..., 0], rows)
    return (spreads @ weighted[..., None])[..., 0], spreads


def _star_scatter(turns: Array, rows: list[Index]) -> Array:
    """Standard deviation of one attitude, across and about the boresight, rad."""
    squares = np.sum([((turns[own] - turns[own].mean(axis=0)) ** 2).sum(0) for own in rows], axis=0)
    freedom = sum(len(own) - 1 for own in rows)
    if freedom < 3:
        return np.full(2, np.nan)
    return np.sqrt(np.array([(squares[0] + squares[1]) / 2, squares[2]]) / freedom)


def _covariance(star: StarReadings, scatter: Array) -> Array:
    """What is stated of every attitude, or else what the scatter tells."""
    if star.covariance is not None:
        return star.covariance
    if not np.isfinite(scatter).all() or scatter.min() <= 0:
        raise AgonicError(
            "the star sensor's noise is neither stated nor shown by repeated readings; give "
            "across_sd_arcsec and about_sd_arcsec"
        )
    return np.broadcast_to(np.diag(scatter[[0, 0, 1]] ** 2), star.rot_ci.shape)


class _Fields:
    """Magnetometer and reference by orientation: means, counts, scatter."""

    def __init__(self, session: Session) -> None:
        time, reference_time = (
            compute_unix_s(session.magnetometer),
            compute_unix_s(session.reference),
        )
        raw, station = session.corrected, session.magnetometer.station
        assert station is not None, "checked when the session is"
        self.rows = _rows(station.astype(np.int64), session.orientations)
        parts = [_find_weights(time[rows], reference_time) for rows in self.rows]
        beside = session.reference.field
        self.field = np.array([raw[rows].mean(axis=0) for rows in self.rows])
        self.reference = np.array([weights @ beside[at] for at, weights in parts])
        self.weight = np.array([float(np.sqrt((w**2).sum())) for _, w in parts])
        self.counts = np.array([len(rows) for rows in self.rows])
        self.scatter = np.array(
            [
                _scatter([(time[rows], raw[rows]) for rows in self.rows]),
                _scatter([(reference_time[at], beside[at]) for at, _ in parts]),
            ]
        )

    def sd(self, stated: float | None, which: int, name: str) -> Array:
        """Standard deviation of a reading, stated or from the scatter."""
        value = self.scatter[which] if stated is None else stated
        if not np.isfinite(value):
            raise AgonicError(
                f"the noise of the {name} is neither stated nor shown by repeated readings; give "
                "noise_nT"
            )
        return np.full(len(self.rows), float(value))


def _find_weights(time: Array, known: Array) -> tuple[Index, Array]:
    """Rows of the known times and their weights in the mean of linear interpolations at `time`."""
    right = np.clip(np.searchsorted(known, time), 1, max(len(known) - 1, 1))
    if len(known) == 1:
        return np.zeros(1, dtype=np.intp), np.ones(1)
    share = (time - known[right - 1]) / (known[right] - known[right - 1])
    share = np.clip(share, 0.0, 1.0)
    rows, at = np.unique(np.concatenate([right - 1, right]), return_inverse=True)
    weights = np.bincount(at, np.concatenate([1 - share, share])) / len(time)
    used = weights > 0
    return rows[used], weights[used]


def _scatter(parts: list[tuple[Array, Array]]) -> float:
    """Standard deviation of one reading on one axis about straight lines in time, pooled."""
    squares, freedom = 0.0, 0
    for time, values in parts:
        if len(time) < 4:
            continue
        along = np.stack([np.ones(len(time)), time - time.mean()], axis=1)
        left = values - along @ np.linalg.lstsq(along, values, rcond=None)[0]
        squares += float((left**2).sum())
        freedom += 3 * (len(time) - 2)
    return float(np.sqrt(squares / freedom)) if freedom >= 6 else float("nan")
