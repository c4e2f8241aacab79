"""Starts that outliers cannot reach, and two populations told apart."""

import numpy as np
import pytest

from agonic.maths.estimation.robust import least_median
from agonic.simulation.draws import draw_directions

CENTRE = np.array([0.4, -0.3, 0.2])


def spoilt(n: int, share: float, seed: int = 0) -> np.ndarray:
    """Points on a sphere of radius 1 with a share of them anywhere in a box, and 1 % noise."""
    rng = np.random.default_rng(seed)
    points = CENTRE + draw_directions(rng, n) + 0.01 * rng.normal(size=(n, 3))
    strays = rng.choice(n, round(share * n), replace=False)
    points[strays] = rng.uniform(-3, 3, (len(strays), 3))
    return points


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_the_sphere_is_found_among_strays(share: float) -> None:
    centre, gain = least_median.fit_least_median_sphere(spoilt(1000, share), np.ones(1))
    assert centre == pytest.approx(CENTRE, abs=0.06)
    assert gain == pytest.approx(1.0, abs=0.05)


def test_a_magnitude_that_changes_is_followed() -> None:
    rng = np.random.default_rng(1)
    magnitude = rng.uniform(0.5, 1.5, 1000)
    points = CENTRE + magnitude[:, None] * draw_directions(rng, 1000) / 2.0
    points[:200] += rng.normal(size=(200, 3))
    centre, gain = least_median.fit_least_median_sphere(points, magnitude)
    assert centre == pytest.approx(CENTRE, abs=0.02)
    assert gain == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("gains", [(1, 1, 1), (0.97, 1.0, 1.03)])
def test_one_ellipsoid_is_one_population(gains: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(2)
    points = draw_directions(rng, 2000) * gains + 0.01 * rng.normal(size=(2000, 3))
    assert least_median.fit_two_spheres(points) is None


def test_strays_are_no_population() -> None:
    assert least_median.fit_two_spheres(spoilt(2000, 0.3)) is None


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("apart", [0.4, 1.0, 3.0])
def test_two_populations_are_told_apart(share: float, apart: float) -> None:
    rng = np.random.default_rng(3)
    of_second = rng.uniform(size=3000) < share
    points = draw_directions(rng, 3000) + 0.01 * rng.normal(size=(3000, 3))
    points += of_second[:, None] * [0, apart, 0]
    found = least_median.fit_two_spheres(points)
    assert found is not None
    told = found.side != 0
    assert told.mean() > 0.5
    agree = ((found.side > 0) == of_second)[told].mean()
    assert max(agree, 1 - agree) > 0.98  # which of the two is called the first is open
    assert found.shift == pytest.approx(apart, rel=0.1)
    assert np.median(found.distance) < 0.03


def test_order_of_the_rows_does_not_matter() -> None:
    rng = np.random.default_rng(4)
    points = draw_directions(rng, 1000) + (rng.uniform(size=1000) < 0.4)[:, None] * [1.0, 0, 0]
    order = rng.permutation(1000)
    straight, shuffled = (
        least_median.fit_two_spheres(points),
        least_median.fit_two_spheres(points[order]),
    )
    assert straight is not None
    assert shuffled is not None
    agree = (straight.side[order] * shuffled.side).sum() / np.count_nonzero(straight.side)
    assert abs(agree) > 0.95
    assert shuffled.shift == pytest.approx(straight.shift, rel=0.05)
