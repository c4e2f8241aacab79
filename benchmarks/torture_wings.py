"""Recordings that break assumptions, through tracker, retrainer, flight, chamber, coil and more.

python -m benchmarks.torture_wings [--draws 4] [--kind TEXT]

A run is *confidently wrong* where nothing is objected to and the error is above three stated
standard errors (rms over the numbers of a run); of a retrainer, where a steady sensor is said to
have changed.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.alignment.coil.fit import fit_coil
from agonic.alignment.simulation.laboratory import simulate_coil
from agonic.calibration.retraining import RetrainerParams
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.network.fit import fit_network
from agonic.network.retraining import Retrainer
from agonic.network.simulate import simulate_paper
from agonic.thermal.simulation.campaign import simulate_campaign
from benchmarks import tables
from benchmarks.torture_directions import DIRECTIONS
from benchmarks.torture_outcome import WRONG, Outcome, correlated, judge

Array = NDArray[np.float64]
WINGS = """## The wings

Tracker, retrainer, flight, chamber, coil, swing, gravity, north and star sensor, {draws} draws each
(`benchmarks/torture_wings.py`): the error over what was stated. A refused coil is not wrong,
whatever its error.

"""
NOISE = 100.0
LEVELS = np.linspace(-5.0, 45.0, 6)


def track(spoil: Callable[[np.random.Generator, int], tuple[Array | float, Array | float]]):
    """A tumbling sensor at 1 Hz, 3000 rows, in a field that changes; errors added to readings and
    to the reference, neither stated."""

    def run(seed: int) -> Outcome:
        rng, n = np.random.default_rng(seed), 3000
        time = np.arange(1.0, n + 1)
        size = 40_000 + 8_000 * np.sin(time / 875)
        turns = Rotation.from_rotvec(np.outer(time, rng.standard_normal(3)) * 0.02)
        turns = turns * Rotation.from_rotvec(np.outer(time, rng.standard_normal(3)) * 0.009)
        bias, matrix = 3000.0 * rng.standard_normal(3), np.eye(3) + 0.02 * rng.uniform(-1, 1, 3)
        field = size[:, None] * turns.apply([0.6, 0.0, 0.8])
        raw = field @ np.linalg.inv((matrix + matrix.T) / 2).T + bias
        raw = raw + NOISE * rng.standard_normal((n, 3))
        beside, wrong = spoil(rng, n)
        tracker = ag.inflight.Tracker()
        tracker.update(
            ag.Samples(time=time, field=raw + beside), ag.Reference.magnitude(size + wrong)
        )
        z = (tracker.bias - bias) / tracker.bias_sd
        return judge(tracker, z)

    return run


def retrain(kept: float) -> Callable[[int], Outcome]:
    """A steady sensor whose noise lasts, after a network was trained on its first 30 s."""

    def run(seed: int) -> Outcome:
        made = simulate_paper(14.9, rate_Hz=600.0, directions="space", noise=1e-6, seed=seed)
        noise = correlated(np.random.default_rng(seed), made.field.shape, kept, 2.0)
        samples = made.samples.with_columns(field=made.samples.field + noise)
        rows = np.arange(len(samples))
        known = [ag.Reference.vector(made.field[part], frame="m") for part in (rows[:3000], rows)]
        fit = fit_network(samples.select(rows[:3000]), known[0], compared=False)
        retrainer = Retrainer(fit.calibration, RetrainerParams(window_n=1500))
        for part in np.split(rows[3000:], range(250, len(rows) - 3000, 250)):
            reference = ag.Reference.vector(made.field[part], frame="m")
            retrainer.update(samples.select(part), reference)
        changes = sum(one.why == "change" for one in retrainer.retrainings)
        return Outcome("good", WRONG + changes if changes else 0.0, ())

    return run


def chamber(
    spoil: Callable[[np.random.Generator, ag.Samples], Array],
    turns: bool = True,
    more: Callable[[ag.Samples], Array] | None = None,
    **settings,
):
    """Twelve stations, their turns known or not; what is added to the readings of one sensor, and
    by what share of itself the field is more at each row."""

    def run(seed: int) -> Outcome:
        quiet = {"field_sd": 0.0, "hysteresis": 0.0, "anomalies": 0.0, "rate_Hz": 0.1} | settings
        made = simulate_campaign("MMC5883MA", seed=seed, **quiet)
        samples = made.campaign.samples(made.campaign.sensors[0])
        (truth,) = made.truth.values()
        added = spoil(np.random.default_rng(seed), samples)
        if more is not None:
            of_field = samples.field - truth.bias_at(samples.temperature)
            added = added + more(samples)[:, None] * of_field
        fit = ag.fit_thermal(
            samples.with_columns(field=samples.field + added),
            ag.Reference.constant(48_000.0),
            stations=made.description.rotations if turns else "unknown",
            bin_width_C=2.0,
            rate=False,
        )
        away = fit.calibration.bias_at(LEVELS) - truth.bias_at(LEVELS)
        return judge(fit, away / fit.calibration.sd_at(LEVELS)[:, :3])

    return run


def coil(
    settling_s: float = 0.0, seen: float = 0.0, gain: float = 1.0, warmer: float = 0.0
) -> Callable[[int], Outcome]:
    """A coil whose field follows its current, five readings, one a second, on each side.

    Its reference sees a share of the coil, the magnetometer has a gain, the coil grows warm.
    """

    def run(seed: int) -> Outcome:
        made = simulate_coil(readings=5, seed=seed)
        samples = made.session.magnetometer
        current, flowing = samples.current_A, np.array(samples.current_A)
        kept = np.exp(-1.0 / settling_s) if settling_s else 0.0
        for row in range(1, len(flowing)):
            last = current[row - 1] if settling_s else current[row]
            flowing[row] = last + (flowing[row - 1] - last) * kept
        flowing = flowing * (1 + warmer * (1 - np.exp(-samples.time / 120)))
        late = gain * (samples.field + (flowing - current)[:, None] * made.vector)
        beside, onto_n = made.session.reference, made.axis_n
        also = beside.field + seen * 40_000 * np.outer(flowing, onto_n)
        spoilt = replace(
            made.session,
            magnetometer=samples.with_columns(field=late),
            reference=beside.with_columns(field=also),
        )
        fit = fit_coil(spoilt)
        return judge(fit, np.array([(fit.constant - 40_000.0) / fit.constant_sd]))

    return run


def flight(
    spoil: Callable[[np.random.Generator, ag.Samples], Array] | None = None,
    late_s: float = 0.0,
    gain: float = 1.0,
    alone: bool = False,
) -> Callable[[int], Outcome]:
    """Two orbits beside a ground calibration, 500 nT of bias later, or tumbling `alone` without
    one: what is added to the readings, by how much the positions are late, a gain. The bias is that
    of the end.
    """

    def run(seed: int) -> Outcome:
        pointing = "tumble" if alone else "nadir"
        made = simulate_orbit(
            n=3000, rate_Hz=0.25, thermal=0.0, moved=500.0, pointing=pointing, seed=seed
        )
        sd = np.array([50.0] * 3 + [1e-3] * 6)
        ground = replace(made.ground.at(20.0), covariance=np.diag(sd**2))
        samples = made.samples.with_columns(temperature=None)
        added = np.zeros((len(samples), 3))
        if spoil is not None:
            added = spoil(np.random.default_rng(seed), samples)
        then = samples.time - late_s
        place = {
            name: np.interp(then, samples.time, np.unwrap(getattr(samples, name), period=360.0))
            for name in ("latitude_deg", "longitude_deg", "altitude_m")
        }
        place["longitude_deg"] = (place["longitude_deg"] + 180.0) % 360.0 - 180.0
        spoilt = samples.with_columns(field=samples.field + added, **(place if late_s else {}))
        spoilt = spoilt.with_columns(field=gain * spoilt.field)
        fit = ag.fit_inflight(spoilt, ground=None if alone else ground)
        away = fit.after.bias - gain * (made.truth.at(20.0).bias + added[-1])
        return judge(fit, away / np.sqrt(np.diag(fit.after.covariance))[:3])

    return run


def _nothing(rng: np.random.Generator, samples: ag.Samples) -> Array:
    return np.zeros((len(samples), 3))


def _station_offsets(rng: np.random.Generator, samples: ag.Samples) -> Array:
    return (50.0 * rng.standard_normal((13, 3)))[samples.station.astype(int)]


def _ageing(rng: np.random.Generator, samples: ag.Samples) -> Array:
    return np.outer((samples.time - samples.time[0]) / 86_400.0, 20.0 * rng.choice([-1, 1], 3))


def _changed(part: Callable[[ag.Samples], Array], size: float):
    """A bias of a size in any direction, by so much at each row."""

    def spoil(rng: np.random.Generator, samples: ag.Samples) -> Array:
        way = rng.standard_normal(3)
        return np.outer(part(samples), size * way / np.linalg.norm(way))

    return spoil


def _switching(rng: np.random.Generator, samples: ag.Samples) -> Array:
    """300 nT in any direction, on and off at random, for a minute on average."""
    on = np.cumsum(rng.random(len(samples)) < 4 / 60) % 2
    return _changed(lambda _: on, 300)(rng, samples)


def _share(samples: ag.Samples) -> Array:
    """How much of the campaign is over, 0…1."""
    return (samples.time - samples.time[0]) / np.ptp(samples.time)


KINDS: dict[str, Callable[[int], Outcome]] = {
    "tracker *": track(lambda rng, n: (0.0, 0.0)),
    **{
        f"tracker, sensor noise AR {kept}": track(
            lambda rng, n, kept=kept: (correlated(rng, (n, 3), kept, NOISE), 0.0)
        )
        for kept in (0.9, 0.97, 0.99, 0.995, 0.999)
    },
    **{
        f"tracker, reference off by {sd} nT over {time_s} s": track(
            lambda rng, n, sd=sd, time_s=time_s: (
                0.0,
                correlated(rng, (n,), float(np.exp(-1 / time_s)), sd),
            )
        )
        for sd, time_s in ((60, 600), (150, 600), (100, 5000))
    },
    **{f"retrainer, noise AR {kept}": retrain(kept) for kept in (0.0, 0.9, 0.97)},
    "chamber *": chamber(_nothing),
    "chamber, 50 nT by station": chamber(_station_offsets),
    "chamber, ageing by 20 nT a day": chamber(_ageing),
    **{
        f"chamber, {size} nT {what}": chamber(_changed(part, size))
        for size in (100, 1000)
        for what, part in {
            "step in station 6": lambda s: _share(s) > 0.46,
            "at station 8 alone": lambda s: s.station == 8,
            "that settle in 4 h": lambda s: np.exp(-_share(s) / 0.08),
        }.items()
    },
    "chamber, thermometer noise 0.5 °C": chamber(_nothing, temperature_noise_C=0.5),
    "chamber, magnitude alone *": chamber(_nothing, turns=False),
    **{
        f"chamber, magnitude alone, {name}": chamber(_nothing, turns=False, more=more)
        for name, more in {
            "1000 nT from station 7": lambda s: (s.station > 6) / 48.0,
            "1000 nT from station 5": lambda s: (s.station > 4) / 48.0,
            "gain 1 % more from station 7": lambda s: 0.01 * (s.station > 6),
            "300 nT half-way": lambda s: 0.3 * (_share(s) > 0.46) / 48.0,
            "300 nT slowly": lambda s: 0.3 * np.sin(8 * _share(s) + 1) / 48.0,
            "500 nT at station 5": lambda s: 0.5 * (s.station == 5) / 48.0,
        }.items()
    },
    "flight *": flight(),
    **{f"flight, positions {s} s late": flight(late_s=s) for s in (1.0, 3.0, 10.0)},
    **{
        f"flight, {size} nT {what}": flight(_changed(part, size))
        for size in (300, 1000)
        for what, part in {
            "step half-way": lambda s: _share(s) > 0.5,
            "steady drift": _share,
        }.items()
    },
    "flight, gains 2 % off": flight(gain=1.02),
    "flight without a ground calibration *": flight(alone=True),
    **{
        f"flight without a ground calibration, {name} of 300 nT": flight(spoil, alone=True)
        for name, spoil in {
            "a switching current": _switching,
            "a square wave with the orbit": _changed(lambda s: np.sin(s.time / 902) > 0, 300),
        }.items()
    },
    **{f"coil, settles with {s} s": coil(s) for s in (0.0, 0.3, 1.0, 3.0)},
    "coil, 1 % of it in the reference": coil(seen=0.01),
    "coil, gain of the magnetometer 1 % off": coil(gain=1.01),
    "coil that warms up, 1 %": coil(warmer=0.01),
    **DIRECTIONS,
}


def main() -> int:
    """Print the table; status 1 where a run was confidently wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--quick", action="store_true", help="one draw")
    parser.add_argument("--kind", default="", help="only kinds whose name holds this text")
    asked = parser.parse_args()
    rows, wrong = [], 0
    draws = 1 if asked.quick else asked.draws
    for name, run in KINDS.items():
        if asked.kind not in name:
            continue
        runs = [run(seed) for seed in range(draws)]
        verdicts = Counter(one.verdict for one in runs)
        causes = Counter(cause for one in runs for cause in one.causes)
        wrong += sum(one.wrong for one in runs)
        rows.append(
            [
                name,
                " ".join(f"{verdicts[word]}" for word in ("good", "check", "refused")),
                f"{np.median([one.over_stated for one in runs]):.1f}",
                f"{max(one.over_stated for one in runs):.1f}",
                f"{sum(one.wrong for one in runs) or ''}",
                ", ".join(f"{cause} {count}" for cause, count in causes.most_common(3)),
            ]
        )
    head = ["kind", "good check refused", "error over stated, median", "largest", "wrong", "causes"]
    print(WINGS.format(draws=draws) + tables.markdown(head, rows))
    print(f"\nConfidently wrong: {wrong} of {draws * len(rows)} runs.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
