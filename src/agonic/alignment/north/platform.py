"""How a magnetometer sits on a platform by a theodolite (azimuth) and levels (tilt)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from agonic.alignment.maths.columns import average, find_rows, fit_lines
from agonic.alignment.maths.two_frames import (
    RARE,
    Solution,
    compute_rotation_vector,
    compute_turn_sd,
    make_prior,
    solve,
)
from agonic.alignment.session.laboratory import NorthSession, Platform
from agonic.alignment.session.observed import average_beside, make_measured
from agonic.alignment.session.session import compute_unix_s
from agonic.arrays import Array, Index
from agonic.errors import AgonicError
from agonic.maths.rotations.attitude import down_b, rot_nb
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.readable import Shown


@dataclass(frozen=True, kw_only=True, eq=False)
class Aligned:
    """The alignment of a magnetometer with its platform (forward, right, down). `solution` has the
    rotation and what else was solved for; `heading_deg` (k,) is true, `time` (k,) that of an
    orientation's readings; `settled_by` (3,), rad, is what the platform surely turned by within the
    orientations, else zero."""

    solution: Solution
    heading_deg: Array
    orientation: NDArray[np.int64]
    time: Array
    settled_by: Array

    @property
    def rot_mb(self) -> Annotated[Array, Shown(key="matrix_mb")]:
        """Platform components into the magnetometer's, (3, 3)."""
        return self.solution.unknowns.rot_mc

    @property
    def covariance(self) -> Array:
        """Of the rotation, (3, 3), rad², magnetometer axes."""
        return self.solution.covariance[:3, :3] + np.outer(self.settled_by, self.settled_by)

    @property
    def sd_arcsec(self) -> Annotated[Array, Shown()]:
        """Standard errors (3,) about the magnetometer's axes."""
        return np.asarray(np.sqrt(np.diag(self.covariance)) / ARCSEC_RAD)

    @property
    def worst_sd_arcsec(self) -> Annotated[float, Shown()]:
        """About the axis about which it is known least."""
        return compute_turn_sd(self.covariance) / ARCSEC_RAD


def align_platform(session: NorthSession, north_deg: float, north_sd_arcsec: float) -> Aligned:
    """The alignment of a session's magnetometer with its platform, R_mb. Vectors in two frames as
    with a star sensor, the platform's attitude R_bn from azimuth and levels. What north is wrong by
    turns all azimuths alike: a turn of the reference about down with north's standard error as its
    prior, beside what is stated of the reference's axes."""
    platform = session.platform
    assert platform is not None, "asked for only with a platform"
    heading = platform.reading_deg - north_deg + (180.0 if platform.mirror else 0.0)
    rot_bn = np.swapaxes(rot_nb(platform.roll_deg, platform.pitch_deg, heading), -1, -2)
    axes_sd = session.reference_sd_arcsec or 0.0
    turns = (axes_sd, axes_sd, float(np.hypot(axes_sd, north_sd_arcsec)))
    prior = make_prior({"alignment"}, session.pier.sd, turns)

    (magnetometer, reference), field = session.instruments, session.corrected

    def align(rows: list[Index]) -> Solution:
        fields = average_beside(rows, magnetometer, field, reference)
        measured = make_measured(session, fields, rot_bn, _attitude_covariance(platform))
        return solve(measured, prior, session.pier.difference)

    if magnetometer.station is None:
        raise AgonicError("the magnetometer's table says no orientation; add a column orientation")
    rows = find_rows(magnetometer.station, platform.orientation)
    without = [str(n) for n, own in zip(platform.orientation, rows, strict=True) if not len(own)]
    if without:
        raise AgonicError(f"orientation {', '.join(without)} has no readings of the magnetometer")
    found, settled = align(rows), np.zeros(3)
    now, then = compute_unix_s(magnetometer), compute_unix_s(reference)
    beside = np.stack([np.interp(now, then, b) for b in reference.field.T], axis=1)
    onto_m = found.unknowns.rot_mc @ found.measured.rot_cn @ found.unknowns.rot_nr
    both = zip(rows, onto_m, strict=True)
    # what is left of each reading, but for a constant
    if find_settling_chance([field[own] - beside[own] @ turn.T for own, turn in both]) < RARE:
        first, last = (
            align([own[half(len(own))] for own in rows]).unknowns.rot_mc
            for half in (lambda n: slice(0, (n + 1) // 2), lambda n: slice(n // 2, n))
        )
        # half of the time apart, so twice that over all of it
        settled = 2.0 * compute_rotation_vector(last @ first.T)
    return Aligned(
        solution=found,
        heading_deg=heading % 360.0,
        orientation=platform.orientation,
        time=average(now, rows),
        settled_by=settled,
    )


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


def find_settling_chance(left: list[Array]) -> float:
    """How often chance alone would move readings along a line in time by as much as they do. Of
    each orientation means of what is `left` (n, 3) of its readings, in batches, so that noise with
    memory shows as it is, are fitted with a line; the squares of the slopes over those of what the
    lines leave are an F-test, all axes together. It is 1 where none has readings enough."""
    at = np.linspace(-1.0, 1.0, 6)
    batches = (np.array_split(values, len(at)) for values in left if len(values) >= len(at))
    lines = fit_lines((at, np.stack([part.mean(axis=0) for part in own])) for own in batches)
    unexplained = float(lines.squares.sum())
    if unexplained == 0.0:
        return 1.0
    explained = float((lines.slope**2).sum()) * float(at @ at)
    count, freedom = lines.slope.size, 3 * int(lines.freedom.sum())
    return float(fdtrc(count, freedom, explained / count / (unexplained / freedom)))
