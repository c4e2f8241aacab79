"""A coil, an accelerometer, both theodolites as they are read, and what is true of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import newton
from scipy.spatial.transform import Rotation, Slerp

from agonic.alignment.maths.north import evaluate_swing_deg
from agonic.alignment.maths.two_frames import Unknowns
from agonic.alignment.north import di_flux as kernel
from agonic.alignment.session.laboratory import (
    Attitude,
    CoilSession,
    DiSheet,
    NorthSession,
    Platform,
    Sighting,
    SwingRecord,
    Transits,
)
from agonic.alignment.simulation.session import (
    FIELD_N,
    NIEMEGK,
    TURN_S,
    make_clock,
    read_field,
    read_turned,
    vary_field,
)
from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.maths.rotations.attitude import make_rotation, rot_nb
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.readable import Readable, Shown
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedCoil(Readable):
    """A session and its truth: the coil's vector (3,) by the ampere, nT/A, in the magnetometer's
    axes, its axis in north-east-down, and its angle to the axis as drawn."""

    session: CoilSession
    vector: Annotated[Array, Shown(key="vector_nT_A")]
    axis_n: Annotated[Array, Shown()]
    geometric_deg: Annotated[float, Shown()]


def simulate_coil(
    *,
    reversals: int = 100,
    readings: int = 5,
    levels: Sequence[float] = (1.0,),
    noise: float = 0.5,
    reference_noise: float = 0.3,
    even: float = 0.0,
    begins: datetime = datetime(2024, 3, 12, 9, 0, tzinfo=UTC),
    seed: int = 0,
) -> SimulatedCoil:
    """A coil of 20 µT at its largest current, its axis tilted from the one as drawn.

    Alignment and attitude are off by 1″ and 2″, which the observer knows.

    Parameters
    ----------
    reversals, readings : of the current, and of the magnetometer in between, one a second.
    levels : shares of the largest current, in turn.
    noise, reference_noise : nT. even : nT at the largest current that does not reverse.
    begins : when. seed : of the noise.

    Source: the model of `fit_coil`.

    >>> simulate_coil(reversals=4, readings=2).session.magnetometer.current_A.tolist()
    [0.5, 0.5, -0.5, -0.5, 0.5, 0.5, -0.5, -0.5, 0.5, 0.5]
    """
    rng = np.random.default_rng(seed)
    rot_bm = make_rotation(rng.uniform(-0.5, 0.5, 3))
    rot_bn = rot_nb(0.4, -0.7, 63.0).T
    drawn = np.array([0.0, 0.0, 1.0])
    tilt = np.radians(0.08) * rng.standard_normal(2)
    axis_b = make_rotation(np.array([*tilt, 0.0])) @ drawn
    field, constant, bias = 20_000.0, 40_000.0, np.array([12.0, -40.0, 25.0])
    vector = constant * rot_bm.T @ axis_b
    share = np.tile(np.repeat(np.asarray(levels, dtype=np.float64), 2), reversals)[: reversals + 1]
    current = field / constant * share * np.where(np.arange(reversals + 1) % 2, -1.0, 1.0)
    flowing = np.repeat(current, readings)
    time = np.arange(len(flowing), dtype=np.float64)
    beside = vary_field(time, 20.0, (1400.0, 2300.0, 3700.0), rng)
    rising = even * (flowing * constant / field) ** 2
    true = beside @ (rot_bm.T @ rot_bn).T + np.outer(flowing, vector) + rising[:, None]
    aligned_sd, stood_sd = 1.0 * ARCSEC_RAD, 2.0 * ARCSEC_RAD
    known = make_rotation(aligned_sd * rng.standard_normal(3)) @ rot_bm
    stood = make_rotation(stood_sd * rng.standard_normal(3)) @ rot_bn
    return SimulatedCoil(
        session=CoilSession(
            name="simulated",
            magnetometer=read_field(true + bias, noise, rng, begins, time, current_A=flowing),
            reference=read_field(beside, reference_noise, rng, begins, time, "reference"),
            geometric_axis=drawn,
            geometric_frame="b",
            alignment=Alignment(
                rotation=Rotation.from_matrix(known),
                covariance=np.eye(3) * aligned_sd**2,
                sensor="magnetometer",
            ),
            attitude=Attitude(rot_pn=stood, covariance=np.eye(3) * stood_sd**2),
            site=NIEMEGK,
        ),
        vector=vector,
        axis_n=rot_bn.T @ axis_b,
        geometric_deg=float(np.degrees(np.arccos(min(axis_b @ drawn, 1.0)))),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedGravity:
    """Samples with acceleration, and the true rotation from magnetometer to accelerometer."""

    samples: Samples
    rot_bm: Array


def simulate_gravity(
    *,
    orientations: int = 24,
    still_s: float = 3.0,
    turn_s: float = 2.0,
    rate_Hz: float = 50.0,
    turn_deg: float = 3.0,
    field_n: ArrayLike = FIELD_N,
    noise: float = 100.0,
    force_noise: float = 0.03,
    tilt_deg: float | None = None,
    bias: ArrayLike = (0.0, 0.0, 0.0),
    seed: int = 0,
) -> SimulatedGravity:
    """Stretches at rest (`still_s`) with turns (`turn_s`) in between, in directions at random, or
    tilted from level by `tilt_deg` at most. `turn_deg` is the size of the random rotation between
    the sensors' axes; noise and bias in nT, `force_noise` in m/s²."""
    rng = np.random.default_rng(seed)
    rot_bm = make_rotation(np.radians(turn_deg) * rng.standard_normal(3))
    begin = np.arange(orientations) * (still_s + turn_s)
    if tilt_deg is None:
        poses = Rotation.random(orientations, rng=rng)
    else:
        tilts = rng.uniform(-tilt_deg, tilt_deg, (2, orientations))
        angles = np.stack([rng.uniform(0, 360, orientations), *tilts], axis=1)
        poses = Rotation.from_euler("ZYX", angles, degrees=True)
    knots = np.stack([begin, begin + still_s], axis=1).ravel()
    path = Slerp(knots, poses[np.repeat(np.arange(orientations), 2)])
    time = np.arange(int(knots[-1] * rate_Hz) + 1) / rate_Hz
    rot_nb = path(np.minimum(time, knots[-1])).as_matrix()
    field_b = np.einsum("nji,j->ni", rot_nb, np.asarray(field_n))
    force = -STANDARD_GRAVITY_M_S2 * rot_nb[:, 2]
    samples = Samples(
        time=time,
        field=field_b @ rot_bm + np.asarray(bias) + noise * rng.standard_normal(field_b.shape),
        unit="nT",
        acceleration=force + force_noise * rng.standard_normal(force.shape),
    )
    return SimulatedGravity(samples=samples, rot_bm=rot_bm)


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedDiFlux:
    """A sheet and its truth: angles in degrees, collimations in arcseconds, offset in nT."""

    sheet: DiSheet
    declination_deg: float
    inclination_deg: float
    delta_arcsec: float
    epsilon_arcsec: float
    offset: float


