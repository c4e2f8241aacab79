"""How a magnetometer sits on a platform whose azimuth and tilt a theodolite and levels tell."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import chdtrc, fdtrc

from agonic.alignment.maths import session as kernel
from agonic.alignment.maths.session import SIZE, Given, Unknowns
from agonic.alignment.session.north import NorthSession, Platform
from agonic.alignment.session.session import compute_unix_s
from agonic.arrays import Array, Index
from agonic.calibration.base import select_columns
from agonic.errors import AgonicError
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.attitude import down_b, rot_nb
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.maths.rotations.vectors import find_best_rotation
from agonic.samples import Samples

AZIMUTH = 5
"""Place of the turn about down that all azimuths share, among the unknowns of the kernel."""
ROUNDS = 5
RARE = 1e-4
"""Chance that makes a platform that settles, or residuals, be told."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Aligned:
    """The rotation (3, 3) from platform (forward, right, down) to magnetometer components.

    `covariance` (3, 3) rad², magnetometer axes; `residuals` (k, 3) nT with what
    the noise explains, `residuals_sd` (k, 3); `heading_deg` (k,) true. `settled_by`
    (3,), rad, is what the platform surely turned by within the orientations, else zero.
    """

    rot_mb: Array
    covariance: Array
    residuals: Array
    residuals_sd: Array
    heading_deg: Array
    orientation: NDArray[np.int64]
    chi2: float
    freedom: int
    settled_by: Array

    @property
    def sd_arcsec(self) -> Array:
        """Standard errors (3,) about the magnetometer's axes."""
        return np.asarray(np.sqrt(np.diag(self.covariance)) / ARCSEC_RAD)

    @property
    def worst_sd_arcsec(self) -> float:
        """About the axis about which it is known least."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]) / ARCSEC_RAD)

    @property
    def p_value(self) -> float:
        """How often residuals would be at least as large by chance."""
        return float(chdtrc(self.freedom, self.chi2)) if self.freedom > 0 else 1.0


def align_platform(session: NorthSession, north_deg: float, north_sd_arcsec: float) -> Aligned:
    """The alignment of a session's magnetometer with its platform, R_mb.

    The residual is that of the star sensor's, W (raw − b) − R_mb R_bn H (B_ref + O), with the
    platform's attitude R_bn from azimuth and levels. What north is wrong by turns all azimuths
    alike: a turn of H about down with north's standard error as its prior.
    """
    platform = session.platform
    assert platform is not None, "asked for only with a platform"
    heading = platform.reading_deg - north_deg + (180.0 if platform.mirror else 0.0)
    readings = _read(session, platform)
    given = _average_readings(platform, heading, readings)
    prior = _prior_information(session, north_sd_arcsec)
    at, start = _solve(session, given, prior)
    chance = find_settling_chance(_list_residuals(at, given, readings))
    settled = np.zeros(3)
    if chance < RARE:
        first, last = (
            _solve(session, _average_readings(platform, heading, half), prior)[0].rot_mc
            for half in _halve(readings)
        )
        # half of the time apart, so twice that over all of it
        settled = 2.0 * Rotation.from_matrix(last @ first.T).as_rotvec()
    return _result(at, start, given, prior, heading, platform, settled)


def _solve(session: NorthSession, given: Given, prior: Array) -> tuple[Unknowns, Unknowns]:
    """The most probable unknowns, and those of the prior."""
    at = kernel.start_unknowns()._replace(
        offset=np.asarray(session.pier.difference, dtype=np.float64)
    )
    at = at._replace(rot_mc=find_best_rotation(kernel.predict_field_c(at, given), given.field))
    magnitude = float(np.linalg.norm(given.reference, axis=1).mean())
    free = np.flatnonzero(prior != np.inf)
    unit = kernel.find_unit_sizes(magnitude)[free]
    base, start = at, at
    for _ in range(ROUNDS):
        white = kernel.compute_whitener(kernel.compute_covariance(at, given))
        solution = leastsq.solve(
            partial(_pieces, base, given, white, free, unit),
            np.zeros(len(free)),
            scale=1.0,
            prior=partial(_prior, prior[free], unit, _away(base, start)[free]),
            tolerance=1e-6,
        )
        at = base = base.add_step(_whole(solution.params / unit, free))
        if np.abs(solution.params).max() < 1e-7 * magnitude:
            break
    return at, start


def _result(
    at: Unknowns,
    start: Unknowns,
    given: Given,
    prior: Array,
    heading: Array,
    platform: Platform,
    settled: Array,
) -> Aligned:
    free = np.flatnonzero(prior != np.inf)
    known = kernel.compute_information(at, given)[np.ix_(free, free)] + np.diag(prior[free])
    residuals, _ = kernel.compute_residual(at, given)
    spread = kernel.compute_covariance(at, given)
    white = (kernel.compute_whitener(spread) @ residuals[:, :, None])[:, :, 0]
    chi2 = float((white**2).sum() + (prior[free] * _away(at, start)[free] ** 2).sum())
    freedom = residuals.size - 3
    wider = max(chi2 / freedom, 1.0) if freedom > 0 and chdtrc(freedom, chi2) < 0.01 else 1.0
    return Aligned(
        rot_mb=at.rot_mc,
        covariance=wider * leastsq.inverse(known)[:3, :3] + np.outer(settled, settled),
        residuals=residuals,
        residuals_sd=np.sqrt(np.diagonal(spread, axis1=1, axis2=2)),
        heading_deg=heading % 360.0,
        orientation=platform.orientation,
        chi2=chi2,
        freedom=freedom,
        settled_by=settled,
    )


def _prior_information(session: NorthSession, north_sd_arcsec: float) -> Array:
    """Information (18,) of the prior: 0 where nothing is known, infinite for exact values."""
    prior = np.full(SIZE, np.inf)
    prior[:3] = 0.0
    if north_sd_arcsec > 0:
        prior[AZIMUTH] = (north_sd_arcsec * ARCSEC_RAD) ** -2
    if session.pier.sd:
        prior[6:9] = session.pier.sd**-2
    return prior


def _away(at: Unknowns, start: Unknowns) -> Array:
    """How far the unknowns are from the prior, (18,)."""
    away = np.zeros(SIZE)
    away[AZIMUTH] = float(np.arctan2(at.rot_nr[1, 0], at.rot_nr[0, 0]))
    away[6:9] = at.offset - start.offset
    return away


def _prior(prior: Array, unit: Array, away: Array, params: Array) -> tuple[Array, Array]:
    root = np.sqrt(prior)
    return root * (away + params / unit), np.diag(root / unit)


def _pieces(
    base: Unknowns, given: Given, white: Array, free: Index, unit: Array, params: Array
) -> list[tuple[Array, Array]]:
    residuals, jacobian = kernel.compute_residual(base.add_step(_whole(params / unit, free)), given)
    scaled = white @ (jacobian[:, :, free] / unit)
    return [((white @ residuals[:, :, None]).ravel(), scaled.reshape(-1, len(free)))]


def _whole(step: Array, free: Index) -> Array:
    whole = np.zeros(SIZE)
    whole[free] = step
    return whole


class _Readings(NamedTuple):
    """Of each orientation the magnetometer's readings (n, 3), the reference's at the same moments,
    and the noise of one of each on an axis."""

    field: list[Array]
    reference: list[Array]
    noise: float
    reference_noise: float


def _read(session: NorthSession, platform: Platform) -> _Readings:
    """The readings at each orientation, by the magnetometer's own calibration."""
    magnetometer, reference = session.magnetometer, session.reference
    assert magnetometer is not None, "checked with the session"
    assert reference is not None, "checked with the session"
    rows = _rows(magnetometer, platform)
    raw = magnetometer.field
    if session.calibration is not None:
        raw = session.calibration.correct(raw, **select_columns(session.calibration, magnetometer))
    now, then = compute_unix_s(magnetometer), compute_unix_s(reference)
    alongside = np.stack([np.interp(now, then, b) for b in reference.field.T], axis=1)
    return _Readings(
        [raw[own] for own in rows],
        [alongside[own] for own in rows],
        session.noise or _scatter(raw, rows, "magnetometer"),
        session.reference_noise or _scatter(alongside, rows, "reference"),
    )


