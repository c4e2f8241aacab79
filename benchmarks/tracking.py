"""How many readings a second a tracker follows: python -m benchmarks.tracking [--draws 5]."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from agonic.calibration.tracking import TrackerParams, TrackerState
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.inflight.tracking import start, update
from benchmarks import tables
from benchmarks.speed import median_s

Array = np.ndarray
INTRODUCTION = """Processor time of one core, median of {draws} runs over {n} readings of a
simulated orbit (a tenth of them without numba, a hundredth one a call). The filter takes every
reading by itself; gate, jump test, history and what is kept to go back to a jump are in the
figures."""
MODELS = {
    "bias alone": {"solve": "bias", "walk": 0.4},
    "bias and matrix": {"walk": 0.4},
    "… with an external field": {"walk": 0.4, "external_sd": 20.0},
    "… with a walk of the matrix": {"walk": 0.4, "external_sd": 20.0, "matrix_walk": 1e-8},
}
WARM = 3000  # readings after which the bias has settled


def orbit(n: int) -> tuple[Array, Array, Array]:
    """Times, readings and reference magnitudes of a tumbling satellite."""
    made = simulate_orbit(n=n, thermal=0.0, external=20.0, bias=3000.0, pointing="tumble", seed=1)
    assert made.samples.time is not None
    raw = made.samples.field @ made.truth.matrix_at([0.0])[0].T  # so that the bias alone will do
    return made.samples.time, raw, np.linalg.norm(made.field_n - made.external_n, axis=1)


def follow(
    state: TrackerState, params: TrackerParams, data: tuple[Array, Array, Array], compiled: bool
) -> None:
    """All readings in one call."""
    update(state, params, *data, compiled=compiled)


def one_by_one(
    state: TrackerState, params: TrackerParams, data: tuple[Array, Array, Array]
) -> None:
    """A call a reading, as on board or on a live stream, without numba."""
    for time, raw, magnitude in zip(*data, strict=True):
        state, _ = update(state, params, time, raw, magnitude, compiled=False)


def speed(work: Callable[[], None], n: int, draws: int) -> str:
    """Thousands of readings a second."""
    return f"{n / median_s(work, draws) / 1e3:.3g}"


def main() -> None:
    """Time everything and print the table."""
    asked = tables.arguments("readings a second", draws=5)
    n = 100_000 if asked.quick else 1_000_000
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
        few, fewer = (tuple(part[: n // share] for part in data) for share in (10, 100))
        rows.append(
            (
                name,
                speed(partial(follow, state, params, data, True), n, asked.draws),
                speed(partial(follow, state, params, few, False), n // 10, asked.draws),
                speed(partial(one_by_one, state, params, fewer), n // 100, asked.draws),
            )
        )
    print(INTRODUCTION.format(draws=asked.draws, n=n))
    print()
    header = ("thousand readings a second", "numba", "without", "without, one a call")
    print(tables.markdown(header, rows))


if __name__ == "__main__":
    main()
