"""`fit_recording`: out of core as in memory, honest, nothing overlooked, memory that stays."""

import json
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow.parquet import write_table

import agonic as ag
from agonic.cli import run
from agonic.ellipsoid import large_scan, large_solve
from agonic.ellipsoid.maths import block_sums
from agonic.logs.large.mission import Mission, open_mission
from agonic.maths.equation.affine import model_basis
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.priors import make_prior
from agonic.maths.equation.starting_values import nearest_parameters
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import squares, tukey
from agonic.maths.estimation.noise import batch_means

F = 50_000.0
REFERENCE = ag.Reference.constant(F)
BIAS = np.array([3000.0, -500.0, 100.0])
MATRIX = np.eye(3) + 0.05 * np.array([[0.3, 0.2, -0.1], [0.2, -0.5, 0.4], [-0.1, 0.4, 0.6]])
TRUTH = np.concatenate([BIAS, pack_symmetric(MATRIX)])
Write = Callable[..., Mission]


def readings(n: int, seed: int, noise: float = 100.0, ar: float = 0.0) -> np.ndarray:
    """A sensor that turns about all axes at 50 Hz; noise that may last, AR(1)."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 50.0
    z = np.cos(0.7 * t + rng.uniform(0, 6)) * np.cos(0.011 * t)
    azimuth = 1.3 * t + rng.uniform(0, 6)
    level = np.sqrt(1 - z**2)
    to = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), z], axis=1)
    e = rng.normal(size=(n, 3))
    if ar:
        from scipy.signal import lfilter

        e = lfilter([np.sqrt(1 - ar**2)], [1.0, -ar], e, axis=0)
    return F * to @ np.linalg.inv(MATRIX).T + BIAS + noise * e


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def written(field: np.ndarray, time: np.ndarray | None = None, **more: object) -> Mission:
        time = np.arange(len(field)) / 50.0 if time is None else time
        path = tmp_path / f"part{len(list(tmp_path.iterdir()))}.parquet"
        columns = {f"mag_{axis}_nT": field[:, i] for i, axis in enumerate("xyz")}
        write_table(pa.table({"time_s": time, **columns}), path, row_group_size=30_000)
        return open_mission([path], **more)

    return written


def parameters(fit: ag.Fit) -> np.ndarray:
    w = fit.calibration.matrix
    return np.concatenate([fit.calibration.bias, pack_symmetric(w)])


def apart(one: ag.Fit, other: ag.Fit) -> float:
    """The largest difference, in standard errors."""
    return float(np.abs((parameters(one) - parameters(other)) / other.sd).max())


def minimum(field: np.ndarray, fit: ag.Fit, robust: bool) -> np.ndarray:
    """Bias by the solver in memory, run to the end, with the noise that a fit found."""
    centre, size = field.mean(axis=0), float(np.sqrt(field.var(axis=0).sum()))
    problem = Problem((field - centre) / size, np.ones(1), "full", 0.1)
    sd = fit.noise / size
    w = fit.calibration.matrix * size / F
    start = nearest_parameters((fit.calibration.bias - centre) / size, w, model_basis("full"))
    solution = leastsq.solve(
        pieces(problem, "magnitude", sd),
        start,
        scale=sd,
        loss=tukey() if robust else squares(),
        prior=make_prior("full", 0.1),
        tolerance=1e-7,
    )
    return np.asarray(solution.params[:3] * size + centre)


@pytest.mark.slow
@pytest.mark.parametrize("strays", [0, 400])
def test_the_numbers_are_those_of_memory_however_it_is_cut(write, strays) -> None:
    field = readings(200_000, 3)
    rng = np.random.default_rng(0)
    field[rng.choice(len(field), strays, replace=False)] += 9000 * rng.normal(size=(strays, 3))
    mission = write(field)
    memory = ag.fit_ellipsoid(ag.Samples(field=field), REFERENCE)
    fit = ag.fit_recording(mission, REFERENCE)
    assert fit.n == memory.n == 200_000
    assert len(fit.residuals) == len(fit.weights) == large_scan.MOST
    assert apart(fit, memory) < 4.0  # some nanotesla, by the terms that are sought in memory alone
    exact = minimum(field, fit, robust=strays > 0)
    assert np.abs((fit.calibration.bias - exact) / fit.sd[:3]).max() < 1e-4
    assert (memory.sd > 0.8 * fit.sd).all()
    assert fit.noise == pytest.approx(memory.noise, rel=1e-4)
    assert fit.correlation == 1.0
    assert apart(ag.fit_recording(replace(mission, strip=7_777), REFERENCE), fit) < 1e-6
    said = {f.name: f.what.split()[0] for f in fit.findings}
    assert said == {f.name: f.what.split()[0] for f in memory.findings}
    assert ("outliers" in said) == (strays > 0)
    ours = ag.fit_recording(mission, REFERENCE, method="adjusted")
    theirs = ag.fit_ellipsoid(ag.Samples(field=field), REFERENCE, method="adjusted")
    assert apart(ours, theirs) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_the_compiled_sums_are_those_of_the_kernels(robust, kind) -> None:
    pytest.importorskip("numba")
    field = readings(10_007, 1).astype(kind)
    field[::500] *= 1.05
    frame = block_sums.Frame(np.array([2900.0, -450.0, 20.0]), 5.1e4)
    params = np.array([1e-3, 0, 2e-4, 1.0, 1.01, 0.99, 1e-3, 0, -2e-3])
    both = []
    for compiled in (False, True):
        sums = block_sums.Sums.empty(1)
        block_sums.add(
            sums,
            0,
            tuple(field.T),
            frame,
            params,
            block_sums.Assumed(0.01, robust),
            compiled=compiled,
        )
        both.append(sums)
    for one, other in zip(*both, strict=True):
        assert np.abs(one - other).max() < 1e-11 * np.abs(one).max()
    assert both[0].facts[5] == 10_007
    assert (both[0].facts[6] > 0) == robust


@pytest.mark.slow
def test_compiled_passes_give_the_same_fit(write, monkeypatch) -> None:
    pytest.importorskip("numba")
    mission = write(readings(60_000, 5))
    plain = ag.fit_recording(mission, REFERENCE)
    monkeypatch.setattr(large_solve, "COMPILE_FROM", 0)
    assert apart(ag.fit_recording(mission, REFERENCE), plain) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("ar", [0.0, 0.9])
def test_errors_are_what_the_standard_errors_say(write, monkeypatch, ar) -> None:
    monkeypatch.setattr(large_scan, "MOST", 3000)
    z = []
    for seed in range(16):
        fit = ag.fit_recording(write(readings(20_000, 100 + seed, ar=ar)), REFERENCE, model="full")
        z.append((parameters(fit) - TRUTH) / fit.sd)
    rms = float(np.sqrt(np.mean(np.square(z))))
    # 16 draws of nine numbers; the scatter of correlated ones is known to 10 % by itself
    assert 0.8 < rms < 1.2 if ar == 0.0 else 0.75 < rms < 1.25
    assert np.abs(np.mean(z, axis=0)).max() < 4 / np.sqrt(16)
    if ar:
        assert fit.correlation > 4  # of (1 + 0.9)/(1 − 0.9) = 19, less as the sensor turns


@pytest.mark.slow
def test_the_same_rows_are_left_out_as_in_memory(write, monkeypatch) -> None:
    field = readings(60_000, 7)
    time = np.arange(60_000) / 50.0
    rng = np.random.default_rng(1)
    field[rng.choice(60_000, 300, replace=False), 1] = np.nan
    time[40_000:40_050] = time[39_999] - 1.0
    field = np.minimum(field, 51_000.0)
    field[20_000:23_000, 2] = field[20_000, 2]
    memory = ag.fit_ellipsoid(ag.Samples(field=field, time=time), REFERENCE)
    monkeypatch.setattr(large_scan, "MOST", 20_000)
    for method in ("likelihood", "adjusted"):
        fit = ag.fit_recording(write(field, time), REFERENCE, method=method)
        assert fit.n == memory.n
        assert {"NaN", "clock", "clipping", "frozen axis"} <= {f.name for f in fit.findings}
    assert apart(ag.fit_recording(write(field, time), REFERENCE), memory) < 4.0


@pytest.mark.slow
def test_a_magnet_in_the_third_hour_of_ten_is_found(write, monkeypatch) -> None:
    monkeypatch.setattr(large_scan, "MOST", 20_000)
    n = 180_000
    field, time = readings(n, 11), np.arange(n) / 5.0  # ten hours
    field[n // 5 : 3 * n // 10] += [1500.0, -1000.0, 500.0]
    fit = ag.fit_recording(write(field, time), REFERENCE)
    (found,) = (f for f in fit.findings if f.name == "field changed")
    start, stop = (float(word.removeprefix("t = ")) for word in _moments(found.what))
    assert abs(start - 7200) < 600
    assert abs(stop - 10_800) < 600


def _moments(text: str) -> list[str]:
    return [part.split(" s")[0] for part in text.split("near ")[1].split(" and ")[:2]]


@pytest.mark.slow
def test_a_change_far_below_the_noise_is_found_and_widens_the_errors(write) -> None:
    n = 150_000
    field = readings(n, 12)
    field[100_000:] += [0.0, 12.0, 0.0]
    fit, steady = (ag.fit_recording(write(f), REFERENCE) for f in (field, readings(n, 12)))
    assert not any(f.name == "bias moves" for f in steady.findings)
    (found,) = (f for f in fit.findings if f.name == "bias moves")
    assert found.severity == "note"
    moment, shift = (float(found.what.split(w)[1].split()[0]) for w in ("t = ", "differs by"))
    assert abs(moment - 2000) < 200
    assert abs(shift - 12) < 5
    assert fit.sd[1] > 1.5 * steady.sd[1]


def test_files_units_and_clocks_are_those_of_the_samples(write, tmp_path) -> None:
    field = readings(30_000, 13)
    whole = ag.fit_recording(write(field), REFERENCE)
    begun = np.datetime64("2026-05-01T00:00:00", "ns")
    paths = []
    for k, part in enumerate(np.split(field, 2)):
        time = begun + (np.arange(15_000) + 15_000 * k) * np.timedelta64(20, "ms")
        columns = {f"mag_{a}_uT": part[:, i] / 1000 for i, a in enumerate("xyz")}
        paths.append(tmp_path / f"day{k}.parquet")
        write_table(pa.table({"time": time, **columns, "temperature_C": part[:, 0]}), paths[-1])
    mission = open_mission(paths)
    fit = ag.fit_recording(mission, REFERENCE)
    assert apart(fit, whole) < 1e-6
    swept = list(mission.strips())
    pieces = list(mission.pieces())
    assert np.concatenate([s.time for s in swept]) == pytest.approx(
        np.concatenate([p.time for p in pieces]), abs=1e-6
    )
    assert np.array_equal(
        np.concatenate([s.field for s in swept]), np.concatenate([p.field for p in pieces])
    )
    assert [i.name for i in fit.calibration.provenance.inputs] == ["day0.parquet", "day1.parquet"]
    with pytest.raises(ag.LogError, match="do not come after"):
        ag.fit_recording(open_mission(paths[::-1]), REFERENCE)


@pytest.mark.slow
def test_memory_stays(write, monkeypatch) -> None:
    monkeypatch.setattr(large_scan, "MOST", 5000)
    peaks = []
    for n in (50_000, 200_000):
        mission = replace(write(readings(n, 1)), strip=8192)
        tracemalloc.start()
        ag.fit_recording(mission, REFERENCE)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.3 * peaks[0]


def test_a_magnitude_for_each_row_is_refused(write) -> None:
    with pytest.raises(ag.AgonicError, match="one constant"):
        ag.fit_recording(write(readings(100, 1)), ag.Reference.magnitude([F, F]))


def test_commands_read_a_long_table_piece_by_piece(write, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("agonic.logs.large.mission.IN_MEMORY", 10_000)
    monkeypatch.setattr(large_scan, "MOST", 5000)
    log = str(write(readings(30_000, 21)).files[0])
    folder = tmp_path / "out"
    assert run(["calibrate", log, "--field", "50000", "-o", str(folder), "--json"]) == 0
    (sensor,) = json.loads(capsys.readouterr().out)["sensors"]
    assert sensor["n"] == 30_000
    assert "5000 of 30000" in sensor["status"]
    assert {path.name for path in folder.iterdir()} >= {"report.html", "mag.json", "mag.h"}
    cal = tmp_path / "cal.json"
    assert run(["fit", "ellipsoid", log, "--field", "50000", "-o", str(cal)]) == 0
    assert ag.load(cal).bias == pytest.approx(sensor["bias"], abs=1e-9)
    assert run(["calibrate", log, "--method", "levelled"]) == 2


def test_batches_see_only_what_lasts() -> None:
    rng = np.random.default_rng(5)
    told = [
        batch_means.compute_scatter(rng.normal(size=(2000, 9)), 2000 * np.eye(9))
        for _ in range(200)
    ]
    assert np.mean([one.correlation > 1 for one in told]) < 0.02
    breaks = [
        batch_means.find_change_point(
            rng.normal(size=(2000, 9)), 2000 * np.eye(9), 2000 * np.eye(9)
        )
        for _ in range(200)
    ]
    assert max(one.significance for one in breaks if one is not None) < 50
