"""Temperature calibration in a chamber: accuracy, honesty, improvement and time.

python -m benchmarks.thermal [--draws 8] [--quick]
"""

from __future__ import annotations

import time
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.thermal.chambers import FIELD, KNOWN, campaign, efficient, nine

from agonic import Reference
from agonic.thermal.fit.fit import fit_binned, fit_thermal
from agonic.thermal.fit.readings import Facts
from agonic.thermal.maths.binned_sums import Binned
from agonic.thermal.simulation.campaign import Faults, simulate_campaign
from benchmarks import tables

Array = NDArray[np.float64]

IMPROVEMENT = {
    "MMC5883MA-1": (5.44, 24.58, 1.11, 12.42),
    "MMC5883MA-2": (11.71, 2.43, 1.47, 5.98),
    "MPU-9255-1": (2.58, 1.40, 3.85, 1.18),
    "MPU-9255-2": (2.96, 4.89, 4.92, 2.81),
    "MPU-9255-3": (1.84, 1.19, 1.13, 1.63),
}
"""By sensor: the largest of the twelve standard deviations of a station's readings before the
correction over the largest after, of x, y, z and |B|. Nikolaev et al. 2023, table."""

AT = np.linspace(-9.75, 49.75, 120)
KINDS = {
    "magnitude only": ("unknown", 0.0),
    "known turns, exact fixture": ("known", 0.0),
    "known turns, fixture off by 1°": ("known", 1.0),
}
INTRODUCTION = """48 µT at 65° dip; biases drift by up to 20 µT, the matrix by 1 %; the standard
twelve stations, {n} readings cooling and {n} heating at each, −10…50 °C, bins of 0.5 °C, cubics.
Root mean square error of bias / matrix × field over the range, {draws} draws, nT. The bound is the
error, on the same readings, of the estimator linearised at the truth, which attains the Cramér–Rao
bound (with an exact fixture); error over standard error should be 1. Single draws gave targets of
1.3 / 1.6 and 6.0 / 6.0 by the magnitude, 0.5 / 0.8 and 2.7 / 2.9 by the turns. Where they are below
the bound, no unbiased estimator reaches them but by luck."""
HONESTY = """Standard deviation of error over standard error of the nine coefficients, in campaigns
of the published programme with hysteresis, steps, spikes, and a fixture off by 1°; nothing is told
to the fit, every term is left to be found. {draws} draws; lowest and highest of thirteen
temperatures, and of nine coefficients, in brackets (with so few draws a coefficient scatters by
15 %). Changes: 50 nT within hours; drift: 1000 nT over three days; faint drift: 100 nT, which the
readings hardly show."""
FIELDS = {
    "at rest": (0.0, 0.0),
    "changes": (50.0, 0.0),
    "drift": (0.0, 1000.0),
    "changes and drift": (50.0, 1000.0),
    "faint drift": (0.0, 100.0),
}
SENSORS = ("MMC5883MA", "MPU-9255")
BESIDE = """The largest standard deviation of a station's readings before the correction over the
largest after, for x, y, z and |B|: a simulation of the five sensors, and in brackets the real ones
of Nikolaev et al. 2023. The simulated biases drift by up to 20 µT, the real ones by less, so the
simulated ratios are larger."""


def draw(seed: int, kind: str, noise: float, n: int) -> tuple[Array, Array, Array, float]:
    """Errors, standard errors and efficient errors (120, 9), and the seconds of the fit."""
    stations, off = KINDS[kind]
    made = campaign(seed, n=n, noise=noise, fixture_deg=off)
    begun = time.process_time()
    fit = fit_thermal(made.samples, KNOWN, stations=stations)
    seconds = time.process_time() - begun
    error = nine(fit.calibration, AT) - nine(made.truth, AT)
    sd = fit.calibration.sd_at(AT) * np.array([1.0] * 3 + [FIELD] * 6)
    return error, sd, efficient(made, AT, turns=stations == "known"), seconds


