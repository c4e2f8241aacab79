"""Sidereal time, the Sun, the Earth's shadow, and the frames from the stars to the site."""

from datetime import UTC, datetime

import erfa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from agonic.maths.earth.earth_rotation import (
    is_in_shadow,
    rot_ei,
    rotate_about_third,
    sidereal_rad,
    sun_i,
    tai_utc_s,
)
from agonic.maths.earth.geodesy import directions, earth_fixed
from agonic.maths.earth.starlight import (
    Air,
    apply_aberration,
    apply_refraction,
    observer_velocity_i,
    refraction_rad,
)
from agonic.maths.rotations.angles import angle_deg
from agonic.maths.rotations.frames import (
    angles_232_deg,
    angles_323_deg,
    from_323_deg,
    r2,
    r3,
    rot_ci,
    rot_cn,
    rot_en,
)
from agonic.maths.rotations.vectors import find_smallest_rotation

arcsec = 1 / 3600


def unix(*moment: int) -> float:
    return datetime(*moment, tzinfo=UTC).timestamp()


def test_sidereal_time_of_the_textbook() -> None:
    """1987-04-10 at 0 h and at 19:21:00 UT (Meeus, Astronomical Algorithms, examples 12.a, b)."""
    midnight, evening = np.degrees(sidereal_rad([unix(1987, 4, 10), unix(1987, 4, 10, 19, 21)]))
    assert midnight == pytest.approx(15 * (13 + 10 / 60 + 46.3668 / 3600), abs=0.001 * arcsec)
    assert evening == pytest.approx(128.7378734, abs=0.001 * arcsec)


def test_inertial_becomes_earth_fixed_as_published() -> None:
    """TEME to pseudo Earth-fixed, 2004-04-06 07:51:28.386009 UTC, UT1 0.44 s earlier, km
    (Vallado et al., AIAA 2006-6753, appendix C)."""
    teme = np.array([[5094.18016210], [6127.64465950], [6380.34453270]])
    ut1 = unix(2004, 4, 6, 7, 51, 28) + 0.386009 - 0.4399619
    expected = [-1033.47503130, 7901.30558560, 6380.34453270]
    np.testing.assert_allclose(
        rotate_about_third(teme, sidereal_rad([ut1])).ravel(), expected, atol=1e-4
    )


def test_turning_back_gives_the_vector() -> None:
    vectors, angle = np.random.default_rng(1).normal(size=(3, 50)), np.linspace(-7, 7, 50)
    np.testing.assert_allclose(
        rotate_about_third(rotate_about_third(vectors, angle), -angle), vectors, atol=1e-14
    )


def test_the_sun_of_the_textbook() -> None:
    """1992-10-13 at 0 h: right ascension 198.38083°, declination −7.78507° (Meeus, 25.a)."""
    x, y, z = sun_i([unix(1992, 10, 13)]).ravel()
    assert np.hypot(np.hypot(x, y), z) == pytest.approx(1.0, abs=1e-12)
    assert np.degrees(np.arctan2(y, x)) % 360 == pytest.approx(198.38083, abs=0.01)
    assert np.degrees(np.arcsin(z)) == pytest.approx(-7.78507, abs=0.01)


def test_the_share_of_a_low_orbit_in_shadow() -> None:
    """A circle in the plane of the Sun is dark for 2 arcsin(R/r) of a turn."""
    turn = np.linspace(0, 2 * np.pi, 100_000)
    circle = 7e6 * np.stack([np.cos(turn), np.sin(turn), 0 * turn])
    dark = is_in_shadow(circle, np.array([[1.0], [0.0], [0.0]]), 6.378e6)
    assert dark.mean() == pytest.approx(np.arcsin(6.378 / 7) / np.pi, abs=1e-4)
    edge_on = is_in_shadow(circle, np.array([[0.0], [0.0], [1.0]]), 6.378e6)
    assert not edge_on.any()


# ---- the whole chain from the stars to the site ----------------------------------------------

MAS = np.pi / 180 / 3600 / 1000
POLE = (1.2e-6, 2.1e-6)
UT1_TAI_S = -37.0 + 0.0123


def largest_angle(difference: np.ndarray) -> float:
    """Of small rotations that are left between matrices, rad."""
    return float(np.abs(difference - np.eye(3)).max())


