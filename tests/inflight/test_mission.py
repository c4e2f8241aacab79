"""`fit_mission`: out of core as in memory, with rows left out, files, and memory that stays."""

import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.inflight.fit import fit_mission, large_scan
from agonic.inflight.maths import correlated_errors
from agonic.logs.large.mission import open_mission


class Pieces:
    """Samples given out a few at a time, and what was asked of them."""

    def __init__(self, samples: ag.Samples, size: int) -> None:
        self.samples, self.size, self.rows, self.passes = samples, size, len(samples), 0

    def pieces(self, without: tuple[str, ...] = ()) -> Iterator[ag.Samples]:
        self.passes += 1
        for start in range(0, self.rows, self.size):
            rows = np.arange(start, min(start + self.size, self.rows))
            yield self.samples.select(rows).with_columns(**dict.fromkeys(without))


@pytest.fixture(scope="module")
def made() -> ag.inflight.SimulatedOrbit:
    return ag.inflight.simulate_orbit(
        n=30_000,
        rate_Hz=0.3,
        thermal=0.0,
        external=30.0,
        torquer=3000.0,
        moved=800.0,
        pointing="tumble",
        seed=1,
    )


def ground_of(made: ag.inflight.SimulatedOrbit) -> ag.Affine:
    return replace(made.ground.at(20.0), covariance=np.diag([100.0] * 3 + [1e-6] * 6))


def test_out_of_core_gives_what_memory_gives(made, monkeypatch) -> None:
    monkeypatch.setattr(large_scan, "MOST", 4000)
    ground, told = ground_of(made), []
    whole = ag.fit_inflight(made.samples, ground=ground, drift_knots=0, latitude_deg=(-80, 80))
    recording = Pieces(made.samples, 7000)
    fit = fit_mission(
        recording,
        ground=ground,
        drift_knots=0,
        latitude_deg=(-80, 80),
        progress=lambda what, rows: told.append((what, rows)),
    )
    assert fit.n == whole.n
    assert np.abs((fit.change.bias - whole.change.bias) / whole.sd[:3]).max() < 0.5
    assert fit.sd[:3] == pytest.approx(whole.sd[:3], rel=0.35)
    assert fit.lasting_nT == pytest.approx(whole.lasting_nT, rel=0.4)
    assert fit.thinned == 8
    assert len(fit.time) == len(fit.residuals) == 30_000 // 8 + 1
    assert fit.time[-1] == made.samples.time[-1]
    true = ground.matrix @ (made.bias[-1] - ground.bias)
    assert np.abs((fit.change.bias - true) / fit.sd[:3]).max() < 4
    passes = list(dict.fromkeys(what for what, _ in told))
    assert passes[0] == "world model"
    assert told[4] == ("world model", 30_000)
    assert recording.passes == len(passes) <= 7  # one pass an iteration


def test_a_spline_and_temperature_terms_go_over_pieces(monkeypatch) -> None:
    monkeypatch.setattr(large_scan, "MOST", 5000)
    made = ag.inflight.simulate_orbit(
        n=20_000,
        rate_Hz=0.2,
        noise=50.0,
        thermal=800.0,
        external=0.0,
        drift=600.0,
        pointing="tumble",
        seed=3,
    )
    recording = Pieces(made.samples, 6000)
    fit = fit_mission(recording, drift_knots=2, temperature_degree=3)
    assert fit.verdict == "good", fit.status
    bias, sd = fit.bias_at(made.samples.time[::500])
    middle = fit.calibration.centre_C
    true = made.truth.bias_at(middle) + (made.bias - made.truth.bias_at(made.samples.temperature))
    assert np.sqrt(np.mean(((bias - true[::500]) / sd) ** 2)) < 2.0
    assert np.abs(bias - true[::500]).max() < 15.0
    rows = Pieces(made.samples, 20_000)
    again = fit_mission(rows, drift_knots=2, temperature_degree=3)
    assert again.change.bias == pytest.approx(fit.change.bias, abs=1e-6)


