"""Starts that outliers cannot reach."""

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
