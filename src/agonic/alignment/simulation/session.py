"""`simulate_session`: a night at an observatory with a star sensor, and what is true of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from agonic.alignment.maths.two_frames import Unknowns, predict_raw
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.observed import compute_apparent_turn
from agonic.alignment.session.session import Mounting, Pier, Session, Site, StarReadings
from agonic.arrays import Array
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.frames import ARCSEC_RAD, from_323_deg, rot_cn, rot_en
from agonic.readable import Readable, Shown
from agonic.samples import Samples

FIELD_N = (18_870.0, 1_390.0, 45_750.0)
"""North, east and down at Niemegk in 2024, rounded, nT."""


def read_field(
    true: Array,
    noise: float,
    rng: np.random.Generator,
    begins: datetime,
    time: Array,
    name: str = "magnetometer",
    **columns: Array,
) -> Samples:
    """Readings of a field (n, 3), nT, at seconds (n,) after it begins, with further columns."""
    return Samples(
        field=true + noise * rng.standard_normal(true.shape),
        unit="nT",
        time=np.asarray(time, dtype=np.float64),
        epoch=begins,
        name=name,
        **columns,  # type: ignore[arg-type]
    )


def vary_field(
    time: Array, size: float, periods_s: tuple[float, float, float], rng: np.random.Generator
) -> Array:
    """The ambient field (n, 3) about its mean: a wave on each axis, nT."""
    phase = rng.uniform(0, 6, 3)
    waves = np.sin(2 * np.pi * time[:, None] / np.array(periods_s) + phase)
    return np.asarray(FIELD_N + size * waves)


def simulate_remanence(
    *,
    remanence: float = 0.0,
    induced: float = 0.0,
    settings: int = 12,
    readings: int = 30,
    noise: float = 0.5,
    drift: float = 5.0,
    begins: datetime = datetime(2024, 3, 12, 19, 0, tzinfo=UTC),
    seed: int = 0,
) -> Samples:
    """Readings while the platform goes once round in equal steps, its angle in `heading_deg`.

    Parameters
    ----------
    remanence : nT of its own field at the magnetometer, across the axis; induced : what the ambient
        field makes, going round twice. settings, readings : of the platform, and at each.
    drift : nT of the ambient field meanwhile. noise : nT.
    begins : when; seed : of noise, drift and the direction of the platform's field.

    >>> simulate_remanence(settings=8, readings=2).field.shape
    (16, 3)
    """
    rng = np.random.default_rng(seed)
    angle = np.repeat(np.arange(settings) * 360.0 / settings, readings)
    turned = np.radians(angle) + rng.uniform(0, 2 * np.pi)
    time = np.arange(len(angle)) + 20.0 * np.repeat(np.arange(settings), readings)
    own = remanence * _round(turned) + induced * _round(2 * turned)
    ambient = np.asarray(FIELD_N) + drift * (time / time[-1])[:, None] * rng.standard_normal(3)
    return read_field(ambient + own, noise, rng, begins, time, heading_deg=angle)


def _round(angle_rad: Array) -> Array:
    return np.stack([np.cos(angle_rad), np.sin(angle_rad), 0 * angle_rad], axis=1)


NIEMEGK = Site(latitude_deg=52.0725, longitude_deg=12.6750)
MOUNTING_DEG = (37.0, 64.0, -112.0)
TURN_S = 40


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedSession(Readable):
    """A session and its truth: rotations, the field's offset, bias and matrix of the magnetometer.
    `rot_mc` turns star sensor components into the magnetometer's; `reference_turn` (3,) is the
    small rotation, rad, of the reference's axes about north, east and down."""

    session: Session
    rot_mc: Annotated[Array, Shown(key="matrix_mc")]
    reference_turn: Array
    offset: Annotated[Array, Shown(key="pier_nT")]
    bias: Annotated[Array, Shown(key="bias_nT")]
    matrix: Annotated[Array, Shown()]


