"""Calibration in flight: against its bound, from a chamber into orbit, and a mission out of core.

python -m benchmarks.inflight [--draws 4] [--quick]
"""

from __future__ import annotations

import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from tests.inflight.orbits import (
    ARCSEC,
    SENSOR,
    coefficients,
    efficient,
    from_chamber,
    precise,
    rescaled,
)

from agonic.calibration.affine import Affine
from agonic.calibration.thermal import Thermal
from agonic.inflight.fit import fit_mission
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.logs.large.mission import open_mission
from benchmarks import tables

Array = NDArray[np.float64]

START = datetime(2026, 5, 1, tzinfo=UTC)
INTRODUCTION = """A scalar magnetometer of 0.1 nT noise teaches a vector magnetometer of 0.3 nT
noise, a star camera of 4″ its direction; {n} readings over ten days, nadir pointing, temperatures
of −15 to 35 °C, bias and all entries of the matrix as cubics in it (36 coefficients) and three
angles; {draws} draws. The bound is that of Cramér and Rao for the same readings, from the noise
that was put in and the derivatives of the field at the truth by differences. With so few draws
errors scatter about it by some per cent; those of the efficient estimator, linearised at the truth,
do so alike on the same draws."""
CHAMBER = """Twelve stations in a chamber (−10…50 °C, cubics, 20 nT noise), then iron of 2 µT
beside the sensor, then a day in orbit: 8640 readings of 20 nT of noise, tumbling, {swing:.0f} °C of
swing in every orbit, 5 nT of field from outside the Earth; {draws} draws. The bias at the middle
temperature and, as the field that is left where there is none, at nine temperatures of it."""
CHAMBER_DRAWS = 10
"""As many for each of those of the precise case: they take a hundredth of its time."""
OUT_OF_CORE = """A mission of {n} readings at 10 Hz in Parquet files of 2·10⁶ rows ({size:.0f} MB):
world model along the track, bias and its spline, standard errors. Time of one core, reading
included; {passes} passes. A hundred million readings are extrapolated by the time a reading, for
every step but the fit of 200 000 rows in memory grows with their number."""
PER_FILE = 2_000_000


# --- the precise case --------------------------------------------------------------------------


def compared(draws: int, n: int, days: float) -> list[tuple[str, ...]]:
    """Errors of all draws over their bound."""
    errors, best, bounds, stated, noise = [], [], [], [], []
    for seed in range(draws):
        tables.progress(f"precise case, draw {seed + 1} of {draws}")
        made, fit = precise(seed, n, days)
        found = fit.calibration
        assert isinstance(found, Thermal)
        assert fit.alignment is not None
        truth = rescaled(SENSOR, found.centre_C, found.half_range_C)
        linear, covariance = efficient(made, truth)
        off = (fit.alignment.rotation * made.rot_bm.inv()).as_rotvec()
        errors.append(np.concatenate([coefficients(found) - coefficients(truth), off]))
        best.append(linear)
        bounds.append(np.sqrt(np.diag(covariance)))
        stated.append(np.concatenate([found.sd, np.sqrt(np.diag(fit.alignment.covariance))]))
        noise.append(fit.noise / np.hypot(0.3, 0.1))
    error, sd, said, linear = (np.array(v) for v in (errors, bounds, stated, best))
    groups = {
        "bias (12)": slice(0, 12),
        "gains (12)": slice(12, 24),
        "non-orthogonality (12)": slice(24, 36),
        "Euler angles (3)": slice(36, 39),
        "all": slice(0, 39),
    }
    rows = []
    for name, part in groups.items():
        over = _rms(error[:, part] / sd[:, part])
        ratio = over / _rms(linear[:, part] / sd[:, part])
        size = "" if name == "all" else _size(error[:, part], name)
        said_ratio = _rms(error[:, part] / said[:, part])
        rows.append((name, size, f"{over:.3f}", f"{ratio:.3f}", f"{said_ratio:.3f}"))
    whole = np.hypot(0.3, 0.1)
    rows.append(("residual", f"{np.mean(noise) * whole:.4f} nT", f"{np.mean(noise):.3f}", "", ""))
    return rows


def _size(error: Array, name: str) -> str:
    constant = error[:, ::4] if error.shape[1] == 12 else error
    if name.startswith("bias"):
        return f"{_rms(constant):.4f} nT"
    if name.startswith("gains"):
        return f"{_rms(constant) * 1e6:.3f} ppm"
    return f"{_rms(constant) * ARCSEC:.4f}″"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


# --- from a chamber into orbit -----------------------------------------------------------------


def over_temperature(draws: int) -> tuple[list[tuple[str, ...]], float]:
    """Bias after a change of hardware, with the chamber's magnitude and without; and the swing."""
    rows, swing_C = [], 0.0
    for known in (True, False):
        tables.progress(f"from a chamber into orbit, magnitude {'' if known else 'not '}known")
        found = [from_chamber(seed, magnitude_known=known) for seed in range(draws)]
        error, z, over = (
            np.array([getattr(one, name) for one in found]) for name in ("error", "z", "over_swing")
        )
        swing_C = max(one.swing_C for one in found)
        rows.append(
            (
                "known" if known else "not known",
                f"{_rms(error):.2f} nT",
                f"{np.quantile(np.abs(error), 0.95):.2f} nT",
                f"{_rms(over):.2f} nT",
                f"{_rms(z):.2f}",
                f"{100 * np.mean(np.abs(z) < 1.96):.1f} %",
                f"{sum(one.fit.ok for one in found)} of {draws}",
            )
        )
    return rows, swing_C


