"""Fields of dipoles and wires: closed forms, and Maxwell's equations off the sources."""

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from agonic.maths.magnetostatics import (
    NT_M_A,
    dipole_gradient,
    dipole_tensor,
    list_circle,
    wire_field,
)

PLACES = np.random.default_rng(3).normal([0.4, 0.0, 0.3], 1.0, (20, 3))


def gradient(field, at: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """∂field_i/∂x_k by central differences (…, 3, 3)."""
    columns = [(field(at + step * e) - field(at - step * e)) / (2 * step) for e in np.eye(3)]
    return np.stack(columns, axis=-1)


def test_a_dipole_has_the_field_of_the_textbook() -> None:
    moment = np.array([0.3, -0.2, 0.5])
    r = PLACES
    size = np.linalg.norm(r, axis=1)[:, None]
    unit = r / size
    textbook = 1e-7 * (3 * unit * (unit @ moment)[:, None] - moment) / size**3  # tesla
    assert NT_M_A * dipole_tensor(r) @ moment == pytest.approx(1e9 * textbook, rel=1e-12)


def test_the_gradient_of_a_dipole_is_that_of_its_field() -> None:
    moment = np.array([0.3, -0.2, 0.5])
    found = np.einsum("nijk,j->nik", dipole_gradient(PLACES), moment)
    assert found == pytest.approx(gradient(lambda r: dipole_tensor(r) @ moment, PLACES), rel=1e-5)


@pytest.mark.parametrize("source", ["dipole", "loop"])
def test_there_is_no_curl_and_no_divergence_off_a_source(source: str) -> None:
    ring = list_circle(np.array([0.1, 0.0, 0.0]), np.array([0.0, 1.0, 1.0]), 0.2)
    fields = {
        "dipole": lambda r: NT_M_A * dipole_tensor(r) @ np.array([0.1, 0.2, 0.3]),
        "loop": lambda r: wire_field(ring, r),
    }
    made = gradient(fields[source], PLACES)
    size = np.abs(made).max(axis=(1, 2))
    assert (np.abs(np.trace(made, axis1=1, axis2=2)) < 1e-6 * size).all()
    assert (np.abs(made - made.swapaxes(1, 2)).max(axis=(1, 2)) < 1e-6 * size).all()


def circle_field(rho: float, z: float, radius: float) -> tuple[float, float]:
    """Field of a circular current of 1 A across and along its axis, nT, by elliptic integrals
    (Smythe, Static and Dynamic Electricity, 7.10)."""
    far = (radius + rho) ** 2 + z**2
    near = (radius - rho) ** 2 + z**2
    m = 4 * radius * rho / far
    k, e = ellipk(m), ellipe(m)
    scale = 2 * NT_M_A / np.sqrt(far)
    along = scale * (k + (radius**2 - rho**2 - z**2) / near * e)
    across = scale * z / rho * (-k + (radius**2 + rho**2 + z**2) / near * e)
    return across, along


@pytest.mark.parametrize("at", [(0.05, 0.05), (0.15, 0.0), (0.02, -0.3), (0.4, 0.2)])
def test_a_circle_has_the_field_of_elliptic_integrals(at: tuple[float, float]) -> None:
    ring = list_circle(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.1)
    found = wire_field(ring, np.array([at[0], 0.0, at[1]]))
    across, along = circle_field(*at, 0.1)
    size = np.hypot(across, along)
    assert found[[0, 2]] == pytest.approx([across, along], abs=0.002 * size)
    assert found[1] == pytest.approx(0.0, abs=1e-9 * size)


def test_a_small_loop_is_a_dipole() -> None:
    axis = np.array([1.0, 2.0, -2.0]) / 3
    ring = list_circle(np.zeros(3), axis, 0.01)
    far = 50 * PLACES / np.linalg.norm(PLACES, axis=1)[:, None] * 0.01
    dipole = NT_M_A * dipole_tensor(far) @ (np.pi * 0.01**2 * axis)
    assert np.abs(wire_field(ring, far) - dipole).max() < 2e-3 * np.abs(dipole).max()
