"""Geodetic positions and axes: against trigonometry, derivatives and the ellipsoid itself."""

import numpy as np
import pytest

from agonic.maths.earth import geodesy

SEMI_MINOR_M = geodesy.SEMI_MAJOR_M * (1 - geodesy.FLATTENING)
PLACES = np.array(
    [[90.0, 10.0], [-90.0, -180.0], [0.0, 180.0], [0.0, 0.0], [37.4, -122.2], [-45.0, 360.0]]
).T


def test_directions_are_sines_and_cosines() -> None:
    latitude, longitude = np.radians(PLACES)
    expected = np.stack([np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)])
    assert np.abs(geodesy.directions(*PLACES) - expected).max() < 1e-15


def test_sea_level_lies_on_the_ellipsoid() -> None:
    x, y, z = geodesy.earth_fixed_position(geodesy.directions(*PLACES), 0.0)
    on_it = (x**2 + y**2) / geodesy.SEMI_MAJOR_M**2 + z**2 / SEMI_MINOR_M**2
    assert np.abs(on_it - 1.0).max() < 1e-15


@pytest.mark.parametrize(("axis", "step"), [(0, (1e-5, 0, 0)), (1, (0, 1e-5, 0)), (2, (0, 0, -1))])
def test_axes_point_where_latitude_longitude_and_depth_grow(
    axis: int, step: tuple[float, float, float]
) -> None:
    latitude, longitude = np.array([-80.0, 0.0, 52.0]), np.array([-179.0, 12.0, 100.0])
    where = geodesy.directions(latitude, longitude)

    def position(sign: int) -> np.ndarray:
        moved = geodesy.directions(latitude + sign * step[0], longitude + sign * step[1])
        return geodesy.earth_fixed_position(moved, 400e3 + sign * step[2])

    moved_e = position(+1) - position(-1)
    moved_n = geodesy.north_east_down(moved_e, where) / np.linalg.norm(moved_e, axis=0)
    assert np.abs(moved_n - np.eye(3)[:, axis, None]).max() < 1e-7


def test_earth_fixed_undoes_north_east_down() -> None:
    vectors = np.random.default_rng(1).normal(size=(2, 3, PLACES.shape[1]))
    where = geodesy.directions(*PLACES)
    there = geodesy.north_east_down(vectors, where)
    assert np.abs(geodesy.earth_fixed(there, where) - vectors).max() < 1e-14


@pytest.mark.parametrize("height", [-10e3, 0.0, 500e3, 36e6, 1e9])
def test_positions_come_back_from_earth_fixed(height: float) -> None:
    latitude = np.array([90.0, -90.0, 89.9999999, 0.0, 1e-9, 45.0, -52.3, 37.4])
    longitude = np.array([0.0, 0.0, 179.0, -180.0, 12.0, 0.0, 100.0, -122.2])
    where = geodesy.directions(latitude, longitude)
    back = geodesy.geodetic(geodesy.earth_fixed_position(where, height))
    np.testing.assert_allclose(back[0], latitude, atol=1e-12)
    np.testing.assert_allclose((back[1] - longitude + 180) % 360, 180, atol=1e-8)
    np.testing.assert_allclose(back[2], height, atol=1e-6)  # m


def test_geocentric_positions_are_on_the_same_ray() -> None:
    """The radius is the distance from the centre, and tan φ′ = z / ρ."""
    latitude, longitude, radius = np.array([-60.0, 0.0, 45.0]), np.array([10.0, 200.0, -5.0]), 6.8e6
    geodetic = geodesy.from_geocentric(latitude, longitude, radius)
    x, y, z = geodesy.earth_fixed_position(geodesy.directions(*geodetic[:2]), geodetic[2])
    np.testing.assert_allclose(np.sqrt(x**2 + y**2 + z**2), radius)
    np.testing.assert_allclose(np.degrees(np.arctan2(z, np.hypot(x, y))), latitude)
    np.testing.assert_allclose(geodetic[1], [10.0, -160.0, -5.0])
