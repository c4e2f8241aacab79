"""Temperature calibration in a chamber: accuracy, honesty and time of the campaign of the page.

python -m benchmarks.thermal [--draws 20] [--quick]
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray
from tests.fitting.chambers import FIELD, KNOWN, campaign, efficient, nine

from agonic.fitting.thermal import Facts, fit_binned, fit_thermal
from agonic.kernels.binned import Binned
from benchmarks import tables

Array = NDArray[np.float64]

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
bound (with an exact fixture); error over standard error should be 1."""


def draw(seed: int, kind: str, noise: float, n: int) -> tuple[Array, Array, Array, float]:
    """Errors, standard errors and efficient errors (120, 9), and the seconds of the fit."""
    stations, off = KINDS[kind]
    made = campaign(seed, n=n, noise=noise, fixture_deg=off)
    begun = time.perf_counter()
    fit = fit_thermal(made.samples, KNOWN, stations=stations)
    seconds = time.perf_counter() - begun
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
        kind, f"{noise:g}", *cells, f"{ratio[0]:.3f} / {ratio[1]:.3f}", f"{_rms(errors / sds):.2f}",
        f"{seconds:.2f}",
    )  # fmt: skip


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


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
            begun = time.perf_counter()
            sums.add(k + 1, field, t[part], clock)
            summing += time.perf_counter() - begun
            rows += size
        begun = time.perf_counter()
        fit_binned(sums, Facts(), KNOWN, stations="known")
        fitting += time.perf_counter() - begun
    return (
        f"{rows / 1e6:.1f} million readings of five sensors: {summing:.1f} s to take anomalies out "
        f"and add up, {fitting:.1f} s to fit all five with known turns."
    )


def main() -> None:
    """Print the table and the times."""
    asked = tables.arguments("temperature calibration in a chamber", draws=20)
    draws, n = (3, 1000) if asked.quick else (asked.draws, 5400)
    header = ("taught by", "noise, nT", "error", "bound", "error / bound", "error / sd", "s")
    rows = [row(kind, noise, draws, n) for noise in (100.0, 400.0) for kind in KINDS]
    print(INTRODUCTION.format(n=n, draws=draws), tables.markdown(header, rows), sep="\n\n")
    print(f"\n{big(n=20_000 if asked.quick else 143_333)}")


if __name__ == "__main__":
    main()