def test_a_scalar_instrument_teaches_a_mission_too() -> None:
    made = ag.inflight.simulate_orbit(
        n=6000, rate_Hz=0.1, noise=0.3, scalar_sd=0.1, thermal=0.0, pointing="tumble", seed=2
    )
    without = made.samples.with_columns(latitude_deg=None, longitude_deg=None)
    fit = fit_mission(Pieces(without, 2500), scalar=True, drift_knots=0)
    assert fit.noise == pytest.approx(np.hypot(0.3, 0.1), rel=0.05)
    assert np.abs((fit.change.bias - made.bias[-1]) / fit.sd[:3]).max() < 4
    with pytest.raises(ag.AgonicError, match="no latitude or longitude"):
        fit_mission(Pieces(without, 2500))
    with pytest.raises(ag.AgonicError, match="no scalar"):
        fit_mission(Pieces(without.with_columns(scalar=None), 2500), scalar=True)
    with pytest.raises(ag.AgonicError, match="moves a ground"):
        fit_mission(Pieces(without, 2500), solve="bias")


def written(samples: ag.Samples, folder: Path, count: int, rows_a_group: int = 1000) -> list[Path]:
    """Parquet files that follow each other, times in Unix seconds."""
    pa = pytest.importorskip("pyarrow")
    from pyarrow.parquet import write_table

    unix = samples.time + samples.epoch.timestamp()
    paths = []
    for k, rows in enumerate(np.array_split(np.arange(len(samples)), count)):
        columns = {"time_unix_s": unix[rows]}
        for i, axis in enumerate("xyz"):
            columns[f"mag_{axis}_nT"] = samples.field[rows, i]
        for name in ("latitude_deg", "longitude_deg", "altitude_m", "flagged"):
            if (values := samples.columns().get(name)) is not None:
                columns[name] = values[rows]
        paths.append(folder / f"part{k}.parquet")
        write_table(pa.table(columns), paths[-1], row_group_size=rows_a_group)
    return paths


def test_files_are_read_in_pieces_and_in_order(made, tmp_path) -> None:
    samples = made.samples.select(np.arange(5000))
    paths = written(samples, tmp_path, 3)
    mission = open_mission(paths, piece=700)
    assert mission.rows == 5000
    pieces = list(mission.pieces())
    assert max(map(len, pieces)) == 700
    time = np.concatenate([piece.time for piece in pieces])
    assert time - time[0] == pytest.approx(samples.time - samples.time[0], abs=1e-5)
    assert len({piece.epoch for piece in pieces}) == 1
    assert np.concatenate([piece.field for piece in pieces]) == pytest.approx(samples.field)
    lean = next(mission.pieces(without=("latitude_deg", "flagged")))
    assert lean.latitude_deg is None
    assert lean.flagged is None
    assert lean.longitude_deg is not None
    with pytest.raises(ag.LogError, match="in order of time"):
        list(open_mission(paths[::-1]).pieces())
    with pytest.raises(ag.LogError, match="no such file"):
        open_mission([tmp_path / "none.parquet"])
    with pytest.raises(ag.LogError, match="no files"):
        open_mission([])


@pytest.mark.slow
def test_memory_does_not_grow_with_the_record(made, tmp_path, monkeypatch) -> None:
    """Three times the rows, the same peak, but for the rows that are kept."""
    monkeypatch.setattr(large_scan, "MOST", 2000)
    monkeypatch.setattr(correlated_errors, "STRETCHES", 1000)
    ground, peaks = ground_of(made), []
    for n in (8000, 24_000):
        folder = tmp_path / str(n)
        folder.mkdir()
        paths = written(made.samples.select(np.arange(n)), folder, 2, rows_a_group=10**6)
        mission = open_mission(paths, piece=1000)
        tracemalloc.start()
        fit = fit_mission(mission, ground=ground, drift_knots=0)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert fit.n <= n
    assert peaks[1] < 1.6 * peaks[0]


def test_pieces_allow_for_what_comes_and_goes_as_the_whole_does(monkeypatch) -> None:
    """A current of 300 nT that switches at random: it was good in pieces, and off by five sd."""
    monkeypatch.setattr(large_scan, "MOST", 2000)
    made = ag.inflight.simulate_orbit(n=6000, rate_Hz=0.25, thermal=0.0, pointing="tumble", seed=1)
    on = np.cumsum(np.random.default_rng(1).random(6000) < 1 / 15) % 2
    current = np.outer(on, 300.0 * np.array([0.6, -0.64, 0.48]))
    samples = made.samples.with_columns(temperature=None, field=made.samples.field + current)
    fit = fit_mission(Pieces(samples, 2500))
    away = (fit.after.bias - made.truth.at(20.0).bias)[None] - current[[0, np.argmax(on)]]
    assert {finding.name for finding in fit.findings} == {"switching current"}
    assert np.sqrt(np.mean((away / fit.sd[:3]) ** 2)) < 2.0
