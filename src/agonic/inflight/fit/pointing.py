"""Attitude along a track: as logged, or one side kept to the Earth; and the shadow of the Earth."""

from __future__ import annotations

from datetime import UTC

import numpy as np

from agonic.arrays import Array, Mask
from agonic.errors import AgonicError, LogError
from agonic.inflight.fit.problem import Attitude, ExpectedDirection
from agonic.maths.earth import geodesy
from agonic.maths.earth.earth_rotation import rotate_about_third, sidereal_rad, sun_i
from agonic.maths.earth.eclipse import find_eclipsed
from agonic.maths.rotations.attitude import rot_nb
from agonic.reference import Reference
from agonic.samples import Samples

LOWEST_ORBIT_M = 80_000.0


def expect_direction(
    samples: Samples, reference: Reference, attitude: Attitude
) -> ExpectedDirection | None:
    """Where the field should point in the axes of the attitude; None without attitude."""
    if attitude == "none":
        return None
    if reference.kind != "vector" or reference.frame != "n":
        raise AgonicError(
            "a fit with the attitude needs the field's components north, east, down: positions and "
            "a date, or Reference.vector(…, frame='n')"
        )
    if attitude == "nadir":
        nb = local_vertical_nb(samples)
    elif samples.heading_estimated:
        raise LogError(
            f"{samples.name}: the heading is a filter's estimate that follows the magnetometer; "
            "it cannot be the reference"
        )
    else:
        angles = (samples.roll_deg, samples.pitch_deg, samples.heading_deg)
        if any(angle is None for angle in angles):
            raise LogError(
                f"{samples.name}: the log holds no attitude (roll_deg, pitch_deg, heading_deg); "
                'fit the magnitude alone, or attitude="nadir" where one side keeps to the Earth'
            )
        nb = rot_nb(*angles)  # type: ignore[arg-type]
    field_n = np.broadcast_to(reference.values, (len(samples), 3))
    aim_n = field_n / np.linalg.norm(field_n, axis=1)[:, None]
    level = np.maximum(np.hypot(aim_n[:, 0], aim_n[:, 1]), 1e-12)
    side_n = np.stack([-aim_n[:, 1] / level, aim_n[:, 0] / level, np.zeros(len(samples))], axis=1)
    return ExpectedDirection(
        aim=np.einsum("nji,nj->ni", nb, aim_n), side=np.einsum("nji,nj->ni", nb, side_n)
    )


def local_vertical_nb(samples: Samples) -> Array:
    """Attitude of a spacecraft that keeps one side to the Earth, (n, 3, 3): z to the centre of the
    Earth, y against the normal of the orbit, which the positions before and after a row tell."""
    position = _position_i(samples)
    if position is None or len(samples) < 3:
        raise LogError(
            f"{samples.name}: an attitude from the track needs positions, altitude, times and a "
            "date"
        )
    radial, sidereal, where, _ = position
    before = np.concatenate([radial[:, :1], radial[:, :-1]], axis=1)
    after = np.concatenate([radial[:, 1:], radial[:, -1:]], axis=1)
    down = -radial / np.linalg.norm(radial, axis=0)
    right = np.cross(after, before, axis=0)
    right -= down * (right * down).sum(axis=0)
    size = np.linalg.norm(right, axis=0)
    if not (size > 0).all():
        raise LogError(f"{samples.name}: positions repeat, so they give no direction of flight")
    right /= size
    axes = [np.cross(right, down, axis=0), right, down]
    columns = [geodesy.north_east_down(rotate_about_third(axis, sidereal), where) for axis in axes]
    return np.moveaxis(np.stack(columns, axis=1), -1, 0)


def find_direction_e(samples: Samples, reference: Reference) -> Array | None:
    """The direction of the field in Earth-fixed axes (n, 3); None where it is not known."""
    if reference.kind != "vector" or reference.frame != "n":
        return None
    if samples.latitude_deg is None or samples.longitude_deg is None:
        return None
    unit_n = reference.values / np.linalg.norm(reference.values, axis=1)[:, None]
    where = geodesy.directions(samples.latitude_deg, samples.longitude_deg)
    return geodesy.earth_fixed(np.broadcast_to(unit_n, (len(samples), 3)).T, where).T


def find_eclipse(samples: Samples) -> Mask | None:
    """Whether each row is in the shadow of the Earth, (n,); None where that cannot be told."""
    track = _track(samples)
    if track is None or np.median(track[2]) < LOWEST_ORBIT_M:
        return None
    return find_eclipsed(*track)


def find_sun_height(samples: Samples) -> Array | None:
    """The sine of the Sun's height above the horizon of each row, (n,); None as for the eclipse."""
    position = _position_i(samples)
    if position is None:
        return None
    radial, _, _, unix = position
    return np.asarray((radial / np.linalg.norm(radial, axis=0) * sun_i(unix)).sum(axis=0))


def _position_i(samples: Samples) -> tuple[Array, Array, Array, Array] | None:
    """Inertial positions (3, n), m, sidereal time (n,), rad, the directions of the places, and Unix
    time (n,), s; None without track or date."""
    track = _track(samples)
    if track is None:
        return None
    latitude, longitude, altitude, unix = track
    where, sidereal = geodesy.directions(latitude, longitude), sidereal_rad(unix)
    position_e = geodesy.earth_fixed_position(where, altitude)
    return rotate_about_third(position_e, -sidereal), sidereal, where, unix


def _track(samples: Samples) -> tuple[Array, Array, Array, Array] | None:
    """Latitude, longitude, altitude and Unix time, s; None where one of them is missing."""
    latitude, longitude, altitude = samples.latitude_deg, samples.longitude_deg, samples.altitude_m
    time, epoch = samples.time, samples.epoch
    if latitude is None or longitude is None or altitude is None or time is None or epoch is None:
        return None
    epoch = epoch if epoch.tzinfo else epoch.replace(tzinfo=UTC)
    return latitude, longitude, altitude, time + epoch.timestamp()
