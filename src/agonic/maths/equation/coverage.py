"""Which directions were visited, and how well a calibration is known where they were not."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import correction_jacobian, model_basis

DOWN = np.array([0.0, 0.0, 1.0])
"""Where the axes forward, right, down have down in a level vehicle."""
_NEAR_AXIS = 0.9  # cosine; 26°
_LEVEL_AXIS = 0.87  # cosine; 30°
KEEPS_LEVEL = 0.9
"""Length of the mean of directions that stay within some 35°."""


@lru_cache(maxsize=1)
def icosphere() -> tuple[Array, Array]:
    """Centres (80, 3) and triangles (80, 3, 3) of an icosahedron with each face cut in four."""
    golden = (1 + np.sqrt(5)) / 2
    corners = np.array(
        [p for a in (-1, 1) for b in (-golden, golden) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    ) / np.hypot(1, golden)
    close = corners @ corners.T > 0.4
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if close[i, j] and close[j, k] and close[i, k]
    ]
    triangles = []
    for a, b, c in corners[np.array(faces)]:
        ab, bc, ca = (_unit(p + q) for p, q in ((a, b), (b, c), (c, a)))
        triangles += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    cells = np.array(triangles)
    return _unit(cells.mean(axis=1)), cells


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def find_cells(directions: Array) -> Index:
    """The cell, 0…79, whose centre is nearest to each direction (n, 3); lengths do not matter."""
    centres = icosphere()[0].astype(np.float32).T
    size = float(np.abs(directions).max(initial=1.0))  # so that no length is too much for float32
    cells = np.empty(len(directions), dtype=np.intp)
    for start in range(0, len(directions), 2048):  # blocks that stay in the cache
        rows = slice(start, start + 2048)
        np.argmax((directions[rows] / size).astype(np.float32) @ centres, axis=1, out=cells[rows])
    return cells


def count_visits(directions: Array) -> NDArray[np.int64]:
    """How many directions (n, 3) fall into each of the 80 cells, (80,)."""
    return np.bincount(find_cells(directions), minlength=80)


def field_covariance(
    directions: Array,
    magnitude: Array | float,
    bias: Array,
    matrix: Array,
    covariance: Array,
    gauge: str,
) -> Array:
    """Covariance (n, 3, 3) of the calibrated field along unit directions (n, 3)."""
    raw = magnitude * directions @ np.linalg.inv(matrix).T + bias
    jacobian = correction_jacobian(raw, bias, matrix) @ model_basis("full", gauge)
    covariance = covariance[: jacobian.shape[2], : jacobian.shape[2]]  # of sources on board none
    by_all = (jacobian.reshape(-1, len(covariance)) @ covariance).reshape(jacobian.shape)
    return np.asarray(by_all @ np.swapaxes(jacobian, 1, 2))


def level_directions(
    inclination_deg: float, headings: int = 36, down: Array = DOWN
) -> tuple[Array, Array]:
    """The field's directions (n, 3) in a level vehicle at even headings, and across them (n, 3).

    The second is the unit horizontal vector whose component of the error turns the heading; `down`
    (3,) is where the sensor's axes have down when the vehicle is level."""
    psi = np.linspace(0, 2 * np.pi, headings, endpoint=False)
    dip = np.radians(inclination_deg)
    along = np.stack([np.cos(psi), -np.sin(psi), np.zeros_like(psi)], axis=1)
    across = np.stack([np.sin(psi), np.cos(psi), np.zeros_like(psi)], axis=1)
    axes = make_level_axes(down)
    return (np.cos(dip) * along + np.sin(dip) * DOWN) @ axes, across @ axes


def make_level_axes(down: Array) -> Array:
    """Nose, right and down, a row each (3, 3), of a level vehicle in the axes of a sensor that has
    down along `down` (3,). The nose is x as far as x is level, else z."""
    if (down == DOWN).all():
        return np.eye(3)
    ahead = np.array([1.0, 0.0, 0.0]) if abs(down[0]) < _NEAR_AXIS else DOWN
    nose = _unit(ahead - down * (down @ ahead))
    return np.stack([nose, np.cross(down, nose), down]) + 0.0


def find_level_down(down: Array, *, squarely: bool = False) -> Array:
    """Where the sensor's axes have down when its vehicle is level, (3,), by all its downs (n, 3).

    It is z, unless the vehicle keeps near another attitude: then the sensor is mounted otherwise.
    `squarely` where a lean in between is the vehicle's own: then it is the nearest axis."""
    mean = np.asarray(down.mean(axis=0))
    size = float(np.linalg.norm(mean))
    near_z = mean[2] > _LEVEL_AXIS * size
    if near_z or size < KEEPS_LEVEL:
        return DOWN
    if squarely:
        axis = int(np.argmax(np.abs(mean)))
        return np.asarray(np.sign(mean[axis]) * np.eye(3)[axis]) + 0.0
    return mean / size