def simulate_session(
    *,
    orientations: int | Sequence[Sequence[float]] = 24,
    readings: int = 20,
    noise: float = 0.5,
    reference_noise: float = 0.3,
    across_sd_arcsec: float = 3.0,
    about_sd_arcsec: float = 20.0,
    site: Site = NIEMEGK,
    field_n: ArrayLike = FIELD_N,
    mounting_deg: Sequence[float] = MOUNTING_DEG,
    mounting_sd_deg: float = 0.3,
    reference_turn_arcsec: ArrayLike = (0.0, 0.0, 0.0),
    pier: ArrayLike = (0.0, 0.0, 0.0),
    remanence: float | None = None,
    bias: ArrayLike = (0.0, 0.0, 0.0),
    matrix: ArrayLike | None = None,
    refraction: str = "present",
    aberration: str = "present",
    lowest_elevation_deg: float = 35.0,
    begins: datetime = datetime(2024, 3, 12, 20, 0, tzinfo=UTC),
    seed: int = 0,
) -> SimulatedSession:
    """A magnetometer and a star sensor turned through many orientations beside a reference.

    Parameters
    ----------
    orientations : how many, drawn at random above `lowest_elevation_deg`; or azimuth, elevation and
        roll of each, degrees. readings : of each instrument in each.
    noise, reference_noise : nT a reading and axis; across_sd_arcsec, about_sd_arcsec : of an
        attitude across and about the boresight.
    site, begins : where and when (UTC). seed : of the noise.
    field_n : (3,) mean field at the reference, nT; it varies by some tens of nT in the night.
    mounting_deg : the nominal 3-2-3 angles; the true ones differ by `mounting_sd_deg` at random.
    reference_turn_arcsec : (3,) of the reference's axes about north, east, down.
    remanence : nT of the platform's own field across its axis, which adds to the bias; readings
        with the platform turned are then in the session. `None`: none of either.
    pier : (3,) field at the magnetometer less that at the reference, nT. bias, matrix : (3,) nT and
        (3, 3), of the magnetometer, field = matrix @ (raw − bias), symmetric.
    refraction, aberration : "present" where the star sensor leaves them in its attitudes.

    Returns the session as an observer would have it, and its truth.

    >>> made = simulate_session(orientations=6, readings=5)
    >>> len(made.session.star), made.session.orientations.tolist()
    (30, [1, 2, 3, 4, 5, 6])
    """
    rng = np.random.default_rng(seed)
    rot = _orientations(orientations, lowest_elevation_deg, rng)
    alpha, beta, gamma = mounting_deg
    nominal = from_323_deg(alpha, beta, gamma)
    rot_mc = make_rotation(np.radians(mounting_sd_deg) * rng.standard_normal(3)) @ nominal
    turn = np.asarray(reference_turn_arcsec, dtype=np.float64) * ARCSEC_RAD
    own = remanence * np.array([0.6, -0.8, 0.0]) if remanence else np.zeros(3)
    truth = Unknowns(
        rot_mc,
        make_rotation(turn),
        np.asarray(pier, dtype=np.float64),
        np.asarray(bias, dtype=np.float64) + own,
        np.eye(3) if matrix is None else np.asarray(matrix, dtype=np.float64),
    )
    clock, number = make_clock(len(rot), readings)
    beside = np.asarray(field_n) + _vary_field(np.arange(float(clock[-1] + TURN_S)), rng)
    turned, before = None, begins - timedelta(hours=1)
    if remanence is not None:
        turned = simulate_remanence(remanence=remanence, noise=noise, begins=before, seed=seed)
    session = Session(
        name="simulated",
        site=site,
        star=_stars(
            site,
            rot[number],
            begins.timestamp() + clock.astype(np.float64) + 0.25,
            number + 1,
            np.array([across_sd_arcsec] * 2 + [about_sd_arcsec]) * ARCSEC_RAD,
            (refraction, aberration),
            rng,
        ),
        **read_turned(truth, rot, readings, beside, (noise, reference_noise), begins, rng),
        pier=Pier(difference=truth.offset),
        remanence=turned,
        mounting=Mounting(alpha_deg=alpha, beta_deg=beta, gamma_deg=gamma),
        noise=noise or 1e-6,
        reference_noise=reference_noise or 1e-6,
    )
    return SimulatedSession(
        session=session,
        rot_mc=rot_mc,
        reference_turn=turn,
        offset=truth.offset,
        bias=truth.bias,
        matrix=truth.matrix,
    )


