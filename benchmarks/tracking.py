"""How many readings a second a tracker follows: python -m benchmarks.tracking [--draws 3]."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from tests.inflight.turning import turn_about

from agonic.calibration.tracking import TrackerParams, TrackerState
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.inflight.tracking import start, update
from benchmarks import tables
from benchmarks.speed import median_s

Array = np.ndarray
INTRODUCTION = """Processor time of one core, median of {draws} runs over {n} readings of a
simulated orbit, a tenth of them beside a gyro (of those a tenth without numba, a hundredth one a
call). The filter takes every reading by itself; gate, jump test, history and what is kept to go
back to a jump are in the figures."""
MODELS = {
    "bias alone": {"solve": "bias", "walk": 0.4},
    "bias and matrix": {"walk": 0.4},
    "… with an external field": {"walk": 0.4, "external_sd": 20.0},
    "… with a walk of the matrix": {"walk": 0.4, "external_sd": 20.0, "matrix_walk": 1e-8},
}
BESIDE_GYRO = {"beside a gyro, bias": "bias", "beside a gyro, bias and matrix": "full"}
WARM = 3000  # readings after which the bias has settled


def orbit(n: int) -> tuple[Array, Array, Array]:
    """Times, readings and reference magnitudes of a tumbling satellite."""
    made = simulate_orbit(n=n, thermal=0.0, external=20.0, bias=3000.0, pointing="tumble", seed=1)
    assert made.samples.time is not None
    raw = made.samples.field @ made.truth.matrix_at([0.0])[0].T  # so that the bias alone will do
    return made.samples.time, raw, np.linalg.norm(made.field_n - made.external_n, axis=1)


def follow(
    state: TrackerState, params: TrackerParams, data: tuple[Array, ...], compiled: bool
) -> None:
    """All readings in one call; a gyro's rates are the fourth of the data."""
    time, raw, magnitude, *rate = data
    update(state, params, time, raw, magnitude, rate=rate[0] if rate else None, compiled=compiled)


def one_by_one(state: TrackerState, params: TrackerParams, data: tuple[Array, ...]) -> None:
    """A call a reading, as on board or on a live stream, without numba."""
    for time, raw, magnitude, *rate in zip(*data, strict=True):
        beside = rate[0] if rate else None
        state, _ = update(state, params, time, raw, magnitude, rate=beside, compiled=False)


def speed(work: Callable[[], None], n: int, draws: int) -> str:
    """Thousands of readings a second."""
    return f"{n / median_s(work, draws) / 1e3:.3g}"


def turned(n: int) -> tuple[Array, ...]:
    """Times, readings, reference magnitudes and rates of a sensor that is turned to and fro."""
    made = turn_about(0, n=n, walk=0.0)
    assert made.samples.time is not None
    assert made.samples.rotation_rate is not None
    size = np.linalg.norm(made.field, axis=1)
    return made.samples.time, made.samples.field, size, made.samples.rotation_rate


def measure(
    name: str, state: TrackerState, params: TrackerParams, data: tuple[Array, ...], draws: int
) -> tuple[str, str, str, str]:
    """A row of the table."""
    n = len(data[0])
    few, fewer = (tuple(part[: n // share] for part in data) for share in (10, 100))
    return (
        name,
        speed(partial(follow, state, params, data, True), n, draws),
        speed(partial(follow, state, params, few, False), n // 10, draws),
        speed(partial(one_by_one, state, params, fewer), n // 100, draws),
    )


def main() -> None:
    """Time everything and print the table."""
    asked = tables.arguments("readings a second", draws=3)
    n = 100_000 if asked.quick else 300_000
    time, raw, magnitude = orbit(n + WARM)
    rows = []
    for name, settings in MODELS.items():
        tables.progress(f"tracking: {name}")
        params = TrackerParams(noise=100.0, **settings)
        first, rest = slice(0, WARM), slice(WARM, None)
        state, _ = update(
            start(None, params), params, time[first], raw[first], magnitude[first], compiled=True
        )
        data = (time[rest], raw[rest], magnitude[rest])
        rows.append(measure(name, state, params, data, asked.draws))
    for name, solve in BESIDE_GYRO.items():
        tables.progress(f"tracking: {name}")
        params = TrackerParams(noise=100.0, solve=solve, gyro=True)
        whole = turned(n // 10 + WARM)
        state = start(None, params, gyro=True)
        warm, data = (tuple(part[rows_] for part in whole) for rows_ in (first, rest))
        state, _ = update(state, params, *warm[:3], rate=warm[3], compiled=True)
        rows.append(measure(name, state, params, data, asked.draws))
    print(INTRODUCTION.format(draws=asked.draws, n=n))
    print()
    header = ("thousand readings a second", "numba", "without", "without, one a call")
    print(tables.markdown(header, rows))


if __name__ == "__main__":
    main()
