"""What each estimator is asked, of any number of rows: for `growth` and `ratios`.

Each gives the work as a function without arguments, all data made beforehand.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import agonic as ag
from agonic.alignment.simulation.laboratory import simulate_coil, simulate_gravity
from agonic.alignment.simulation.session import simulate_session
from agonic.calibration.tracking import TrackerParams
from agonic.ellipse.fit import fit_ellipse
from agonic.ellipsoid.many_sensors import fit_many
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.inflight.tracking import start, update
from agonic.network.simulate import simulate_nonaffine, simulate_paper
from agonic.simulation.sensor import Simulated

Array = NDArray[np.float64]
Work = Callable[[], Any]

MAGNITUDE = 50_000.0
FIELD_N = (25_000.0, 0.0, 43_301.27)
"""The field of `simulate`: 50 000 nT dipping by 60°."""
OF_SIZE = ag.Reference.constant(MAGNITUDE)
OF_LEVEL = ag.Reference.horizontal_vertical(FIELD_N[0], FIELD_N[2])
OF_VECTOR = ag.Reference.vector(FIELD_N, frame="n")
RATE_HZ = 20.0


@cache
def tumbled(n: int) -> Simulated:
    """Readings of a sensor that is tumbled, with attitude, acceleration and rotation rate."""
    return ag.simulate("tumble", n=n, rate_Hz=RATE_HZ, seed=1)


@cache
def beside_attitude(n: int) -> ag.Samples:
    """The same with nothing but the attitude."""
    return tumbled(n).samples.with_columns(rotation_rate=None, acceleration=None)


@cache
def scattered(n: int) -> ag.Samples:
    """Readings from all sides, with nothing beside them."""
    rng = np.random.default_rng(1)
    field = rng.standard_normal((n, 3))
    field *= MAGNITUDE / np.linalg.norm(field, axis=1, keepdims=True)
    iron = [[1.05, 0.02, -0.01], [0.02, 0.97, 0.03], [-0.01, 0.03, 1.02]]
    raw = field @ iron + [3000.0, -500.0, 100.0] + 200.0 * rng.standard_normal((n, 3))
    return ag.Samples(field=raw, time=np.arange(n) / RATE_HZ)


def ellipsoid(n: int) -> Work:
    return partial(ag.fit_ellipsoid, scattered(n), OF_SIZE)


def adjusted(n: int) -> Work:
    return partial(ag.fit_ellipsoid, scattered(n), OF_SIZE, method="adjusted")


def moments(n: int) -> Work:
    return partial(ag.Moments.of, scattered(n).field)


def levelled(n: int) -> Work:
    return partial(ag.fit_levelled, beside_attitude(n), OF_LEVEL)


def vector(n: int) -> Work:
    return partial(ag.fit_vector, beside_attitude(n), OF_VECTOR)


def disturbed(n: int, sources: int = 1) -> ag.Samples:
    """Currents that come and go, each with its own field."""
    rng = np.random.default_rng(0)
    clean = beside_attitude(n)
    pace = rng.uniform(10.0, 90.0, sources)
    currents = 5.0 * np.sin(np.arange(n)[:, None] / pace + pace) ** 2
    strays = rng.uniform(-150.0, 150.0, (sources, 3))
    more = {f"motor{k + 1}_A": currents[:, k] for k in range(sources)}
    return clean.with_columns(field=clean.field + currents @ strays, disturbers=more)


def interference(n: int, sources: int = 1) -> Work:
    samples = disturbed(n, sources)
    return partial(ag.fit_interference, samples, OF_VECTOR, sources=tuple(samples.disturbers))


def inertial(n: int) -> Work:
    return partial(ag.fit_inertial, tumbled(n).samples, OF_LEVEL)


def calibrate(n: int) -> Work:
    """The main job without reading and writing: choice of the fit, held-out checks, findings."""
    return partial(ag.calibrate, tumbled(n).samples, OF_SIZE)


def warmed(n: int) -> ag.Samples:
    """A bias that follows the temperature, which rises and falls once."""
    clean = beside_attitude(n)
    warm = 20.0 + 30.0 * np.sin(np.arange(n) * 2.0 * np.pi / n)
    moved = np.outer(warm - 20.0, [30.0, -20.0, 10.0])
    return clean.with_columns(temperature=warm, field=clean.field + moved)


def thermal(n: int, degree: int = 2) -> Work:
    """With the field known at each reading, as in a coil."""
    reference = ag.Reference.vector(tumbled(n).field_b, frame="b")
    return partial(ag.fit_thermal, warmed(n), reference, degree=degree)


@cache
def orbited(n: int) -> tuple[Any, ag.Reference]:
    """A tumbling satellite, ten seconds between readings, and the model along its track."""
    made = simulate_orbit(n=n, rate_Hz=0.1, pointing="tumble", thermal=0.0, bias=3000.0, seed=1)
    return made, ag.Reference.magnitude(np.linalg.norm(made.field_n, axis=1))


def inflight(n: int) -> Work:
    made, reference = orbited(n)
    return partial(ag.fit_inflight, made.samples, reference)


def tracker(n: int, *, compiled: bool = False) -> Work:
    """Bias and matrix, all readings in one call."""
    made, reference = orbited(n)
    params = TrackerParams(noise=100.0, walk=0.4)
    time, raw = made.samples.time, made.samples.field
    state = start(None, params)
    return partial(update, state, params, time, raw, reference.values, compiled=compiled)


def tracked_singly(n: int) -> Work:
    """The bias, a call a reading, as on board."""
    made, reference = orbited(n)
    params = TrackerParams(noise=100.0, walk=0.4, solve="bias")
    rows = list(zip(made.samples.time, made.samples.field, reference.values, strict=True))

    def follow() -> None:
        state = start(None, params)
        for row in rows:
            state, _ = update(state, params, *row, compiled=False)

    return follow


def network(n: int, hidden: int = 4) -> Work:
    """The training alone, of field and temperature."""
    made = simulate_nonaffine(n=n, rate_Hz=n / 1000.0, seed=1)
    settings = {"hidden": hidden, "inputs": ("field", "temperature"), "compared": False}
    return partial(ag.fit_network, made.samples, made.reference, **settings)


def published_network(n: int = 1500) -> Work:
    """The published task: three inputs, three nodes, 1500 readings."""
    made = simulate_paper(15.0, directions="space", seed=0)
    return partial(ag.fit_network, made.samples, made.reference, compared=False)


def two_axes(n: int) -> Work:
    """A level compass of two axes."""
    turned = ag.simulate("circle", n=n, tilt_deg=0.0, seed=1).samples
    flat = ag.Samples(field=turned.field * [1.0, 1.0, 0.0], time=turned.time, axes="xy")
    return partial(fit_ellipse, flat)


def gravity(n: int) -> Work:
    """The turn between magnetometer and accelerometer; 250 readings an orientation."""
    made = simulate_gravity(orientations=max(n // 250, 6), seed=1)
    return partial(ag.fit_gravity, made.samples)


def alignment(n: int) -> Work:
    """A star sensor's rotation; twenty readings an orientation."""
    return partial(ag.fit_alignment, simulate_session(orientations=max(n // 20, 8)).session)


def coil(n: int) -> Work:
    """A coil's axis; five readings between reversals."""
    return partial(ag.fit_coil, simulate_coil(reversals=max(n // 5, 4)).session)


def deviation(n: int) -> Work:
    """The coefficients of a compass on n headings."""
    compass = np.linspace(0.0, 360.0, n, endpoint=False)
    error = 2.0 * np.sin(np.radians(compass)) + 1.5 * np.cos(np.radians(2.0 * compass))
    noise = 0.5 * np.random.default_rng(0).standard_normal(n)
    return partial(ag.fit_deviation, compass, compass + error + noise)


def heading(n: int) -> Work:
    """Headings with standard errors."""
    fit = ag.fit_ellipsoid(beside_attitude(1000), OF_SIZE)
    setup = ag.Setup(compasses=(ag.Compass(calibration=fit.calibration),), declination_deg=2.0)
    return partial(ag.heading, beside_attitude(n), setup)


def world_model(n: int) -> Work:
    """IGRF at points all over the Earth, without numba's start."""
    rng = np.random.default_rng(0)
    latitude, longitude = rng.uniform(-90.0, 90.0, n), rng.uniform(-180.0, 180.0, n)
    model = ag.igrf()
    return partial(model.at, latitude, longitude, 0.0, "2025-06-01")


def fleet(sensors: int) -> Work:
    """Sensors of 200 readings each, fitted at once from their moments."""
    raw = scattered(200).field
    one = ag.Moments.of(raw)
    shifts = np.random.default_rng(0).uniform(-5000.0, 5000.0, (sensors, 3))
    sums = np.broadcast_to(one.sums, (sensors, len(one.sums)))
    scale = np.full(sensors, one.scale)
    return partial(fit_many, sums, one.centre + shifts, scale, OF_SIZE)