def simulate_di_flux(
    *, inclination_deg: float = 64.3, noise: float = 0.5, mark_sd_arcsec: float = 1.0, seed: int = 0
) -> SimulatedDiFlux:
    """The usual eight settings, twice each, and a ninth of known tilt for the scale: `noise` of a
    setting in nT, field and circle together, `mark_sd_arcsec` of a sighting."""
    rng = np.random.default_rng(seed)
    declination_deg, mark_azimuth_deg, mark_deg = 4.2, 180.137, 78.2555
    delta_arcsec, epsilon_arcsec, telescope_arcsec = 140.0, -230.0, 4.0
    magnitude, offset = 48_800.0, 6.0
    meridian = declination_deg - mark_azimuth_deg + mark_deg
    dip, off = inclination_deg, (delta_arcsec / 3600, epsilon_arcsec / 3600)
    truth = np.array([*np.radians([meridian, dip, *off]), offset / magnitude, magnitude])
    horizontal = meridian + np.array([90, -90, -90, 90, 0, 0, 180, 180, 180])
    zenith = [90, 90, 270, 270, dip, dip + 180, 360 - dip, 180 - dip, 180 - dip]
    circles = np.stack([horizontal, zenith], axis=1)
    # each circle is set to the minute nearest a zero reading, the fluxgate reads the rest
    circles[:4, 0] = np.round(_read_null(truth, circles[:4], 0) * 60) / 60
    circles[4:8, 1] = np.round(_read_null(truth, circles[4:8], 1) * 60) / 60
    circles[8, 1] = circles[7, 1] + 0.18
    at = _at(circles)
    reading = kernel.predict(truth, at)[0] + noise * rng.standard_normal(9)
    faces = np.array([0, 180, 0, 180])
    collimated = np.where(faces > 90, -1, 1) * telescope_arcsec
    marks = mark_deg + faces + (collimated + mark_sd_arcsec * rng.standard_normal(4)) / 3600
    return SimulatedDiFlux(
        sheet=DiSheet(
            mark_deg=np.repeat(marks, 2) % 360,
            mark_azimuth_deg=mark_azimuth_deg,
            horizontal_deg=np.repeat(circles[:, 0], 2) % 360,
            zenith_deg=np.repeat(circles[:, 1], 2),
            reading=np.repeat(reading, 2),
            setting=np.repeat(np.arange(9), 2),
            time=1.7e9 + 30.0 * np.arange(18.0),
            magnitude=magnitude,
            name="simulated",
            pillar="A",
        ),
        declination_deg=declination_deg,
        inclination_deg=inclination_deg,
        delta_arcsec=delta_arcsec,
        epsilon_arcsec=epsilon_arcsec,
        offset=offset,
    )


