"""The simulation of Huang, Hendeby & Skog: python -m benchmarks.inertial_published [--draws 100].

arXiv 2505.16662: six turns at 0.1 rad/s about axes x, y, z and between, with 0.05 rad/s of wobble,
at 80 Hz; every error of magnetometer, accelerometer and gyro drawn anew.
"""

from __future__ import annotations

import time as clock
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.maths.rotations.attitude import integrate_rates
from benchmarks import tables

RATE_HZ = 80.0
FIELD_NT = 50_000.0
SCALED = 27.0
"""Their readings are of a field of one, and 27 times as large."""
AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1))
GRAVITY = 9.80665
INTRODUCTION = """{draws} draws; dip and magnitude unknown, the gyro's scale known to 1e-4. rmse
over the root of the mean stated variance, and ANEES (error in units of the stated covariance,
squared, for each number; 1 is honest) with what the draws scatter it by, for each group. A fit took
{seconds:.1f} s of processor time, so {sensors} sensors take {cores} cores {together:.0f} s; all
draws took {wall:.0f} s beside what else the machine did."""
WORKERS = 2
SENSORS = 30


class Drawn(NamedTuple):
    """A log with the truth: bias (3,), matrix (3, 3) to the inertial unit's axes, dip, rad, biases
    of accelerometer and gyro."""

    log: ag.Samples
    bias: np.ndarray
    matrix: np.ndarray
    dip: float
    force_bias: np.ndarray
    rate_bias: np.ndarray


def draw(seed: int) -> Drawn:
    """One sensor and its log."""
    rng = np.random.default_rng(seed)
    turns = []
    for axis in AXES:
        size = np.linalg.norm(axis)
        rows = round(2 * np.pi / 0.1 / size * RATE_HZ)
        turns.append(np.tile(0.1 * np.asarray(axis, float), (rows, 1)))
    rate = np.concatenate(turns)
    rate = rate + 0.05 * rng.standard_normal(rate.shape)
    n = len(rate)
    time = np.arange(n) / RATE_HZ
    back = integrate_rates(rate, time).as_matrix().transpose(0, 2, 1)
    dip = np.radians(rng.uniform(67.0, 77.0))
    field = FIELD_NT * back @ np.array([np.cos(dip), 0.0, np.sin(dip)])
    force = back @ np.array([0.0, 0.0, -GRAVITY])
    skewed = np.eye(3)
    skewed[[1, 2, 2], [0, 0, 1]] = np.radians(rng.uniform(-10, 10, 3))
    turned = Rotation.from_euler("xyz", rng.uniform(-5, 5, 3), degrees=True).as_matrix()
    response = np.diag(1.0 + rng.uniform(-0.1, 0.1, 3)) @ skewed @ turned
    bias = rng.uniform(-2, 2, 3) / SCALED * FIELD_NT
    root = np.sqrt(RATE_HZ)
    force_bias = rng.uniform(-0.5, 0.5, 3)
    rate_bias = 0.01 + np.radians(rng.uniform(-0.1, 0.1, 3))
    log = ag.Samples(
        time=time,
        field=field @ response.T + bias + 0.003 * FIELD_NT * root * rng.standard_normal((n, 3)),
        unit="nT",
        acceleration=force + force_bias + 0.02 * root * rng.standard_normal((n, 3)),
        rotation_rate=rate + rate_bias + 8.7e-4 * root * rng.standard_normal((n, 3)),
    )
    return Drawn(log, bias, np.linalg.inv(response), dip, force_bias, rate_bias)


def fit(drawn: Drawn):
    """What `fit_inertial` makes of it, priors as wide as the draws."""
    return ag.fit_inertial(
        drawn.log,
        soft_iron_sd=0.2,
        turn_sd_deg=10.0,
        accelerometer_sd_m_s2=0.5,
        gyro_scale_sd=1e-4,
        gyro_bias_sd_deg_s=2.0,
    )


def compare(drawn: Drawn, found) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Errors and their covariance for each group."""
    covariance = np.asarray(found.calibration.covariance)
    gain = np.trace(drawn.matrix) / 3
    order = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)]
    matrix = np.array([found.calibration.matrix[k] * gain - drawn.matrix[k] for k in order])
    level, below = found.reference.values[0]
    dip = np.array([np.arctan2(below, level) - drawn.dip])
    sd = np.asarray(found.inertial_sd)
    # the mean gain is one by choice, so what is left of the matrix has eight numbers
    shape = np.linalg.svd(np.eye(9) - np.outer(np.eye(9)[:3].sum(0), np.eye(9)[:3].sum(0)) / 3)[0]
    own = shape[:, :8].T
    return {
        "bias of the magnetometer": (found.calibration.bias - drawn.bias, covariance[:3, :3]),
        "matrix": (own @ matrix, own @ covariance[3:, 3:] @ own.T * gain**2),
        "bias of the accelerometer": (
            found.accelerometer_bias - drawn.force_bias,
            np.diag(sd[:3] ** 2),
        ),
        "bias of the gyro": (found.gyro_bias - drawn.rate_bias, np.diag(sd[3:6] ** 2)),
        "dip": (dip, np.diag(sd[-1:] ** 2)),
    }


def run(seed: int) -> tuple[float, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """The processor time of a fit, s, and its errors."""
    drawn = draw(seed)
    before = clock.process_time()
    found = fit(drawn)
    return clock.process_time() - before, compare(drawn, found)


def describe(draws: int) -> str:
    """The table of groups."""
    tables.progress(f"{draws} draws")
    began = clock.perf_counter()
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        spent, found = zip(*pool.map(run, range(draws)), strict=True)
    wall = clock.perf_counter() - began
    rows = []
    for name in found[0]:
        errors, stated = (
            np.stack(side) for side in zip(*(one[name] for one in found), strict=True)
        )
        rmse = np.sqrt(np.mean(errors**2))
        sd = np.sqrt(np.mean(np.diagonal(stated, axis1=1, axis2=2)))
        squares = np.einsum("ni,ni->n", errors, np.linalg.solve(stated, errors[..., None])[..., 0])
        anees = squares.mean() / errors.shape[1]
        scatter = np.sqrt(2 / errors.size)
        rows.append([name, f"{rmse:.3g}", f"{rmse / sd:.2f}", f"{anees:.2f} ± {scatter:.2f}"])
    head = ["group", "rmse", "rmse / stated", "ANEES"]
    seconds = sum(spent) / draws
    said = INTRODUCTION.format(
        draws=draws,
        seconds=seconds,
        sensors=SENSORS,
        cores=WORKERS,
        together=SENSORS * seconds / WORKERS,
        wall=wall,
    )
    return said + "\n\n" + tables.markdown(head, rows)


def main() -> None:
    """The table alone."""
    asked = tables.arguments("the published simulation of a joint calibration", draws=100)
    print(describe(min(asked.draws, 3) if asked.quick else asked.draws))


if __name__ == "__main__":
    main()