# --- out of core -------------------------------------------------------------------------------


def write_mission(folder: Path, files: int) -> tuple[Affine, Array]:
    """Parquet files of a drifting sensor; the ground calibration, and the bias at the end."""
    import pyarrow as pa
    from pyarrow.parquet import write_table

    first = simulate_orbit(n=2, thermal=0.0, seed=1)
    ground = first.ground.at(20.0)
    shift, drift = np.array([500.0, 200.0, -700.0]), np.array([300.0, 0.0, -100.0])
    for k in range(files):
        tables.progress(f"mission: writing file {k + 1} of {files}")
        begun = START + timedelta(seconds=k * PER_FILE / 10)
        made = simulate_orbit(
            n=PER_FILE,
            rate_Hz=10.0,
            noise=100.0,
            external=20.0,
            sensor=first.ground,
            seed=k,
            pointing="tumble",
            epoch=begun,
        )
        s = made.samples
        assert s.time is not None
        share = (k + np.arange(PER_FILE) / PER_FILE) / files
        raw = s.field + shift + np.outer(share, drift)
        columns = {f"mag_{axis}_nT": raw[:, i] for i, axis in enumerate("xyz")}
        track = {
            name: s.columns()[name] for name in ("latitude_deg", "longitude_deg", "altitude_m")
        }
        table = pa.table({"time_unix_s": s.time + begun.timestamp(), **columns, **track})
        write_table(table, folder / f"part{k:03d}.parquet")
    covariance = np.diag([100.0] * 3 + [1e-6] * 6)
    return replace(ground, covariance=covariance), ground.matrix @ (shift + drift)


def out_of_core(files: int) -> tuple[list[tuple[str, ...]], dict[str, float]]:
    """Times of the passes, and what they come to for 10⁸ readings."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        ground, wanted = write_mission(folder, files)
        paths = sorted(folder.glob("*.parquet"))
        size = sum(path.stat().st_size for path in paths) / 1e6
        # a process of its own, so that the peak of memory is that of the fit alone
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
            spent, total, n, memory, bias, sd = alone.submit(fitted, paths, ground).result()
    rows = [(what, f"{s:.1f} s", f"{s / n * 1e6:.2f} µs") for what, s in spent.items()]
    rows.append(("all", f"{total:.1f} s", f"{total / n * 1e6:.2f} µs"))
    thin = spent["fit of rows in memory"]
    facts = {
        "n": n,
        "size": size,
        "passes": len(spent) - 2,
        "memory": memory,
        "minutes": ((total - thin) * 1e8 / n + thin) / 60,
        "z": float(np.abs((bias - wanted) / sd).max()),
        "bias_sd": float(sd.max()),
    }
    return rows, facts


def fitted(
    paths: list[Path], ground: Affine
) -> tuple[dict[str, float], float, int, float, Array, Array]:
    """Seconds of each step and of all, rows, largest memory in MB, bias and standard error."""
    begun = last = time.process_time()
    mission = open_mission(paths)
    spent = {"checksums": time.process_time() - begun}
    last = time.process_time()

    def told(what: str, _done: int) -> None:
        nonlocal last
        now = time.process_time()
        if what == "iteration 1" and what not in spent:
            spent["fit of rows in memory"], spent[what] = now - last, 0.0
        else:
            spent[what] = spent.get(what, 0.0) + now - last
        last = now

    fit = fit_mission(mission, ground=ground, progress=told)
    memory = _peak_MB()
    total = time.process_time() - begun
    return spent, total, mission.rows, memory, fit.change.bias, fit.sd[:3]


def _peak_MB() -> float:
    """The largest memory of this process so far (Linux; elsewhere not known)."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((float(x.split()[1]) / 1024 for x in lines if x.startswith("VmHWM")), np.nan)


def main() -> None:
    """Run both and print the tables."""
    asked = tables.arguments("calibration in flight", draws=4)
    files = 1 if asked.quick else 6
    mission, facts = out_of_core(files)
    n, draws = (20_000, 2) if asked.quick else (86_400, asked.draws)
    carried, swing_C = over_temperature(draws * CHAMBER_DRAWS)
    parts = [
        "## A scalar instrument teaches",
        INTRODUCTION.format(n=n, draws=draws),
        tables.markdown(
            (
                "",
                "error (constant term)",
                "over the bound",
                "over the efficient estimator",
                "over its standard error",
            ),
            compared(draws, n, 10.0),
        ),
        "## From a chamber into orbit",
        CHAMBER.format(draws=draws * CHAMBER_DRAWS, swing=swing_C),
        tables.markdown(
            (
                "magnitude in the chamber",
                "error (rms)",
                "95 % of errors below",
                "error over the swing",
                "over its standard error",
                "within 95 % intervals",
                "good",
            ),
            carried,
        ),
        "## A mission out of core",
        OUT_OF_CORE.format(n=facts["n"], size=facts["size"], passes=facts["passes"]),
        tables.markdown(("", "time", "a reading"), mission),
        f"Largest memory of the process {facts['memory']:.0f} MB. The bias at the end is known to "
        f"{facts['bias_sd']:.1f} nT and misses by at most {facts['z']:.1f} standard errors. For "
        f"10⁸ readings: {facts['minutes']:.0f} minutes, 2 GB of temporary file.",
    ]
    print("\n\n".join(parts))


if __name__ == "__main__":
    main()