def _read_null(truth: Array, circles: Array, which: int) -> Array:
    """The readings (n,), degrees, of one circle at which the fluxgate reads nothing."""

    def read(angle_deg: Array) -> Array:
        turned = circles.copy()
        turned[:, which] = angle_deg
        return kernel.predict(truth, _at(turned))[0]

    return np.asarray(newton(read, circles[:, which]))


def _at(circles: Array) -> kernel.Settings:
    """Settings (n, 2) of the circles, degrees, without readings."""
    horizontal, zenith = np.radians(circles).T
    nothing = np.zeros(len(circles))
    return kernel.Settings(horizontal, zenith, nothing, np.zeros(len(circles), dtype=bool))


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedNorth(Readable):
    """A session and its truth: north on the circle, the mark's azimuth, degrees, and R_mb."""

    session: NorthSession
    north_deg: Annotated[float, Shown()]
    mark_azimuth_deg: Annotated[float, Shown()]
    rot_mb: Annotated[Array, Shown(key="matrix_mb")]


def simulate_north(
    *,
    reading_sd_arcsec: float = 4.0,
    time_sd_s: float = 0.1,
    constant_sd_arcsec: float = 1.0,
    orientations: int = 8,
    noise: float = 0.5,
    reference_noise: float = 0.3,
    circle_sd_arcsec: float = 2.0,
    level_sd_arcsec: float = 2.0,
    seed: int = 0,
) -> SimulatedNorth:
    """A gyro read by its turning points, by transits and all the time; a mark; a platform.

    It swings for four periods about 35″ more than true north on the circle.

    Parameters
    ----------
    reading_sd_arcsec, time_sd_s : of a reading of the circle and of a stopped time.
    constant_sd_arcsec : of the constant as known.
    orientations : of the platform, 0 for none; it is turned about the vertical, tilted a little.
    noise, reference_noise : nT; circle_sd_arcsec, level_sd_arcsec : of its azimuth and tilt.
    seed : of the noise.

    Source: the equation of the gyro's swing, as in `fit_north`.

    >>> made = simulate_north()
    >>> len(made.session.turning_deg), len(made.session.platform.orientation)
    (8, 8)
    """
    rng = np.random.default_rng(seed)
    sd, constant_arcsec = reading_sd_arcsec / 3600.0, -35.0
    north_deg, mark_azimuth_deg = 137.2418, 211.5
    gyro = north_deg - (constant_arcsec + constant_sd_arcsec * rng.standard_normal()) / 3600.0
    phase = rng.uniform(0, 2 * np.pi)
    swing = np.array([gyro, 1.2 * np.cos(phase), 1.2 * np.sin(phase), 6e-5, 2 * np.pi / 420.0])
    time = np.arange(0.0, 4 * 420.0, 5.0)
    marks = north_deg + mark_azimuth_deg + np.array([0.0, 180.0, 0.0, 180.0])
    noises, sds = (noise, reference_noise), (circle_sd_arcsec, level_sd_arcsec)
    rot_mb, stood = _stand(orientations, north_deg, noises, sds, rng)
    # u̇ = 0: tan(ωt − φ) = −λ/ω with p cos ωt + q sin ωt = A cos(ωt − φ)
    _, p, q, decay, omega = swing
    first = (np.arctan2(q, p) - np.arctan2(decay, omega)) / omega % (np.pi / omega)
    turns = np.arange(first, 8 * np.pi / omega, np.pi / omega)
    turning = evaluate_swing_deg(swing, turns) + sd * rng.standard_normal(len(turns))
    return SimulatedNorth(
        session=NorthSession(
            name="simulated",
            turning_deg=turning,
            transits=_transits(swing, time_sd_s, rng, sd),
            swing=SwingRecord(
                time_s=time,
                reading_deg=evaluate_swing_deg(swing, time) + sd * rng.standard_normal(len(time)),
            ),
            reading_sd_arcsec=reading_sd_arcsec,
            time_sd_s=time_sd_s,
            constant_arcsec=constant_arcsec,
            constant_sd_arcsec=constant_sd_arcsec,
            sightings=(
                Sighting(name="mark", reading_deg=(marks + sd * rng.standard_normal(4)) % 360.0),
            ),
            noise=noise,
            reference_noise=reference_noise,
            **stood,
        ),
        north_deg=north_deg,
        mark_azimuth_deg=mark_azimuth_deg,
        rot_mb=rot_mb,
    )