def direct(unix_s: np.ndarray) -> np.ndarray:
    """ERFA's one call for the whole chain, without any table of its own."""
    tai = unix_s + 37.0
    tt, ut1 = (tai + 32.184) / 86_400, (tai + UT1_TAI_S) / 86_400
    return erfa.c2t06a(2_440_587.5, tt, 2_440_587.5, ut1, *POLE)


def test_the_published_matrix() -> None:
    """2007-04-05 12:00 UTC (SOFA Tools for Earth Attitude, section 5.5), which applies offsets of
    the pole of 0.1750 and −0.2259 mas that are left out here."""
    published = np.array(
        [
            [+0.973104317697535, +0.230363826239128, -0.000703163482198],
            [-0.230363800456037, +0.973104570632801, +0.000118545366625],
            [+0.000711560162668, +0.000046626403995, +0.999999745754024],
        ]
    )
    pole = np.array([0.0349282, 0.4833163]) * 1000 * MAS
    made = rot_ei([unix(2007, 4, 5, 12)], [-33.072073685], *pole[:, None])[0]
    left = largest_angle(made @ published.T)
    assert 0.1 * MAS < left < np.hypot(0.1750, 0.2259) * MAS


def test_a_million_epochs_agree_with_the_direct_call() -> None:
    """To 0.001 mas, whether splined or not."""
    rng = np.random.default_rng(1)
    many = unix(2024, 3, 1) + np.sort(rng.uniform(0, 20 * 86_400, 50_000))
    made = rot_ei(many, UT1_TAI_S, *POLE)
    some = slice(None, None, 500)
    assert largest_angle(made[some] @ np.swapaxes(direct(many[some]), 1, 2)) < 0.001 * MAS
    few = many[::10_000]
    assert (
        largest_angle(rot_ei(few, UT1_TAI_S, *POLE) @ np.swapaxes(direct(few), 1, 2)) < 1e-3 * MAS
    )


def test_the_equinox_based_chain_gives_the_same() -> None:
    """S N P of the textbooks: precession and nutation, apparent sidereal time, polar motion."""
    at = unix(2024, 3, 12, 20) + np.arange(0, 7200, 60.0)
    tt, ut1 = (at + 69.184) / 86_400, (at + 37.0 + UT1_TAI_S) / 86_400
    sidereal = erfa.gst06a(2_440_587.5, ut1, 2_440_587.5, tt)
    sp = erfa.sp00(2_440_587.5, tt)
    wobble = erfa.rx(-POLE[1], np.eye(3)) @ r2(-POLE[0]) @ r3(sp)
    classical = wobble @ r3(sidereal) @ erfa.pnm06a(2_440_587.5, tt)
    made = rot_ei(at, UT1_TAI_S, *POLE)
    assert largest_angle(made @ np.swapaxes(classical, 1, 2)) < 0.01 * MAS


def test_leap_seconds() -> None:
    """The last one came at the end of 2016."""
    assert tai_utc_s(unix(2016, 12, 31, 23, 59, 59)) == 36.0
    assert tai_utc_s(unix(2017, 1, 1)) == 37.0


@pytest.mark.parametrize(("ours", "theirs"), [(r2, erfa.ry), (r3, erfa.rz)])
def test_elementary_rotations_are_passive_as_erfas(ours, theirs) -> None:
    for angle in np.linspace(-4, 4, 9):
        np.testing.assert_allclose(ours(angle), theirs(angle, np.eye(3)), atol=1e-15)


def test_star_sensor_attitude_against_scipy() -> None:
    """Passive R3(c) R2(b) R3(a) is the inverse of SciPy's intrinsic Z-Y-Z turns."""
    ra, dec, rot = 123.4, -35.6, 211.0
    scipys = Rotation.from_euler("ZYZ", [ra, 90 - dec, rot], degrees=True).inv().as_matrix()
    made = rot_ci(ra, dec, rot)
    np.testing.assert_allclose(made, scipys, atol=1e-15)
    a, d = np.radians([ra, dec])
    looks = [np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)]
    np.testing.assert_allclose(made[2], looks, atol=1e-15)
    south = rot_ci(ra, dec, 0.0)[0]  # with Rot = 0 the first axis points to decreasing declination
    np.testing.assert_allclose(south, rot_ci(ra, dec - 90.0, 0.0)[2], atol=1e-15)


