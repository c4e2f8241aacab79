"""Orbits with a scalar instrument and a star camera, and the bound of what they can determine."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import agonic as ag
from agonic.calibration.thermal import Thermal
from agonic.inflight.fit import fit_inflight
from agonic.inflight.simulation.orbit import SimulatedOrbit, simulate_orbit
from agonic.maths.rotations.attitude import rot_nb
from agonic.simulation.draws import draw_directions
from agonic.thermal.fit.fit import fit_thermal
from tests.thermal.chambers import KNOWN, campaign

Array = NDArray[np.float64]

ARCSEC = np.degrees(1.0) * 3600.0
SCALAR_SD, VECTOR_SD, STAR_ARCSEC = 0.1, 0.3, 4.0
PRECISE = {
    "noise": VECTOR_SD,
    "scalar_sd": SCALAR_SD,
    "attitude_sd_deg": STAR_ARCSEC / 3600,
    "mounting_deg": 30.0,
    "thermal": 30.0,
    "external": 0.0,
    "pointing": "nadir",
}


def precise(seed: int, n: int, days: float) -> tuple[SimulatedOrbit, ag.inflight.InflightFit]:
    """Ten days with scalar instrument and star camera, and the fit."""
    made = simulate_orbit(n=n, rate_Hz=n / (86_400 * days), sensor=SENSOR, seed=seed, **PRECISE)
    scalar = ag.Reference.magnitude(made.samples.scalar)
    fit = fit_inflight(made.samples, scalar, attitude="logged", drift_knots=0, temperature_degree=3)
    return made, fit


class FromChamber(NamedTuple):
    """A fit in orbit on top of one in a chamber: error of the bias over its standard error and in
    nT, at the middle temperature (3,) and over the swing (t, 3), what ground and change together
    state there (t, 3), and that swing, °C."""

    fit: ag.inflight.InflightFit
    z: Array
    error: Array
    over_swing: Array
    stated: Array
    swing_C: float


def from_chamber(seed: int, *, magnitude_known: bool, iron: float = 2000.0) -> FromChamber:
    """Twelve stations in a chamber, then iron beside the sensor, then a day in orbit at 0.1 Hz.

    raw = W(T)⁻¹ (field + iron) + bias(T) + noise
    """
    made = campaign(seed, n=150)
    ground = fit_thermal(made.samples, KNOWN if magnitude_known else None).calibration
    flown = simulate_orbit(
        n=8640, rate_Hz=0.1, noise=20.0, external=5.0, sensor=made.truth, pointing="tumble",
        equilibrium_C=(-18.0, 43.0), seed=seed,
    )  # fmt: skip
    added = iron * draw_directions(np.random.default_rng((seed, 1)), 1)[0]

    def true_bias(temperature: Array) -> Array:
        return made.truth.bias_at(temperature) + np.linalg.solve(
            made.truth.matrix_at(temperature), added
        )

    temperature = flown.samples.temperature
    raw = flown.samples.field + true_bias(temperature) - made.truth.bias_at(temperature)
    fit = fit_inflight(flown.samples.with_columns(field=raw), ground=ground)
    low, high = temperature.min(), temperature.max()
    error = fit.after.bias - true_bias(np.array([(low + high) / 2]))[0]
    at = np.linspace(low, high, 9)
    over_swing = fit.calibration.correct(true_bias(at), temperature=at)
    known = fit.calibration.uncertainty(true_bias(at), temperature=at)
    stated = np.sqrt(np.einsum("tii->ti", known))
    away = error / fit.after.sd[:3]
    return FromChamber(fit, away, error, over_swing, stated, float(high - low))


def _sensor() -> Thermal:
    """A sensor whose gains, angles and biases follow cubics in temperature."""
    rng = np.random.default_rng(7)
    sizes = np.array([3e-3, 5e-4, 2e-4, 5e-5])
    matrix = []
    for power, size in enumerate(sizes):
        part = size * rng.normal(size=(3, 3))
        matrix.append((part + part.T) / 2 + (np.eye(3) if power == 0 else 0.0))
    bias = rng.normal(size=(4, 3)) * np.array([[20.0], [5.0], [2.0], [1.0]])
    return Thermal(bias=bias, matrix=matrix, centre_C=10.0, half_range_C=25.0)


SENSOR = _sensor()


def coefficients(of: Thermal) -> Array:
    """Bias and matrix entries by power, as `Thermal.parameters` has them, (36,)."""
    six = of.matrix[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return np.concatenate([of.bias.T.ravel(), six.T.ravel()])


def with_coefficients(of: Thermal, values: Array) -> Thermal:
    """The same with other coefficients."""
    p = len(of.bias)
    entries = values[3 * p :].reshape(6, p).T
    matrix = entries[:, [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
    return replace(of, bias=values[: 3 * p].reshape(3, p).T, matrix=matrix, covariance=None)


def rescaled(of: Thermal, centre_C: float, half_range_C: float) -> Thermal:
    """The same polynomials about another centre."""
    nodes = np.linspace(-1, 1, len(of.bias))
    at = centre_C + half_range_C * nodes
    back = np.linalg.inv(nodes[:, None] ** np.arange(len(of.bias)))
    bias = back @ of.bias_at(at)
    matrix = np.tensordot(back, of.matrix_at(at), axes=1)
    return Thermal(bias=bias, matrix=matrix, centre_C=centre_C, half_range_C=half_range_C)


def efficient(made: SimulatedOrbit, truth: Thermal) -> tuple[Array, Array]:
    """Errors (39,) of the estimator linearised at the truth, and the Cramér–Rao covariance, of the
    36 coefficients and the rotation vector in body axes.

    Of each reading are known |field| to √(0.3² + 0.1²) nT, and the two components across it, in the
    axes of the star camera, to √(0.3² + (4″ F)²). Derivatives by differences of `Thermal.correct`.
    """
    samples = made.samples
    angles = (samples.roll_deg, samples.pitch_deg, samples.heading_deg)
    along_b = np.einsum("nji,nj->ni", rot_nb(*angles), made.field_n)
    f = np.linalg.norm(along_b, axis=1)
    aim = along_b / f[:, None]
    other = np.roll(aim, 1, axis=1) + np.array([0.1, 0.2, 0.3])
    side = np.cross(aim, other)
    side /= np.linalg.norm(side, axis=1)[:, None]
    axes = np.stack([aim, side, np.cross(aim, side)], axis=1)
    turn = made.rot_bm

    def seen(values: Array) -> Array:
        field = with_coefficients(truth, values).correct(
            samples.field, temperature=samples.temperature
        )
        return np.asarray(np.einsum("nij,nj->ni", axes, turn.apply(field)))

    values = coefficients(truth)
    columns = []
    for k in range(len(values)):
        step = np.zeros(len(values))
        step[k] = 1.0 if k < 12 else 1e-4
        columns.append((seen(values + step) - seen(values - step)) / (2 * step[k]))
    for k in range(3):  # a turn of the body's axes moves the field across itself
        moved = np.cross(np.eye(3)[k], along_b)
        columns.append(np.einsum("nij,nj->ni", axes, moved))
    jacobian = np.stack(columns, axis=2)
    across = VECTOR_SD**2 + (STAR_ARCSEC / ARCSEC * f) ** 2
    variance = np.stack([np.full(len(f), VECTOR_SD**2 + SCALAR_SD**2), across, across], axis=1)
    weighted = (jacobian / np.sqrt(variance)[:, :, None]).reshape(-1, len(columns))
    covariance = np.linalg.inv(weighted.T @ weighted)
    found = seen(values)
    field = truth.correct(samples.field, temperature=samples.temperature)
    found[:, 0] = np.linalg.norm(field, axis=1) - samples.scalar
    return -covariance @ weighted.T @ (found / np.sqrt(variance)).ravel(), covariance
