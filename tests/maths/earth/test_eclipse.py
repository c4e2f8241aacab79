"""The Earth's shadow: closed forms, and the Sun of another implementation."""

import erfa
import numpy as np
import pytest

from agonic.maths.earth.eclipse import find_eclipsed
from agonic.maths.earth.geodesy import SEMI_MAJOR_M, geodetic

EQUINOX = 1_742_461_260.0  # 2025-03-20 09:01 UTC
MOMENTS = 1_577_836_800.0 + np.linspace(0.0, 10 * 365.25 * 86_400, 400)  # 2020 to 2030


def sun_e_by_erfa(unix_s: np.ndarray) -> np.ndarray:
    """The direction of the Sun in Earth-fixed axes by VSOP87 and IAU 2006/2000A, (n, 3)."""
    jd = 2_440_587.5
    days = unix_s / 86_400.0
    tt = days + 69.2 / 86_400.0
    earth = erfa.epv00(jd, tt)[0]["p"]
    into = erfa.c2t06a(jd, tt, jd, days, 0.0, 0.0)
    sun = np.einsum("nij,nj->ni", into, -earth)
    return sun / np.linalg.norm(sun, axis=1, keepdims=True)


def test_the_edge_of_the_shadow_is_where_the_sun_of_erfa_puts_it() -> None:
    """Positions a tenth of a degree inside and outside the edge, all round the shadow."""
    sun = sun_e_by_erfa(MOMENTS)
    radius = SEMI_MAJOR_M + 5e5
    edge = np.pi - np.arcsin(SEMI_MAJOR_M / radius)
    across = np.cross(sun, [0.3, -0.5, 0.8])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turn = np.linspace(0, 20 * np.pi, len(sun))[:, None]
    side = np.cos(turn) * across + np.sin(turn) * np.cross(sun, across)
    for inside, margin in ((True, 0.1), (False, -0.1)):
        angle = edge + np.radians(margin)
        position = radius * (np.cos(angle) * sun + np.sin(angle) * side)
        assert (find_eclipsed(*geodetic(position.T), MOMENTS) == inside).all()


@pytest.mark.parametrize("height", [4e5, 2e6, 3.6e7])
def test_an_orbit_in_the_ecliptic_is_dark_for_the_share_that_geometry_says(height: float) -> None:
    """arcsin(R/r)/π of a circle round the equator at equinox."""
    longitude = np.linspace(-180.0, 180.0, 20_001)[:-1]
    dark = find_eclipsed(0.0, longitude, height, EQUINOX).mean()
    radius = SEMI_MAJOR_M + height
    assert dark == pytest.approx(np.arcsin(SEMI_MAJOR_M / radius) / np.pi, abs=2e-4)


def test_night_is_shadow_on_the_ground_too() -> None:
    noon, midnight = 1_750_507_200.0, 1_750_550_400.0  # 2025-06-21 12:00, 2025-06-22 00:00 UTC
    place = ([51.5], [0.0], [100.0])
    assert not find_eclipsed(*place, [noon])[0]
    assert find_eclipsed(*place, [midnight])[0]
    assert not find_eclipsed([80.0], [0.0], [100.0], [midnight])[0]  # the midnight sun


def test_many_rows_are_what_few_are() -> None:
    rng = np.random.default_rng(0)
    n = (1 << 17) + 1000
    latitude, longitude = rng.uniform(-90, 90, n), rng.uniform(-180, 180, n)
    time = EQUINOX + rng.uniform(0, 1e8, n)
    whole = find_eclipsed(latitude, longitude, 5e5, time)
    last = slice(n - 2000, n)
    assert (whole[last] == find_eclipsed(latitude[last], longitude[last], 5e5, time[last])).all()