def _orientations(
    given: int | Sequence[Sequence[float]], lowest_deg: float, rng: np.random.Generator
) -> Array:
    """North-east-down into star sensor components, (k, 3, 3)."""
    if not isinstance(given, int):
        azimuth, elevation, roll = np.asarray(given, dtype=np.float64).T
        return rot_cn(azimuth, elevation, roll)
    height = rng.uniform(np.sin(np.radians(lowest_deg)), 1.0, given)
    azimuth, roll = rng.uniform(0, 360, (2, given))
    return rot_cn(azimuth, np.degrees(np.arcsin(height)), roll)


def make_clock(count: int, readings: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Whole seconds of every reading, one a second and time to turn in between, and the number of
    the orientation, from 0."""
    number = np.repeat(np.arange(count), readings).astype(np.int64)
    return number * TURN_S + np.arange(len(number)) + 5, number


def read_turned(
    truth: Unknowns,
    rot_cn: Array,
    readings: int,
    beside: Array,
    noise: tuple[float, float],
    begins: datetime,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """What a magnetometer on a platform in attitudes (k, 3, 3) reads, and a reference beside it
    every second; `noise` is that of the two."""
    clock, number = make_clock(len(rot_cn), readings)
    raw = predict_raw(truth, rot_cn[number], beside[clock])
    every, station = np.arange(float(len(beside))), (number + 1).astype(np.float64)
    seconds = clock.astype(np.float64)
    return {
        "magnetometer": read_field(raw, noise[0], rng, begins, seconds, station=station),
        "reference": read_field(beside, noise[1], rng, begins, every, "reference"),
    }


def _vary_field(time: Array, rng: np.random.Generator) -> Array:
    """The field's slow variation (n, 3), nT."""
    periods = np.array([2_400.0, 5_100.0, 13_000.0])
    size = 15.0 * rng.standard_normal((3, 3))
    phase = rng.uniform(0, 2 * np.pi, (3, 3))
    waves = np.sin(2 * np.pi * time[:, None, None] / periods[:, None] + phase)
    return np.asarray((size * waves).sum(axis=1))


def _stars(
    site: Site,
    rot_cn: Array,
    time: Array,
    number: NDArray[np.int64],
    sd: Array,
    effects: tuple[str, str],
    rng: np.random.Generator,
) -> StarReadings:
    """What the star sensor reports: attitudes with noise, turned by aberration and refraction."""
    rot_ei = load_earth_rotation().rot_ei(time)
    rot_ni = rot_en(site.latitude_deg, site.longitude_deg).T @ rot_ei
    noise = Rotation.from_rotvec(sd * rng.standard_normal((len(time), 3))).as_matrix()
    true_ci = noise @ rot_cn @ rot_ni
    star = StarReadings(
        time=time,
        orientation=number,
        rot_ci=true_ci,
        covariance=np.broadcast_to(np.diag(np.maximum(sd, 1e-6 * ARCSEC_RAD) ** 2), true_ci.shape),
        refraction=effects[0],
        aberration=effects[1],
    )
    for _ in range(4):  # where it seems to look decides by how much it is turned
        turn = compute_apparent_turn(site, star, rot_ei)
        star = replace(star, rot_ci=true_ci @ turn)
    return star
