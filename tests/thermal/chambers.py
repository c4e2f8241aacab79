"""Campaigns in a chamber with known truth, and the estimator that attains the bound on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.maths.equation import polynomial, temperature_model
from agonic.maths.estimation import leastsq
from agonic.simulation.thermal import make_readings, random_drifting
from agonic.thermal.maths.stations import list_standard_rotations

FIELD = 48_000.0
KNOWN = ag.Reference.constant(FIELD)
_ENTRIES = (slice(None), [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])


class Made(NamedTuple):
    """Samples of a campaign, the sensor's truth, the field at each row, and the noise drawn."""

    samples: ag.Samples
    truth: object
    field_m: np.ndarray
    field_n: np.ndarray
    noise: np.ndarray


def campaign(
    seed: int = 0,
    *,
    n: int = 300,
    noise: float = 20.0,
    fixture_deg: float = 0.0,
    azimuth_deg: float = 20.0,
    per_rate: float = 0.0,
    mount: Rotation | None = None,
) -> Made:
    """Twelve stations, n readings cooling and n heating each; −10…50 °C; 48 µT at 65° dip."""
    rng = np.random.default_rng(seed)
    truth = random_drifting(rng, per_rate=per_rate)
    a, dip = np.radians(azimuth_deg), np.radians(65.0)
    field_n = FIELD * np.array([np.cos(dip) * np.cos(a), np.cos(dip) * np.sin(a), np.sin(dip)])
    t = np.concatenate([np.linspace(50, -10, n), np.linspace(-10, 50, n)])
    rate = np.repeat([-6.0 / n, 6.0 / n], n)  # °C/s, a reading every ten seconds
    parts, fields = [], []
    for turned in list_standard_rotations():
        off = Rotation.from_rotvec(np.radians(fixture_deg) * rng.standard_normal(3)).as_matrix()
        seen = (turned @ off).T @ field_n
        if mount is not None:
            seen = mount.inv().apply(seen)
        fields.append(np.tile(seen, (2 * n, 1)))
        parts.append(make_readings(truth, fields[-1], t, rate))
    drawn = noise * rng.standard_normal((24 * n, 3))
    station = np.repeat(np.arange(1.0, 13.0), 2 * n)
    samples = ag.Samples(
        field=np.concatenate(parts) + drawn,
        temperature=np.tile(t, 12),
        station=station,
        time=10.0 * np.arange(24.0 * n) + 600.0 * station,
    )
    return Made(samples, truth, np.concatenate(fields), field_n, drawn)


def nine(calibration, temperature: np.ndarray) -> np.ndarray:
    """bias x y z, then matrix × field xx yy zz xy xz yz, nT, at temperatures, (t, 9)."""
    matrix = FIELD * calibration.matrix_at(temperature)[_ENTRIES]
    return np.hstack([calibration.bias_at(temperature), matrix])


def efficient(made: Made, temperature: np.ndarray, *, turns: bool) -> np.ndarray:
    """Errors (t, 9) of the estimator linearised at the truth, which attains the Cramér–Rao bound.

    With turns known exactly, unknown are the field (of known magnitude) and the mounting.
    """
    size = len(made.samples) // 12
    information, gradient = 0.0, 0.0
    for station, turned in enumerate(list_standard_rotations()):
        part = slice(station * size, (station + 1) * size)
        rows, seen = _linearised(made, part, turned if turns else None)
        information = information + rows.T @ rows
        gradient = gradient + rows.T @ seen
    step = -leastsq.inverse(information) @ gradient
    p = polynomial.powers(polynomial.scale(temperature, 20.0, 30.0), 3)
    error = p @ step[:36].reshape(9, 4).T
    error[:, 3:] *= FIELD
    return error


def _linearised(made: Made, part: slice, turned: np.ndarray | None):
    """Jacobian and noise of the residuals of a station at the truth."""
    truth, field_m, noise = made.truth, made.field_m[part], made.noise[part]
    t = made.samples.temperature[part]
    phi, onto = (
        polynomial.powers(polynomial.scale(t, 20.0, 30.0), 3),
        temperature_model.build_layout(3),
    )
    bias, matrix = truth.bias_at(t), truth.matrix_at(t)
    clean = bias + np.linalg.solve(matrix, field_m[:, :, None])[:, :, 0]
    if turned is None:
        _, by = temperature_model.size_residual(clean, bias, matrix, np.full(len(t), FIELD))
        size = np.linalg.norm(by[:, :3], axis=1)
        rows = temperature_model.chain_to_coefficients(by, onto, phi) / size[:, None]
        return rows, -np.einsum("ni,ni->n", by[:, :3], noise) / size
    _, by, inverse = temperature_model.reading_residual(clean, bias, matrix, field_m)
    rows = temperature_model.chain_to_coefficients(
        by.reshape(-1, 12), onto, np.repeat(phi, 3, axis=0)
    )
    tangent = np.linalg.svd(made.field_n[None])[2][1:].T
    crossed = np.swapaxes(np.cross(np.eye(3)[None], field_m[:, None, :]), 1, 2) / FIELD
    across = np.broadcast_to(turned.T @ tangent, (len(t), 3, 2))
    nuisance = -inverse @ np.concatenate([across, crossed], axis=2)
    return np.hstack([rows, nuisance.reshape(len(rows), -1)]), noise.ravel()