def test_site_axes_are_those_of_geodesy() -> None:
    rng = np.random.default_rng(2)
    for latitude, longitude in zip(rng.uniform(-90, 90, 9), rng.uniform(-180, 360, 9), strict=True):
        vector = rng.normal(size=(3, 1))
        expected = earth_fixed(vector, directions([latitude], [longitude]))
        np.testing.assert_allclose(rot_en(latitude, longitude) @ vector, expected, atol=1e-14)


def test_sky_axes() -> None:
    """Azimuth counts from north through east, roll 0 points the first axis down the sky."""
    for azimuth, elevation in ((30.0, 50.0), (200.0, 10.0)):
        a, e = np.radians([azimuth, elevation])
        looks = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), -np.sin(e)]
        made = rot_cn(azimuth, elevation, 0.0)
        np.testing.assert_allclose(made[2], looks, atol=1e-14)
        assert made[0][2] == pytest.approx(np.cos(e))
        assert np.linalg.det(made) == pytest.approx(1.0)


@given(st.floats(-360, 360), st.floats(-180, 180), st.floats(-360, 360))
def test_angles_of_matrices_and_back(a: float, b: float, c: float) -> None:
    matrix = from_323_deg(a, b, c)
    np.testing.assert_allclose(from_323_deg(*angles_323_deg(matrix)), matrix, atol=2e-12)
    chi, zeta, eta = np.radians(angles_232_deg(matrix))
    np.testing.assert_allclose(r2(eta) @ r3(zeta) @ r2(chi), matrix, atol=2e-12)


def test_refraction_of_the_textbook() -> None:
    """58.294″ tan z − 0.0668″ tan³ z, seen z, 760 mmHg and 10 °C (Smart, Spherical Astronomy)."""
    zenith = np.radians([10.0, 30.0, 45.0, 70.0])
    made = refraction_rad(zenith, Air(1013.25, 10.0, 0.3)) / MAS / 1000
    seen = np.tan(zenith - made * 1000 * MAS)
    np.testing.assert_allclose(made, 58.294 * seen - 0.0668 * seen**3, rtol=0.01)
    up = np.array([[0.0, 0.0, 1.0]])
    star = np.array([[np.sin(1.0), 0.0, np.cos(1.0)]])
    seen = apply_refraction(star, up, Air())
    lifted = np.arccos(star[0, 2]) - np.arccos(seen[0, 2])
    assert lifted == pytest.approx(refraction_rad(np.array([1.0]), Air())[0], rel=1e-9)


def test_aberration_is_the_speed_of_the_earth() -> None:
    """The constant of aberration, 20.4955″; a day's spin adds 0.32″ cos φ."""
    year = unix(2024, 1, 1) + np.arange(0, 366) * 86_400.0
    still = observer_velocity_i(year, np.zeros((len(year), 3)), 0.0)
    speed = np.linalg.norm(still, axis=1) / MAS / 1000
    assert speed.mean() == pytest.approx(20.4955, abs=0.02)
    assert 0.3 < np.ptp(speed) / 2 < 0.4
    east = np.array([[0.0, 1.0, 0.0]])
    spun = observer_velocity_i(year[:1], east, 60.0) - observer_velocity_i(year[:1], 0 * east, 60.0)
    assert np.linalg.norm(spun) / MAS / 1000 == pytest.approx(0.5 * 0.3200, abs=0.001)
    pole = np.array([[0.0, 0.0, 1.0]])
    apart = angle_deg(apply_aberration(pole, still[:1]), pole)[0] * 3600
    across = np.linalg.norm(np.cross(pole, still[:1])) / MAS / 1000
    assert apart == pytest.approx(across, abs=0.002)


def test_the_smallest_turn() -> None:
    start, end = np.array([0.6, 0.8, 0.0]), np.array([0.0, 0.6, 0.8])
    turn = find_smallest_rotation(start, end)
    np.testing.assert_allclose(turn @ start, end, atol=1e-15)
    vector = Rotation.from_matrix(turn).as_rotvec()
    np.testing.assert_allclose(
        np.cross(start, end) / np.linalg.norm(np.cross(start, end)),
        vector / np.linalg.norm(vector),
        atol=1e-14,
    )