def heading_sd_deg(
    inclination_deg: float,
    magnitude: Array | float,
    matrix: Array,
    covariance: Array,
    gauge: str,
    *,
    but_constant: bool = False,
    down: Array = DOWN,
) -> Any:
    """Standard error of the heading of a level vehicle, rms over all headings, degrees, (…).

    σ_ψ² = ∂ψ C ∂ψᵀ with the derivatives of `heading_jacobian_deg`. Broadcasts over magnitude (…),
    matrix (…, 3, 3) and covariance (…, 9, 9). `but_constant`: of what is left beside one constant
    angle of all headings. `down` as in `level_directions`.
    """
    local = heading_jacobian_deg(inclination_deg, magnitude, matrix, gauge, down)
    if but_constant:
        local = local - local.mean(axis=-2, keepdims=True)
    return find_rms_sd(local, covariance)


def find_rms_sd(jacobian: Array, covariance: Array) -> Any:
    """The standard error of numbers with such derivatives (…, n, m), rms over all n, (…)."""
    variance = ((jacobian @ covariance) * jacobian).sum(axis=-1).mean(axis=-1)
    return np.sqrt(np.maximum(variance, 0.0))[()]  # rounding, where nothing is determined


def heading_jacobian_deg(
    inclination_deg: float,
    magnitude: Array | float,
    matrix: Array,
    gauge: str,
    down: Array = DOWN,
) -> Array:
    """Derivatives of a level vehicle's heading, degrees, (…, 36, m): a row a heading.

    e·δ(W d)/(F cos I), e horizontal and across the field. An error of bias and matrix enters as
    e·δ(W d) = −(Wᵀe)·δb + eᵀ δW d with d = F W⁻¹ m along the field's direction m.
    """
    directions, across = level_directions(inclination_deg, down=down)
    size = np.asarray(magnitude, dtype=np.float64)[..., None, None]
    d = size * directions @ np.swapaxes(np.linalg.inv(matrix), -1, -2)
    by_matrix = across[:, :, None] * d[..., :, None, :]
    local = np.concatenate(
        [-across @ matrix, by_matrix.reshape(*by_matrix.shape[:-2], 9)], axis=-1
    ) @ model_basis("full", gauge)
    return np.asarray(np.degrees(local / (size * np.cos(np.radians(inclination_deg)))))


def measure_thickness(points: Array) -> tuple[float, Array]:
    """Half the range across the flattest direction over that along the widest, and the former.

    0 for a plane, 1 for a full sphere; ranges between the 1st and 99th percentile so that a few
    outliers do not count.
    """
    centred = points - points.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1]
    low, high = np.percentile(centred @ axes, (1, 99), axis=0)
    spans = high - low
    flattest = int(np.argmin(spans))
    return float(spans[flattest] / max(spans.max(), np.finfo(float).tiny)), axes[:, flattest]


def measure_arc_deg(points: Array) -> float:
    """The angle, degrees, of the arc on which points (n, 3) in a plane lie; 360 for all the way.

    A chord c and the height s of its arc over it span 4 arctan(2 s/c), up to half a circle."""
    centred = points - points.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1]
    height, chord = np.ptp(centred @ axes, axis=0)[1:]
    ratio = 2 * float(height) / max(float(chord), float(np.finfo(float).tiny))
    return float(np.degrees(4 * np.arctan(ratio))) if ratio < 1 else 360.0


def find_missing_axes(counts: NDArray[np.int64], reach_deg: float = 40.0) -> list[str]:
    """The axes, "+x" … "−z", near which the field was never seen."""
    centres = icosphere()[0]
    visited = centres[counts > 0]
    missing = []
    for i, letter in enumerate("xyz"):
        for sign, mark in ((1.0, "+"), (-1.0, "−")):
            axis = sign * np.eye(3)[i]
            if len(visited) == 0 or (visited @ axis).max() < np.cos(np.radians(reach_deg)):
                missing.append(mark + letter)
    return missing


def find_nearest_axis(direction: Array) -> str:
    """The letter of the axis that a direction is closest to."""
    return "xyz"[int(np.argmax(np.abs(direction)))]


def describe_axis(direction: Array) -> str:
    """The letter of the axis that a direction (3,) is near, or its components where none is."""
    nearest = int(np.argmax(np.abs(direction)))
    unit = direction / np.linalg.norm(direction) * np.sign(direction[nearest])
    if unit[nearest] > _NEAR_AXIS:
        return "xyz"[nearest]
    said = ", ".join(f"{value:.2g}" for value in np.round(unit, 2) + 0.0)
    return f"({said})".replace("-", "−")
