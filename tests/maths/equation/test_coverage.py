"""Cells of the sphere, and how well a calibration is known over it: geometry and Monte Carlo."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from agonic.maths.equation import coverage
from agonic.maths.equation.affine import correct, model_basis, split
from agonic.maths.equation.symmetric import pack_symmetric

SEEDS = st.integers(0, 2**32 - 1)
FIELD = 50_000.0
BIAS = np.array([1000.0, -2000.0, 500.0])
MATRIX = np.array([[1.1, 0.05, -0.1], [0.05, 0.9, 0.08], [-0.1, 0.08, 1.0]])


def random_units(n: int, seed: int = 0) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(n, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def solid_angles(triangles: np.ndarray) -> np.ndarray:
    """Van Oosterom & Strackee (1983)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    dots = 1 + (a * b).sum(-1) + (b * c).sum(-1) + (c * a).sum(-1)
    return 2 * np.arctan2(np.abs(np.einsum("ni,ni->n", a, np.cross(b, c))), dots)


def test_eighty_cells_tile_the_sphere() -> None:
    centres, triangles = coverage.icosphere()
    areas = solid_angles(triangles)
    assert len(centres) == 80
    assert np.linalg.norm(triangles, axis=2) == pytest.approx(np.ones((80, 3)))
    assert areas.sum() == pytest.approx(4 * np.pi)
    assert areas.max() / areas.min() < 1.3
    assert np.array_equal(coverage.find_cells(centres), np.arange(80))


def test_even_directions_fill_all_cells_alike() -> None:
    counts = coverage.count_visits(random_units(200_000))
    assert counts.sum() == 200_000
    assert counts == pytest.approx(np.full(80, 2500), rel=0.08)


@given(SEEDS, st.floats(1e-20, 1e60))
def test_lengths_do_not_matter(seed: int, length: float) -> None:
    units = random_units(20, seed)
    assert np.array_equal(coverage.find_cells(length * units), coverage.find_cells(units))


def test_no_directions_are_no_visits() -> None:
    assert coverage.count_visits(np.empty((0, 3))).sum() == 0


@pytest.mark.parametrize("gauge", ["symmetric", "triangular"])
def test_field_covariance_is_that_of_many_calibrations(gauge: str) -> None:
    rng = np.random.default_rng(1)
    matrix = np.linalg.cholesky(MATRIX.T @ MATRIX).T if gauge == "triangular" else MATRIX
    shape = rng.normal(size=(9, 9)) * np.array([50.0] * 3 + [1e-3] * 6)[:, None]
    covariance = shape @ shape.T
    units = random_units(5)
    claimed = coverage.field_covariance(units, FIELD, BIAS, matrix, covariance, gauge)
    raw = FIELD * units @ np.linalg.inv(matrix).T + BIAS
    centre = np.concatenate([BIAS, pack_symmetric(matrix)])
    draws = rng.multivariate_normal(centre, covariance, 20_000) @ model_basis("full", gauge).T
    bias, drawn = split(draws)
    fields = correct(raw[None], bias[:, None], drawn)
    found = np.array([np.cov(fields[:, k].T) for k in range(5)])
    assert found == pytest.approx(claimed, rel=0.05, abs=0.03 * np.abs(claimed).max())


@pytest.mark.parametrize("inclination", [-70.0, 0.0, 60.0])
def test_level_directions_have_dip_and_even_headings(inclination: float) -> None:
    along, across = coverage.level_directions(inclination)
    north = np.cos(np.radians(inclination))
    headings = np.degrees(np.arctan2(-along[:, 1], along[:, 0])) % 360
    assert np.linalg.norm(along, axis=1) == pytest.approx(np.ones(36))
    assert along[:, 2] == pytest.approx(np.full(36, np.sin(np.radians(inclination))))
    assert headings == pytest.approx(np.arange(36) * 10.0)
    assert np.einsum("ni,ni->n", along, across) == pytest.approx(np.zeros(36), abs=1e-15)
    assert np.hypot(along[:, 0], along[:, 1]) == pytest.approx(np.full(36, north))


def test_heading_sd_is_that_of_many_calibrations() -> None:
    rng = np.random.default_rng(2)
    shape = rng.normal(size=(9, 9)) * np.array([100.0] * 3 + [2e-3] * 6)[:, None]
    covariance = shape @ shape.T
    claimed = coverage.heading_sd_deg(60.0, FIELD, MATRIX, covariance, "symmetric")
    along, _ = coverage.level_directions(60.0)
    raw = FIELD * along @ np.linalg.inv(MATRIX).T + BIAS
    centre = np.concatenate([BIAS, pack_symmetric(MATRIX)])
    draws = rng.multivariate_normal(centre, covariance, 5000) @ model_basis("full").T
    bias, drawn = split(draws)
    fields = correct(raw[None], bias[:, None], drawn)
    turned = np.arctan2(-fields[..., 1], fields[..., 0]) - np.arctan2(-along[:, 1], along[:, 0])
    error = np.degrees((turned + np.pi) % (2 * np.pi) - np.pi)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(claimed, rel=0.03)


@given(SEEDS)
def test_thickness_is_zero_for_a_plane_and_names_its_normal(seed: int) -> None:
    turn = Rotation.random(random_state=seed)
    ring = random_units(500) * [1, 1, 0]
    thick, normal = coverage.measure_thickness(turn.apply(ring) + 7.0)
    assert thick < 1e-12
    assert abs(normal @ turn.apply([0, 0, 1])) == pytest.approx(1.0)


def test_thickness_of_a_sphere_and_of_a_tilted_circle() -> None:
    assert coverage.measure_thickness(random_units(5000))[0] == pytest.approx(1.0, abs=0.02)
    belt = random_units(50_000)
    belt = belt[np.abs(belt[:, 2]) < np.sin(np.radians(10))]
    assert coverage.measure_thickness(belt)[0] == pytest.approx(np.sin(np.radians(10)), rel=0.03)


def test_missing_axes_are_those_never_seen_near() -> None:
    units = random_units(5000)
    assert coverage.find_missing_axes(coverage.count_visits(units)) == []
    assert coverage.find_missing_axes(coverage.count_visits(units[units[:, 2] > 0])) == ["−z"]
    level = units[np.abs(units[:, 2]) < 0.3]
    assert coverage.find_missing_axes(coverage.count_visits(level)) == ["+z", "−z"]
    assert len(coverage.find_missing_axes(np.zeros(80, dtype=np.int64))) == 6


def test_nearest_axis() -> None:
    assert coverage.find_nearest_axis(np.array([0.1, -0.9, 0.2])) == "y"
