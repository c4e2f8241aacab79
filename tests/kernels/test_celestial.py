"""Sidereal time, the Sun and the Earth's shadow, against published values."""

from datetime import UTC, datetime

import numpy as np
import pytest

from agonic.kernels.celestial import in_shadow, sidereal_rad, sun_i, turned

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
    np.testing.assert_allclose(turned(teme, sidereal_rad([ut1])).ravel(), expected, atol=1e-4)


def test_turning_back_gives_the_vector() -> None:
    vectors, angle = np.random.default_rng(1).normal(size=(3, 50)), np.linspace(-7, 7, 50)
    np.testing.assert_allclose(turned(turned(vectors, angle), -angle), vectors, atol=1e-14)


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
    dark = in_shadow(circle, np.array([[1.0], [0.0], [0.0]]), 6.378e6)
    assert dark.mean() == pytest.approx(np.arcsin(6.378 / 7) / np.pi, abs=1e-4)
    edge_on = in_shadow(circle, np.array([[0.0], [0.0], [1.0]]), 6.378e6)
    assert not edge_on.any()