def _halve(readings: _Readings) -> tuple[_Readings, _Readings]:
    """The first and the second half of the readings at each orientation."""
    first, last = (
        readings._replace(
            field=[one[half(len(one))] for one in readings.field],
            reference=[one[half(len(one))] for one in readings.reference],
        )
        for half in (lambda n: slice(0, (n + 1) // 2), lambda n: slice(n // 2, n))
    )
    return first, last


def _average_readings(platform: Platform, heading_deg: Array, readings: _Readings) -> Given:
    """Means of every orientation, its attitude and what that is uncertain by."""
    counts = np.array([len(own) for own in readings.field])
    turn = np.swapaxes(rot_nb(platform.roll_deg, platform.pitch_deg, heading_deg), -1, -2)
    return Given(
        np.array([own.mean(axis=0) for own in readings.field]),
        np.array([own.mean(axis=0) for own in readings.reference]),
        turn,
        _attitude_covariance(platform),
        readings.noise / np.sqrt(counts),
        readings.reference_noise / np.sqrt(counts),
    )


def _list_residuals(at: Unknowns, given: Given, readings: _Readings) -> list[Array]:
    """What is left of each reading, (n, 3) by orientation."""
    return [
        (field - at.bias) @ at.matrix.T - (beside + at.offset) @ (at.rot_mc @ turn @ at.rot_nr).T
        for field, beside, turn in zip(
            readings.field, readings.reference, given.rot_cn, strict=True
        )
    ]


def _rows(magnetometer: Samples, platform: Platform) -> list[Index]:
    """The magnetometer's rows of each orientation."""
    station = magnetometer.station
    if station is None:
        raise AgonicError("the magnetometer's table says no orientation; add a column orientation")
    rows = [np.flatnonzero(station == number) for number in platform.orientation]
    without = [str(n) for n, own in zip(platform.orientation, rows, strict=True) if not len(own)]
    if without:
        raise AgonicError(f"orientation {', '.join(without)} has no readings of the magnetometer")
    return rows


def _attitude_covariance(platform: Platform) -> Array:
    """Covariance (k, 3, 3), rad², platform axes: roll about x, pitch about y as it was before
    rolling, azimuth about down."""
    roll = np.radians(platform.roll_deg)
    zero = np.zeros_like(roll)
    about = np.stack(
        [
            np.stack([zero + 1.0, zero, zero], axis=-1),
            np.stack([zero, np.cos(roll), -np.sin(roll)], axis=-1),
            down_b(platform.roll_deg, platform.pitch_deg),
        ],
        axis=-1,
    )
    level, circle = platform.level_sd_arcsec, platform.circle_sd_arcsec
    sd = np.array([level, level, circle]) * ARCSEC_RAD
    return np.asarray((about * sd**2) @ np.swapaxes(about, -1, -2))


def _scatter(values: Array, rows: list[Index], name: str) -> float:
    """Standard deviation of a reading on one axis within the orientations."""
    squares = sum(float(((values[own] - values[own].mean(axis=0)) ** 2).sum()) for own in rows)
    freedom = 3 * sum(len(own) - 1 for own in rows)
    if freedom < 6:
        raise AgonicError(f"the noise of the {name} is neither stated nor shown; give noise_nT")
    return float(np.sqrt(squares / freedom))


BATCHES = 6
"""Means of an orientation's readings, in which noise with memory shows as it is."""


def find_settling_chance(left: list[Array]) -> float:
    """How often chance alone would move readings along a line in time by as much as they do.

    Of each orientation batches of what is `left` (n, 3) of its readings are fitted with a line; the
    squares of the slopes over those of what the lines leave are an F-test, all axes together. It is
    1 where no orientation has readings enough.

    >>> rng = np.random.default_rng(0)
    >>> still = [rng.normal(size=(60, 3)) for _ in range(8)]
    >>> bool(find_settling_chance(still) > 1e-4)
    True
    >>> find_settling_chance([one - np.linspace(0, 3, 60)[:, None] for one in still]) < 1e-4
    True
    """
    explained, unexplained, lines = 0.0, 0.0, 0
    at = np.linspace(-1.0, 1.0, BATCHES)
    for values in left:
        if len(values) < BATCHES:
            continue
        means = np.stack([part.mean(axis=0) for part in np.array_split(values, BATCHES)])
        means -= means.mean(axis=0)
        slope = at @ means / (at @ at)
        explained += float((slope**2).sum() * (at @ at))
        unexplained += float(((means - np.outer(at, slope)) ** 2).sum())
        lines += 3
    if not lines or unexplained == 0.0:
        return 1.0
    freedom = lines * (BATCHES - 2)
    return float(fdtrc(lines, freedom, explained / lines / (unexplained / freedom)))