def row(kind: str, noise: float, draws: int, n: int) -> tuple[str, ...]:
    """One line of the table."""
    tables.progress(f"thermal: {kind}, {noise:g} nT")
    made = [draw(seed, kind, noise, n) for seed in range(draws)]
    errors, sds, best = (np.array([one[k] for one in made]) for k in range(3))
    cells = [f"{_rms(e[..., :3]):.2f} / {_rms(e[..., 3:]):.2f}" for e in (errors, best)]
    ratio = [_rms(errors[..., part]) / _rms(best[..., part]) for part in (slice(3), slice(3, 9))]
    seconds = float(np.median([one[3] for one in made]))
    return (
        kind,
        f"{noise:g}",
        *cells,
        f"{ratio[0]:.3f} / {ratio[1]:.3f}",
        f"{_rms(errors / sds):.2f}",
        f"{seconds:.2f}",
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


class Told(NamedTuple):
    """A campaign to be drawn: sensor, readings a second, its chamber's field, teacher, seed."""

    sensor: str
    rate_Hz: float
    field: str
    teacher: str
    seed: int


def scored(told: Told) -> Array:
    """Errors over standard errors at thirteen temperatures, (13, 9)."""
    changes, drift = FIELDS[told.field]
    made = simulate_campaign(
        told.sensor,
        rate_Hz=told.rate_Hz,
        field_sd=changes,
        seed=told.seed,
        faults=Faults(drift=drift),
    )
    samples = made.campaign.samples(told.sensor)
    assert samples.time is not None
    still = simulate_campaign(told.sensor, field_sd=0.0, seed=told.seed, faults=made.faults)
    middle = np.array([(samples.time[0] + samples.time[-1]) / 2])
    reference = Reference.constant(float(np.linalg.norm(still.field_n(middle)[0])))
    turns = made.description.rotations if told.teacher == "turns" else "unknown"
    found = fit_thermal(samples, reference, stations=turns).calibration
    at = AT[::10]
    error = nine(found, at) - nine(made.truth[told.sensor], at)
    return np.asarray(error / (found.sd_at(at) * np.array([1.0] * 3 + [FIELD] * 6)))


def honesty(draws: int, rates: tuple[float, ...]) -> str:
    """Error over standard error by sensor, rate, field and teacher."""
    rows = []
    with ProcessPoolExecutor(max_workers=2) as pool:
        for sensor in SENSORS:
            for rate in rates:
                tables.progress(f"thermal: honesty of {sensor}, {rate:g} readings a second")
                for field in FIELDS:
                    cells = []
                    for teacher in ("turns", "magnitude"):
                        asked = [Told(sensor, rate, field, teacher, k) for k in range(draws)]
                        cells.append(_spread(np.array(list(pool.map(scored, asked)))))
                    rows.append((sensor, f"{rate:g}", field, *cells))
    header = ("sensor", "readings a second", "field", "by turns", "by magnitude")
    return tables.markdown(header, rows)


def _spread(z: Array) -> str:
    by_level, by_kind = (np.sqrt(np.mean(z**2, axis=axes)) for axes in ((0, 2), (0, 1)))
    return (
        f"{_rms(z):.2f} ({by_level.min():.2f}–{by_level.max():.2f}, "
        f"{by_kind.min():.2f}–{by_kind.max():.2f})"
    )


def improvements(rate_Hz: float = 0.5) -> str:
    """The published table, simulated beside published."""
    made = simulate_campaign(rate_Hz=rate_Hz)
    rows = []
    for name, published in IMPROVEMENT.items():
        tables.progress(f"thermal: improvement of {name}")
        fit = fit_thermal(made.campaign.samples(name), KNOWN, stations=made.description.rotations)
        assert fit.spread is not None
        pairs = zip(fit.spread.improvement, published, strict=True)
        rows.append((name, *(f"{ours:.2f} ({theirs:.2f})" for ours, theirs in pairs)))
    return tables.markdown(("simulated (published)", "x", "y", "z", "\\|B\\|"), rows)


def big(stations: int = 12, n: int = 143_333) -> str:
    """Five sensors, twelve stations, four hours at 10 Hz: the seconds of sums and of fits."""
    rng = np.random.default_rng(0)
    made = campaign(0, n=n // 2, noise=100.0)
    raw, t = made.samples.field, made.samples.temperature
    assert t is not None
    size = 2 * (n // 2)
    summing, fitting, rows = 0.0, 0.0, 0
    for _ in range(5):
        tables.progress("thermal: 1.7 million readings of a sensor")
        sums = Binned(0.5)
        shift = 1000.0 * rng.normal(size=3)
        for k in range(stations):
            part = slice(k * size, (k + 1) * size)
            field = raw[part] + shift
            clock = 0.1 * np.arange(size) + 20_000.0 * k
            begun = time.process_time()
            sums.add(k + 1, field, t[part], clock)
            summing += time.process_time() - begun
            rows += size
        begun = time.process_time()
        fit_binned(sums, Facts(), KNOWN, stations="known")
        fitting += time.process_time() - begun
    return (
        f"{rows / 1e6:.1f} million readings of five sensors: {summing:.1f} s to take anomalies out "
        f"and add up, {fitting:.1f} s to fit all five with known turns."
    )


def main() -> None:
    """Print the table and the times."""
    asked = tables.arguments("temperature calibration in a chamber", draws=8)
    draws, n = (3, 1000) if asked.quick else (asked.draws, 5400)
    header = ("taught by", "noise, nT", "error", "bound", "error / bound", "error / sd", "s")
    rows = [row(kind, noise, draws, n) for noise in (100.0, 400.0) for kind in KINDS]
    few = 2 if asked.quick else max(draws // 2, 4)
    rates = (0.1,) if asked.quick else (1.0, 0.1)
    parts = (
        INTRODUCTION.format(n=n, draws=draws),
        tables.markdown(header, rows),
        HONESTY.format(draws=few),
        honesty(few, rates),
        BESIDE,
        improvements(),
        big(n=20_000 if asked.quick else 143_333),
    )
    print(*parts, sep="\n\n")


if __name__ == "__main__":
    main()
