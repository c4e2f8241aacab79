"""A year in orbit with and without retraining: python -m benchmarks.retraining [--draws 1].

A network is trained on the ground. In flight the bias drifts, jumps twice, and the current of the
solar arrays, which no sensor tells, adds to it in sunlight. How far is the field off, and how often
is something learned, or an alarm raised, where nothing has changed?
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import agonic as ag
from agonic.cli.simulate import train_on_ground
from agonic.field.place import field_along
from agonic.inflight.simulation.orbit import simulate_orbit
from benchmarks import tables

Array = NDArray[np.float64]

DAY = 86_400.0
EVERY_S = 400.0
NOISE, EXTERNAL = 50.0, 20.0
DRIFT, JUMPS, ECLIPSE = 400.0, ((0.3, 800.0), (0.65, 500.0)), 60.0
SHORT, LONG = (2 * DAY, 2 * DAY), (10 * DAY, 5 * DAY)
"""Windows, and from one retraining to the next, s."""
MONTHS = 12
LATE = 15 * DAY
"""What is learned so long after a jump belongs to it."""

INTRODUCTION = """A year in a polar orbit of 500 km, a reading every {every:.0f} s, {draws} draws.
Noise {noise:.0f} nT on an axis, ring current {external:.0f} nT. The bias drifts by {drift:.0f} nT
over the year and jumps by {first:.0f} and {second:.0f} nT in the fourth and the eighth month, and
in sunlight solar arrays add {eclipse:.0f} nT, which no input of the network tells. A network of six
nodes of field and temperature is trained on the ground, and again in orbit, aided by attitude. The
error is that of the corrected field against the truth, rms on an axis, the noise of the reading
itself left out."""

CONCLUSION = """A jump is learned {hours:.1f} hours, or 50 readings, after it. What was known before
is the prior of each training, so a window of two days does as well as one of ten. What is left then
is mostly the arrays: on for 63 % of the time, they leave 17 nT rms on an axis."""


HALF_ORBIT = 2820.0
"""Window and period of the short flights, s."""
FLIGHTS = {"steady": {}, "drift of 400 nT": {"drift": 400.0}, "jump of 600 nT": {"jump": 600.0}}
SHORT_NOISE = 100.0

SHORT_FLIGHTS = """Fifteen hours at a reading a second, trained again after each half orbit on the
half orbit. Noise {noise:.0f} nT on an axis. `on everything` is the network of the ground trained
further on every tenth reading of the whole flight at once. Errors as above, rms over the flight and
{draws} draws, nT:
"""


class Year(NamedTuple):
    """Rms errors by month (12,), nT, without and with retraining, and what the retrainer did."""

    ground: Array
    retrained: Array
    retrainings: tuple[Any, ...]
    jumps: tuple[float, ...]
    took: float


def fly(seed: int, *, days: float, spans: tuple[float, float] = LONG, steady: bool = False) -> Year:
    """One year; `steady`: without drift, jumps and arrays."""
    n = int(days * DAY / EVERY_S)
    made = simulate_orbit(
        n=n,
        rate_Hz=1 / EVERY_S,
        noise=0.0,
        external=EXTERNAL,
        drift=0.0 if steady else DRIFT * days / 365.0,
        seed=seed,
    )
    rng = np.random.default_rng((seed, 3))
    assert made.samples.time is not None
    share = made.samples.time / made.samples.time[-1]
    added = np.zeros((n, 3))
    if not steady:
        for at, size in JUMPS:
            added += np.outer(share >= at, size * _direction(rng))
        added += np.outer(~made.eclipse, ECLIPSE * _direction(rng))
    still = made.samples.field + added
    samples = made.samples.with_columns(field=still + NOISE * rng.standard_normal((n, 3)))
    ground = train_on_ground(made, NOISE, seed)
    began = time.process_time()
    follower = ag.network.Retrainer(
        ground, ag.network.RetrainerParams(window_s=spans[0], every_s=spans[1], window_n=4000)
    )
    known = known_of(samples)
    errors: list[Array] = []
    off: list[Array] = []
    step = 24  # readings that are corrected by one and the same
    for start in range(0, n, step):
        rows = np.arange(start, min(start + step, n))
        truth = made.rot_nb[rows].apply(made.field_n[rows], inverse=True)
        beside = {"temperature": made.samples.temperature[rows]}
        for running, found in ((ground, off), (follower.calibration, errors)):
            needed = {name: beside[name] for name in running.needs}
            field = running.evaluated(still[rows], needed)[0]
            found.append(((field - truth) ** 2).mean(axis=1))
        follower.update(samples.select(rows), known.select(rows))
    took = time.process_time() - began
    month = np.minimum((share * MONTHS).astype(int), MONTHS - 1)
    return Year(
        *(
            np.sqrt(np.bincount(month, np.concatenate(values)) / np.bincount(month))
            for values in (off, errors)
        ),
        follower.retrainings,
        () if steady else tuple(at * made.samples.time[-1] for at, _ in JUMPS),
        took,
    )


def fly_half_orbits(seed: int, n: int, **settings: float) -> list[float]:
    """Errors, nT: never retrained, on everything, retrained each half orbit; and how often that was
    accepted, of how many times."""
    made = simulate_orbit(n=n, noise=0.0, external=EXTERNAL, seed=seed, **settings)
    rng = np.random.default_rng((seed, 3))
    still, columns = made.samples.field, {"temperature": made.samples.temperature}
    samples = made.samples.with_columns(field=still + SHORT_NOISE * rng.standard_normal((n, 3)))
    ground, known = train_on_ground(made, SHORT_NOISE, seed), known_of(samples)
    truth = made.rot_nb.apply(made.field_n, inverse=True)
    some = np.arange(0, n, 10)
    fit = ag.fit_network(samples.select(some), known.select(some), start=ground, compared=False)
    all_at_once = fit.calibration
    follower = ag.network.Retrainer(
        ground, ag.network.RetrainerParams(window_s=HALF_ORBIT, every_s=HALF_ORBIT, window_n=4000)
    )
    squares = np.zeros(3)
    for start in range(0, n, 120):
        rows = np.arange(start, min(start + 120, n))
        beside = {name: values[rows] for name, values in columns.items()}
        for k, running in enumerate((ground, all_at_once, follower.calibration)):
            needed = {name: beside[name] for name in running.needs}
            error = running.evaluated(still[rows], needed)[0] - truth[rows]
            squares[k] += float((error**2).sum())
        follower.update(samples.select(rows), known.select(rows))
    done = follower.retrainings
    return [*np.sqrt(squares / (3 * n)), sum(one.accepted for one in done), len(done)]


def compare_half_orbits(draws: int, quick: bool) -> list[tuple[str, ...]]:
    """The rows of the table of short flights."""
    n = 15_000 if quick else 54_000
    rows = []
    for name, settings in FLIGHTS.items():
        tables.progress(f"retraining: half orbits, {name}")
        found = np.array([fly_half_orbits(seed, n, **settings) for seed in range(draws)])
        errors = np.sqrt(np.mean(found[:, :3] ** 2, axis=0))
        accepted, times = found[:, 3:].mean(axis=0)
        rows.append((name, *(f"{error:.0f}" for error in errors), f"{accepted:.0f} of {times:.0f}"))
    return rows


def known_of(samples: ag.Samples) -> ag.Reference:
    """The world model along the track."""
    expected = field_along(samples)
    assert expected is not None
    return expected.reference


def _direction(rng: np.random.Generator) -> Array:
    way = rng.standard_normal(3)
    return way / np.linalg.norm(way)


def count_false(year: Year) -> tuple[int, int]:
    """Alarms where nothing had jumped, and how many of those changed what runs."""
    false = [
        one
        for one in year.retrainings
        if one.why == "change" and not any(0 <= one.time - at <= LATE for at in year.jumps)
    ]
    return len(false), sum(one.accepted for one in false)


def main() -> None:
    """Fly the years and print the tables."""
    asked = tables.arguments("a year of retraining in orbit", draws=1)
    days = 60.0 if asked.quick else 365.0
    flown: dict[str, list[Year]] = {}
    for seed in range(asked.draws):
        tables.progress(f"retraining: draw {seed + 1}")
        for name, settings in (
            ("every 2 days, a window of 2", {"spans": SHORT}),
            ("every 5 days, a window of 10", {}),
            ("a steady sensor, every 5 days", {"steady": True}),
        ):
            flown.setdefault(name, []).append(fly(seed, days=days, **settings))
    first, second = (size for _, size in JUMPS)
    print(
        INTRODUCTION.format(
            every=EVERY_S,
            draws=asked.draws,
            noise=NOISE,
            external=EXTERNAL,
            drift=DRIFT,
            first=first,
            second=second,
            eclipse=ECLIPSE,
        )
    )
    print()
    never = [year.ground for year in next(iter(flown.values()))]
    columns = [never, *([year.retrained for year in years] for years in flown.values())]
    means = [np.sqrt(np.mean(np.square(column), axis=0)) for column in columns]
    rows = [(str(k + 1), *(f"{mean[k]:.0f}" for mean in means)) for k in range(MONTHS)]
    whole = ("the year", *(f"{np.sqrt(np.mean(mean**2)):.0f}" for mean in means))
    print(tables.markdown(("error in month, nT", "never retrained", *flown), [*rows, whole]))
    print()
    print(CONCLUSION.format(hours=50 * EVERY_S / 3600.0))
    print()
    head = ("retrained", "retrainings", "accepted", "false alarms a month", "of them learned")
    said = [(name, *_count(years, days)) for name, years in flown.items()]
    print(tables.markdown((*head, "time, s"), said))
    print()
    draws = max(asked.draws, 2)
    print(SHORT_FLIGHTS.format(noise=SHORT_NOISE, draws=draws))
    head = ("flight", "never retrained", "on everything", "each half orbit", "accepted")
    print(tables.markdown(head, compare_half_orbits(draws, asked.quick)))


def _count(years: list[Year], days: float) -> list[str]:
    false = np.mean([count_false(year) for year in years], axis=0) * 365.0 / 12.0 / days
    done = np.mean([len(year.retrainings) for year in years])
    took = np.mean([sum(one.accepted for one in year.retrainings) for year in years])
    seconds = np.mean([year.took for year in years])
    return [f"{done:.0f}", f"{took:.0f}", f"{false[0]:.2f}", f"{false[1]:.2f}", f"{seconds:.0f}"]


if __name__ == "__main__":
    main()
