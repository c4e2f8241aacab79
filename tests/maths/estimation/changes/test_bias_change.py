"""A bias that was another for a while: found where it was, and not where it was not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from agonic.maths.estimation.changes.bias_change import find_bias_change
from agonic.simulation.draws import draw_directions

SHIFT = np.array([0.02, -0.01, 0.03])  # of the radius


def residuals(
    n: int, stretch: slice, shift: np.ndarray = SHIFT, *, noise: float = 0.004, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances from a unit sphere whose readings in a stretch are shifted; normals and places."""
    rng = np.random.default_rng(seed)
    units = draw_directions(rng, n)
    off = noise * rng.normal(size=n)
    off[stretch] += units[stretch] @ shift
    return off, units, units


@pytest.mark.parametrize("n", [200, 3000])
@pytest.mark.parametrize(("start", "stop"), [(0.5, 1.0), (0.8, 1.0), (0.3, 0.6), (0.1, 0.25)])
def test_the_stretch_is_found(n: int, start: float, stop: float) -> None:
    found = find_bias_change(*residuals(n, slice(int(start * n), int(stop * n))))
    assert found is not None
    assert found.start / n == pytest.approx(start, abs=0.04)
    assert found.stop / n == pytest.approx(stop, abs=0.04)
    assert found.shift == pytest.approx(np.linalg.norm(SHIFT), rel=0.15)
    assert found.noise == pytest.approx(0.004, rel=0.2)
    assert found.significance > 30


def test_a_stretch_at_the_start_is_the_rest_at_the_end() -> None:
    found = find_bias_change(*residuals(2000, slice(0, 800)))
    assert found is not None
    assert found.start == pytest.approx(800, abs=70)
    assert found.stop == 2000


def test_slow_noise_in_the_axes_of_a_sensor_that_turns_is_seldom_a_change() -> None:
    """Its residuals look white, for the directions change from row to row; its pulls do not."""
    alarms = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        slow = lfilter([0.004 * np.sqrt(1 - 0.98**2)], [1.0, -0.98], rng.normal(size=(3000, 3)), 0)
        units = draw_directions(rng, 2000)
        off = np.einsum("ij,ij->i", np.asarray(slow)[1000:], units)
        found = find_bias_change(off, units, units)
        alarms += found is not None and found.significance > 30
    assert alarms <= 6  # measured 4; 40 where the memory of residuals alone counts


def test_white_noise_holds_no_change() -> None:
    found = [find_bias_change(*residuals(1000, slice(0), seed=seed)) for seed in range(100)]
    significance = np.array([change.significance for change in found if change])
    assert len(significance) == 100
    assert significance.max() < 30
    assert np.median(significance) < 15


def test_strays_neither_make_nor_hide_a_change() -> None:
    rng = np.random.default_rng(1)
    for stretch, changed in ((slice(0), False), (slice(1200, 3000), True)):
        off, normals, places = residuals(3000, stretch)
        strays = rng.choice(3000, 150, replace=False)
        off[strays] += rng.uniform(-1, 1, 150)
        found = find_bias_change(off, normals, places)
        assert found is not None
        assert (found.significance > 30) == changed
        if changed:
            assert found.start == pytest.approx(1200, abs=100)
            assert found.shift == pytest.approx(np.linalg.norm(SHIFT), rel=0.15)


def test_a_wrong_shape_is_no_change() -> None:
    """Soft iron left out of a fit leaves residuals nᵀE n, whatever the order of the rows."""
    off, normals, places = residuals(2000, slice(0))
    order = np.argsort(normals[:, 2])  # a slow swing through all heights
    strain = np.diag([0.05, -0.02, -0.03])
    off = off + np.einsum("ni,ij,nj->n", normals, strain, normals)
    found = find_bias_change(off[order], normals[order], places[order])
    assert found is not None
    assert found.significance < 30


def test_too_few_rows_and_perfect_ones_tell_nothing() -> None:
    assert find_bias_change(*residuals(40, slice(20, 40))) is None
    assert find_bias_change(*residuals(500, slice(0), noise=0.0)) is None


def test_what_rounding_tells_of_a_level_vehicle_decides_nothing() -> None:
    """On a level circle noise alone tells four of the moves, by the square of its size."""
    heading = np.linspace(0.0, 40.0, 1000)
    level = np.stack([0.5 * np.cos(heading), 0.5 * np.sin(heading), np.full(1000, 0.75**0.5)], 1)
    rng = np.random.default_rng(0)
    off, jitter = 0.002 * rng.normal(size=1000), rng.normal(size=(1000, 3))
    off[300:500] += level[300:500] @ SHIFT
    found = []
    for size in (0.0, 1e-9, 1e-6, 3e-6):
        units = level + size * jitter
        units /= np.linalg.norm(units, axis=1, keepdims=True)
        change = find_bias_change(off, units, units)
        assert change is not None
        found.append(change)
    assert np.ptp([np.log(change.significance) for change in found]) < 1e-3
    assert np.ptp([np.log(change.seen) for change in found]) < 1e-3
