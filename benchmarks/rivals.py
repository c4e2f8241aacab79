"""What a user would type for the same work with NumPy and SciPy alone: the yardsticks of `ratios`.

None of them has standard errors, coverage, findings or a choice of model.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import sph_legendre_p_all

import agonic as ag
from agonic.maths.equation import network
from benchmarks import problems
from benchmarks.problems import FIELD_N, MAGNITUDE, Work

Array = NDArray[np.float64]


def _unpack(params: Array) -> tuple[Array, Array]:
    xx, yy, zz, xy, xz, yz = params[3:9]
    return params[:3], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


START = (0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


def magnitude(n: int, loss: str = "linear") -> Work:
    """Nine unknowns by |W (raw − b)| − 1, with SciPy's differences; a robust loss or none."""
    points = problems.scattered(n).field / MAGNITUDE

    def residuals(params: Array) -> Array:
        bias, matrix = _unpack(params)
        return np.asarray(np.linalg.norm((points - bias) @ matrix, axis=1) - 1.0)

    return partial(least_squares, residuals, START, loss=loss, f_scale=0.01)


def body_field(n: int) -> Array:
    """The unit field of the place in body axes, by roll, pitch and heading."""
    from scipy.spatial.transform import Rotation

    samples = problems.beside_attitude(n)
    angles = np.column_stack([samples.heading_deg, samples.pitch_deg, samples.roll_deg])
    turned = Rotation.from_euler("ZYX", angles, degrees=True)
    return np.asarray(turned.apply(FIELD_N, inverse=True)) / MAGNITUDE


def vector(n: int) -> Work:
    """Nine unknowns by W (raw − b) − field."""
    points, field = problems.beside_attitude(n).field / MAGNITUDE, body_field(n)

    def residuals(params: Array) -> Array:
        bias, matrix = _unpack(params)
        return np.asarray(((points - bias) @ matrix - field).ravel())

    return partial(least_squares, residuals, START)


def levelled(n: int) -> Work:
    """Nine unknowns by |W (raw − b)| − 1 and its part along down."""
    samples = problems.beside_attitude(n)
    points = samples.field / MAGNITUDE
    roll, pitch = np.radians(samples.roll_deg), np.radians(samples.pitch_deg)
    down = np.column_stack(
        [-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)]
    )
    vertical = FIELD_N[2] / MAGNITUDE

    def residuals(params: Array) -> Array:
        bias, matrix = _unpack(params)
        field = (points - bias) @ matrix
        dip = (field * down).sum(axis=1) - vertical
        return np.concatenate([np.linalg.norm(field, axis=1) - 1.0, dip])

    return partial(least_squares, residuals, START)


def interference(n: int) -> Work:
    """Twelve unknowns by W (raw − b − c I) − field."""
    samples, field = problems.disturbed(n), body_field(n)
    points, current = samples.field / MAGNITUDE, next(iter(samples.disturbers.values()))

    def residuals(params: Array) -> Array:
        bias, matrix = _unpack(params)
        clean = points - bias - np.outer(current, params[9:])
        return np.asarray((clean @ matrix - field).ravel())

    return partial(least_squares, residuals, (*START, 0.0, 0.0, 0.0))


def thermal(n: int, degree: int = 2) -> Work:
    """Plain least squares of the readings on powers of the temperature times 1 and the field."""
    samples, field = problems.warmed(n), problems.tumbled(n).field_b / MAGNITUDE
    scale = (samples.temperature - 20.0) / 30.0
    design = np.column_stack(
        [scale**d * f for d in range(degree + 1) for f in (np.ones(n), *field.T)]
    )
    return partial(np.linalg.lstsq, design, samples.field, rcond=None)


def trained(n: int = 1500) -> Work:
    """A network of three nodes by MINPACK, with the exact Jacobian."""
    from agonic.network.simulate import simulate_paper
    from benchmarks.network import scaled
    from benchmarks.network_rivals import train_by_scipy

    made = simulate_paper(15.0, directions="space", seed=0)
    problem = scaled(made, made, 3, 3, "published").problem
    begin = network.draw_weights(np.random.default_rng(0), problem.shape)
    return partial(train_by_scipy, "lm", problem, begin)


def filtered(n: int) -> Work:
    """An extended Kalman filter of three unknowns as a textbook has it, in a loop."""
    made, reference = problems.orbited(n)
    steps = np.diff(made.samples.time, prepend=0.0)
    rows = list(zip(steps, made.samples.field, reference.values, strict=True))

    def follow() -> Array:
        bias, cov = np.zeros(3), np.eye(3) * 1e8
        walk, noise = np.eye(3) * 0.4**2, 100.0**2
        for step, raw, size in rows:
            cov = cov + walk * step
            field = raw - bias
            length = np.sqrt(field @ field)
            towards = -field / length
            gain = cov @ towards / (towards @ cov @ towards + noise)
            bias = bias + gain * (size - length)
            cov = cov - np.outer(gain, towards @ cov)
        return bias

    return follow


def legendre(n: int) -> Work:
    """SciPy's Legendre functions of degree 13 at as many points, and no sum over them."""
    colatitude = np.random.default_rng(0).uniform(0.0, np.pi, n)
    return partial(sph_legendre_p_all, 13, 13, colatitude, diff_n=1)


def paged(n: int) -> tuple[Work, Work]:
    """The page of a calibration, beside the calibration it tells of."""
    from agonic.recording.document import render

    work = problems.calibrate(n)
    result = work()
    assert isinstance(result, ag.Calibrated)
    return partial(render, [result], title="log"), work
