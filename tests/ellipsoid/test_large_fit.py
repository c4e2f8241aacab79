"""`fit_recording`: as in memory, honest, nothing overlooked, memory that stays."""

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
from agonic.ellipsoid import large_fit
from agonic.logs.large.mission import Mission, open_mission
from agonic.maths.equation.symmetric import pack_symmetric
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


@pytest.mark.slow
@pytest.mark.parametrize("strays", [0, 400])
def test_readings_drawn_say_what_all_say(write, monkeypatch, strays) -> None:
    monkeypatch.setattr(large_fit, "MOST", 50_000)
    field = readings(200_000, 3)
    rng = np.random.default_rng(0)
    field[rng.choice(len(field), strays, replace=False)] += 9000 * rng.normal(size=(strays, 3))
    mission = write(field)
    memory = ag.fit_ellipsoid(ag.Samples(field=field), REFERENCE)
    fit = ag.fit_recording(mission, REFERENCE)
    assert memory.n == 200_000
    assert fit.n == len(fit.residuals) == len(fit.weights) == 50_000
    assert apart(fit, memory) < 4.0
    assert np.abs((parameters(fit) - TRUTH) / fit.sd).max() < 4.0
    assert (fit.sd > memory.sd * 0.6).all()  # terms weigh more than noise
    assert fit.noise == pytest.approx(memory.noise, rel=0.02)
    assert apart(ag.fit_recording(replace(mission, strip=7_777), REFERENCE), fit) < 1e-6
    said = {f.name: f.what.split()[0] for f in fit.findings}
    assert said.keys() == {f.name for f in memory.findings}
    assert ("outliers" in said) == (strays > 0)
    ours = ag.fit_recording(mission, REFERENCE, method="adjusted")
    if not strays:  # which it does not weigh less
        assert np.abs((parameters(ours) - TRUTH) / ours.sd).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("ar", [0.0, 0.9])
def test_errors_are_what_the_standard_errors_say(write, monkeypatch, ar) -> None:
    monkeypatch.setattr(large_fit, "MOST", 3000)
    z = []
    for seed in range(16):
        fit = ag.fit_recording(write(readings(20_000, 100 + seed, ar=ar)), REFERENCE, model="full")
        z.append((parameters(fit) - TRUTH) / fit.sd)
    rms = float(np.sqrt(np.mean(np.square(z))))
    # 16 draws of nine numbers; what lasts is in the bias, which the mean of a long log hardly shows
    assert (0.8 if ar == 0.0 else 0.0) < rms < 1.25
    assert np.abs(np.mean(z, axis=0)).max() < 4 / np.sqrt(16)


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
    monkeypatch.setattr(large_fit, "MOST", 20_000)
    for method in ("likelihood", "adjusted"):
        fit = ag.fit_recording(write(field, time), REFERENCE, method=method)
        assert fit.n == pytest.approx(memory.n / 3, rel=0.02)
        assert {"NaN", "clock", "clipping", "frozen axis"} <= {f.name for f in fit.findings}
    assert apart(ag.fit_recording(write(field, time), REFERENCE), memory) < 4.0


@pytest.mark.slow
def test_a_magnet_in_the_third_hour_of_ten_is_found(write, monkeypatch) -> None:
    monkeypatch.setattr(large_fit, "MOST", 20_000)
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
def test_a_change_of_the_bias_is_found_as_in_memory(write, monkeypatch) -> None:
    monkeypatch.setattr(large_fit, "MOST", 30_000)
    field = readings(150_000, 12)
    field[100_000:] += [0.0, 2000.0, 0.0]
    fit, steady = (ag.fit_recording(write(f), REFERENCE) for f in (field, readings(150_000, 12)))
    assert not steady.findings
    (found,) = (f for f in fit.findings if f.name == "field changed")
    assert abs(float(found.what.split("t = ")[1].split()[0]) - 2000) < 60


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
        np.concatenate([s.factor * np.stack(s.columns, axis=1) for s in swept]),
        np.concatenate([p.field for p in pieces]),
    )
    assert [i.name for i in fit.calibration.provenance.inputs] == ["day0.parquet", "day1.parquet"]
    with pytest.raises(ag.LogError, match="do not come after"):
        ag.fit_recording(open_mission(paths[::-1]), REFERENCE)


@pytest.mark.slow
def test_memory_stays(write, monkeypatch) -> None:
    monkeypatch.setattr(large_fit, "MOST", 5000)
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
    monkeypatch.setattr(large_fit, "MOST", 5000)
    log = str(write(readings(30_000, 21)).files[0])
    folder = tmp_path / "out"
    assert run(["calibrate", log, "--field", "50000", "-o", str(folder), "--json"]) == 0
    (sensor,) = json.loads(capsys.readouterr().out)["sensors"]
    assert sensor["n"] == 5000
    assert "5000 of 30000" in sensor["status"]
    assert {path.name for path in folder.iterdir()} >= {"report.html", "mag.json", "mag.h"}
    cal = tmp_path / "cal.json"
    assert run(["fit", "ellipsoid", log, "--field", "50000", "-o", str(cal)]) == 0
    assert ag.load(cal).bias == pytest.approx(sensor["bias"], abs=1e-9)
    assert run(["calibrate", log, "--method", "levelled"]) == 2


def test_batches_see_only_what_lasts() -> None:
    rng = np.random.default_rng(5)
    white = 2000 * np.eye(9)
    told = [batch_means.measure_correlation(rng.normal(size=(2000, 9)), white) for _ in range(200)]
    assert np.mean([one > 1 for one in told]) < 0.02
