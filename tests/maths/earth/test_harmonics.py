"""The harmonic kernel: closed forms, and the field against the gradient of the potential."""

import math

import numpy as np
import pytest
from scipy.special import lpmv

from agonic.maths.earth import harmonics

POLES = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, -1.02]])


def gauss(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Random Gauss coefficients to a degree, without monopole and without sin 0λ."""
    rng = np.random.default_rng(2)
    g, h = np.tril(rng.normal(size=(2, degree + 1, degree + 1)))
    g[0, 0] = 0.0
    h[:, 0] = 0.0
    return g, h


def points(n: int) -> np.ndarray:
    """Positions between 1 and 1.2 reference radii, the poles and the equator among them."""
    rng = np.random.default_rng(2)
    random = rng.normal(size=(3, n))
    random *= rng.uniform(1.0, 1.2, n) / np.linalg.norm(random, axis=0)
    return np.hstack([POLES, np.eye(3)[:, :2], random])


def potential(position: np.ndarray, g: np.ndarray, h: np.ndarray) -> np.ndarray:
    """V/a = Σ r⁻ⁿ⁻¹ (g cos mλ + h sin mλ) Pₙᵐ, with the Legendre functions of SciPy."""
    r = np.linalg.norm(position, axis=0)
    longitude = np.arctan2(position[1], position[0])
    total = np.zeros(position.shape[1])
    for n, m in np.argwhere(np.tril(np.ones_like(g))).tolist():
        ratio = math.factorial(n - m) / math.factorial(n + m)
        scale = (-1) ** m * math.sqrt((2 - (m == 0)) * ratio)  # SciPy has the phase (−1)ᵐ
        wave = g[n, m] * np.cos(m * longitude) + h[n, m] * np.sin(m * longitude)
        total += r ** (-n - 1) * wave * scale * lpmv(m, n, position[2] / r)
    return total


def test_a_dipole_has_the_field_of_a_dipole() -> None:
    """B = (3 (m·r̂) r̂ − m) / r³ with m = (g₁¹, h₁¹, g₁⁰), at the poles as well."""
    g, h = gauss(1)
    moment = np.array([g[1, 1], h[1, 1], g[1, 0]])
    position = points(50)
    r = np.linalg.norm(position, axis=0)
    expected = (3 * (moment @ position) / r**2 * position - moment[:, None]) / r**3
    field = harmonics.synthesise(position, harmonics.field_coefficients(g, h))
    assert np.abs(field - expected).max() < 1e-14


@pytest.mark.parametrize("degree", [2, 13, 40])
def test_field_is_minus_the_gradient_of_the_potential(degree: int) -> None:
    g, h = gauss(degree)
    position = points(20)[:, POLES.shape[1] :]  # SciPy's functions of cos θ lose digits at poles
    step = 1e-3 / degree
    field = harmonics.synthesise(position, harmonics.field_coefficients(g, h))
    for axis in range(3):
        move = step * np.eye(3)[:, axis, None]
        difference = [
            weight * (potential(position + k * move, g, h) - potential(position - k * move, g, h))
            for k, weight in ((1, 8.0), (2, -1.0))
        ]
        slope = sum(difference) / (12 * step)
        assert np.abs(field[axis] + slope).max() < 2e-9 * np.abs(field).max()


def test_poles_have_their_closed_form() -> None:
    """At the north pole, r = 1: Bz = Σ (n+1) gₙ⁰ and (Bx, By) = −Σ √(n(n+1)/2) (gₙ¹, hₙ¹)."""
    g, h = gauss(133)
    n = np.arange(134)
    slope = np.sqrt(n * (n + 1) / 2)
    expected = np.array([-(slope @ g[:, 1]), -(slope @ h[:, 1]), (n + 1) @ g[:, 0]])
    field = harmonics.synthesise(POLES[:, :1], harmonics.field_coefficients(g, h))[:, 0]
    assert np.abs(field - expected).max() < 1e-11 * np.abs(expected).max()


def test_blocks_join_without_a_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    table = np.dstack([harmonics.field_coefficients(*gauss(5)) for _ in range(2)])
    position = points(100)
    at_once = harmonics.synthesise(position, table)
    monkeypatch.setattr(harmonics, "BLOCK_PRODUCTS", 2 * 6 * 7 * 8)  # blocks of 8 points
    assert np.abs(harmonics.synthesise(position, table) - at_once).max() < 1e-13


def test_every_column_is_a_model_of_its_own() -> None:
    first, second = (harmonics.field_coefficients(*gauss(4)) for _ in range(2))
    position = points(10)
    both = harmonics.synthesise(position, np.dstack([first, second]))
    alone = [harmonics.synthesise(position, table) for table in (first, second)]
    assert np.abs(both - np.vstack(alone)).max() < 1e-13


@pytest.mark.slow
def test_compiled_is_the_same_function() -> None:
    pytest.importorskip("numba")
    position = points(3000)
    for degree in (1, 13):
        table = harmonics.field_coefficients(*gauss(degree))
        plain = harmonics.synthesise(position, table)
        compiled = harmonics.synthesise(position, table, compiled=True)
        assert np.abs(compiled - plain).max() < 1e-12


def test_without_numba_the_plain_kernel_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise ImportError(name)

    table, position = harmonics.field_coefficients(*gauss(3)), points(5)
    plain = harmonics.synthesise(position, table)
    harmonics._compile.cache_clear()
    monkeypatch.setattr(harmonics.importlib, "import_module", absent)
    try:
        assert (harmonics.synthesise(position, table, compiled=True) == plain).all()
    finally:
        harmonics._compile.cache_clear()
