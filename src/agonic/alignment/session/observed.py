"""`Observed`: a session as one observation an orientation, on which every fit rests."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from agonic.alignment.maths.columns import (
    Stretches,
    average,
    average_stretches,
    find_rows,
    sum_each,
)
from agonic.alignment.maths.two_frames import (
    MAX_ROUNDS,
    Measured,
    Solution,
    compute_rotation_vector,
    make_prior,
    solve,
)
from agonic.alignment.session.earth import EarthRotation, load_earth_rotation
from agonic.alignment.session.laboratory import NorthSession
from agonic.alignment.session.session import PRESENT, Session, Site, StarReadings, put_on_clock
from agonic.arrays import Array, Index
from agonic.errors import AgonicError
from agonic.maths.earth.starlight import apply_aberration, apply_refraction, observer_velocity_i
from agonic.maths.rotations.frames import ARCSEC_RAD, rot_en
from agonic.maths.rotations.vectors import find_smallest_rotation
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class Observed:
    """What each of k orientations says: its number (k,), time (k,) UTC seconds since 1970, the
    means with what they are uncertain by, the boresight (k, 3), and the readings (k, 2) of star
    sensor and magnetometer. `star_noise` (2,) rad is that of one reading across and about the
    boresight: the scatter within orientations, NaN without any."""

    orientation: NDArray[np.int64]
    time: Array
    measured: Measured
    boresight_i: Array
    readings: NDArray[np.int64]
    star_noise: Array

    def __len__(self) -> int:
        return len(self.orientation)

    @property
    def boresight_n(self) -> Array:
        """Where the star sensor looks, (k, 3) north, east, down."""
        return self.measured.rot_cn[:, 2]

    @property
    def elevation_deg(self) -> Array:
        """How high it looks."""
        return np.asarray(np.degrees(np.arcsin(np.clip(-self.boresight_n[:, 2], -1, 1))))


def observe(session: Session, assumed_sd_arcsec: float | None = None) -> Observed:
    """The session as one observation an orientation, of every star reading

        rot_cn = rot_ci · rot_eiᵀ · rot_en,

    averaged over the orientation as rotation vectors. Raises `AgonicError` where noise is neither
    stated nor seen nor `assumed`, `ValidityError` outside the table of the Earth's rotation."""
    star, site = session.star, session.site
    attitude, rot_ei = average_attitudes(site, star, load_earth_rotation())
    rot_ne = rot_en(site.latitude_deg, site.longitude_deg).T
    rot_cn = attitude @ np.swapaxes(rot_ne @ rot_ei, 1, 2)
    rows = find_rows(star.orientation, session.orientations)
    first, from_first = rot_cn[[own[0] for own in rows]], rot_cn.copy()
    for own, start in zip(rows, first, strict=True):
        from_first[own] = rot_cn[own] @ start.T
    turns = compute_rotation_vector(from_first)  # camera axes, from the first attitude there
    star_noise = _measure_star_noise(turns, rows)
    if assumed_sd_arcsec is not None:
        star_noise = np.full(2, assumed_sd_arcsec * ARCSEC_RAD)
    weights = np.asarray(np.linalg.inv(_choose_covariance(star, star_noise)), dtype=np.float64)
    spreads = np.asarray(np.linalg.inv(sum_each(weights, rows)), dtype=np.float64)
    means = (spreads @ sum_each(weights @ turns[..., None], rows))[..., 0]
    station = session.magnetometer.station
    assert station is not None, "checked when the session is"
    stood = find_rows(station.astype(np.int64), session.orientations)
    fields = average_beside(stood, session.magnetometer, session.corrected, session.reference)
    boresight = average(attitude[:, 2], rows)
    rotation = Rotation.from_rotvec(means).as_matrix() @ first
    return Observed(
        orientation=session.orientations,
        time=average(star.time, rows),
        measured=make_measured(session, fields, rotation, spreads),
        boresight_i=boresight / np.linalg.norm(boresight, axis=1, keepdims=True),
        readings=np.stack([[len(own) for own in rows], fields.counts], axis=1),
        star_noise=star_noise,
    )


def average_beside(
    rows: list[Index], samples: Samples, field: Array, reference: Samples | None
) -> Stretches:
    """Means of a field (n, 3) over the rows of each stretch, beside a reference where both have
    times; without times rows count as seconds."""
    time = np.arange(float(len(field))) if samples.time is None else samples.time
    if reference is None or reference.time is None or samples.time is None:
        return average_stretches(rows, time, field)
    return average_stretches(rows, time, field, (put_on_clock(reference, samples), reference.field))


def make_measured(
    session: Session | NorthSession, fields: Stretches, rot_cn: Array, covariance: Array
) -> Measured:
    """Means with the attitudes (k, 3, 3) of their orientations; noise as stated, or by scatter."""
    beside = fields.beside
    assert beside is not None, "averaged with the reference"
    noises = []
    for stated, scatter, name in (
        (session.noise, fields.scatter, "magnetometer"),
        (session.reference_noise, beside.scatter, "reference"),
    ):
        noises.append(float(np.sqrt((scatter**2).mean())) if stated is None else stated)
        if not np.isfinite(noises[-1]):
            raise AgonicError(
                f"the noise of the {name} is neither stated nor shown by repeated readings; give "
                "noise_nT"
            )
    own, theirs = noises[0] / np.sqrt(fields.counts), noises[1] * beside.share
    return Measured(fields.field, beside.field, rot_cn, covariance, own, theirs)


def average_attitudes(site: Site, star: StarReadings, earth: EarthRotation) -> tuple[Array, Array]:
    """True attitudes rot_ci (n, 3, 3), with what the air and motion did taken out, and rot_ei. The
    sensor sees a star of direction u at Q u and reports rot_ci Q, so rot_ci = reported Qᵀ."""
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


def _measure_star_noise(turns: Array, rows: list[Index]) -> Array:
    """Standard deviation of one attitude, across and about the boresight, rad."""
    squares = np.sum([((turns[own] - turns[own].mean(axis=0)) ** 2).sum(0) for own in rows], axis=0)
    freedom = sum(len(own) - 1 for own in rows)
    if freedom < 3:
        return np.full(2, np.nan)
    return np.sqrt(np.array([(squares[0] + squares[1]) / 2, squares[2]]) / freedom)


def _choose_covariance(star: StarReadings, scatter: Array) -> Array:
    """What is stated of every attitude, or else what the scatter shows."""
    if star.covariance is not None:
        return star.covariance
    if not np.isfinite(scatter).all() or scatter.min() <= 0:
        raise AgonicError(
            "the star sensor's noise is neither stated nor shown by repeated readings; give "
            "across_sd_arcsec and about_sd_arcsec"
        )
    return np.broadcast_to(np.diag(scatter[[0, 0, 1]] ** 2), star.rot_ci.shape)


def solve_session(
    session: Session, observed: Observed, groups: Collection[str], rounds: int = MAX_ROUNDS
) -> Solution:
    """The most probable unknowns, those of `groups` free. What the session knows with a standard
    deviation (pier, axes of the reference) joins by itself."""
    prior = make_prior({"alignment", *groups}, session.pier.sd, session.reference_sd_arcsec)
    return solve(observed.measured, prior, session.pier.difference, rounds=rounds)