def _transits(swing: Array, time_sd_s: float, rng: np.random.Generator, sd: float) -> Transits:
    """Two transits at each of two settings, a swing apart, amplitudes in degrees."""
    settings = swing[0] + np.array([-0.11, -0.11, 0.16, 0.16]) + 0.02 * rng.standard_normal(4)
    settings[1], settings[3] = settings[0], settings[2]
    rows = []
    for k, setting in enumerate(settings):
        since = 2 * np.pi / swing[4] * np.linspace(2 * k, 2 * k + 2.2, 44_001)
        away = evaluate_swing_deg(swing, since) - setting
        crossed = np.flatnonzero(np.diff(np.sign(away)) != 0)
        crossed = crossed[int(np.argmax(away[crossed] < 0)) :][:3]
        share = away[crossed] / (away[crossed] - away[crossed + 1])
        error = np.array([time_sd_s] * 3 + [sd] * 2) * rng.standard_normal(5)
        east, west = np.diff(since[crossed] + share * (since[1] - since[0]) + error[:3])
        high, low = (np.abs(away[a:b]).max() for a, b in pairwise(crossed))
        rows.append((east, west, high + error[3], low + error[4]))
    east, west, high, low = np.array(rows).T
    return Transits(
        setting_deg=settings, east_s=east, west_s=west, amplitude_east=high, amplitude_west=low
    )


def _stand(
    count: int,
    north_deg: float,
    noise: tuple[float, float],
    sd_arcsec: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[Array, dict[str, Any]]:
    """How the magnetometer sits on its platform, and of `count` orientations about the vertical
    platform, magnetometer and reference; `noise` is that of the two, `sd_arcsec` that of circle
    and level."""
    rot_mb = make_rotation(rng.uniform(-0.5, 0.5, 3))
    begins = datetime(2024, 3, 12, 20, 0, tzinfo=UTC)
    if not count:
        return rot_mb, {}
    heading = np.arange(count) * 360.0 / count + rng.uniform(-5, 5, count)
    roll, pitch = rng.uniform(-3, 3, (2, count))
    seconds = np.arange(float(make_clock(count, 20)[0][-1] + TURN_S))
    beside = vary_field(seconds, 15.0, (2400.0, 3100.0, 5100.0), rng)
    rot_bn = np.swapaxes(rot_nb(roll, pitch, heading), 1, 2)
    circle_sd, level_sd = sd_arcsec
    roll_error, pitch_error = level_sd / 3600 * rng.standard_normal((2, count))
    read = heading + circle_sd / 3600 * rng.standard_normal(count)
    platform = Platform(
        orientation=np.arange(count) + 1,
        reading_deg=(read + north_deg + 180.0) % 360.0,
        roll_deg=roll + roll_error,
        pitch_deg=pitch + pitch_error,
        circle_sd_arcsec=circle_sd,
        level_sd_arcsec=level_sd,
        mirror=True,
    )
    truth = Unknowns(rot_mc=rot_mb)
    read_out = read_turned(truth, rot_bn, 20, beside, noise, begins, rng)
    return rot_mb, {"platform": platform, **read_out}
