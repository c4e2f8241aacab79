"""A dataset of many sensors: sums by DuckDB, fits to them, and rows where these matter."""

import datetime as dt
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow.parquet import write_table

import agonic as ag
from agonic.ellipsoid import fit_moments
from agonic.errors import AgonicError, LogError
from agonic.exports.csv import write_csv
from agonic.fleet.dataset import calibrate_dataset
from agonic.fleet.engine import Here
from agonic.fleet.settings import FleetSettings
from agonic.fleet.simulation.files import make_tables
from agonic.fleet.simulation.simulate import simulate_fleet
from agonic.logs.large.dataset import connect, find_dataset
from agonic.logs.large.grouped_moments import Grouped, sum_moments, sum_residuals
from agonic.moments import Moments
from agonic.population import Population
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.simulation import defects, simulate

FIELD = 50_000.0
AXES_UT = ("mag_x_uT", "mag_y_uT", "mag_z_uT")
SETTINGS = FleetSettings(field_nT=FIELD)


def turned(seed: int, n: int = 300, **settings: object) -> Samples:
    """A sound sensor: white noise, all directions."""
    return simulate("tumble", n=n, seed=seed, rate_Hz=10.0, **settings).samples


def columns(samples: Samples, sensor: object) -> dict[str, np.ndarray]:
    named = {f"mag_{axis}_nT": samples.field[:, i].copy() for i, axis in enumerate("xyz")}
    return {"sensor": np.full(len(samples), sensor), "time_s": samples.time, **named}


def write(path: Path, *parts: dict[str, np.ndarray], shuffle: bool = False) -> Path:
    """One Parquet file of all rows."""
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    rows = np.arange(len(joined["sensor"]))
    if shuffle:
        rows = np.random.default_rng(0).permutation(rows)
    write_table(pa.table({name: column[rows] for name, column in joined.items()}), path)
    return path


def calibrated(path: Path, settings: FleetSettings = SETTINGS, **more: object) -> Population:
    return calibrate_dataset(path, settings, engine=Here(), **more)


def sums_of(path: Path) -> Grouped:
    dataset = find_dataset(path)
    assert dataset is not None
    with connect() as db:
        return sum_moments(db, dataset, dataset.channels[0])


def test_the_sums_are_the_moments_of_each_sensor_s_readings(tmp_path):
    """Biases a hundred times the field, in uT: each sensor's own middle keeps the digits."""
    logs = [turned(k, 200 + k).field + 5e6 * (k == 3) for k in range(5)]
    parts = [
        {"sensor": np.full(len(raw), k), **dict(zip(AXES_UT, raw.T / 1e3, strict=True))}
        for k, raw in enumerate(logs)
    ]
    grouped = sums_of(write(tmp_path / "a.parquet", *parts, shuffle=True))
    assert grouped.sensors.tolist() == ["0", "1", "2", "3", "4"]
    for k, raw in enumerate(logs):
        about, scale = grouped.centre[k], grouped.scale[k]
        wanted = Moments.of(raw, centre=about, scale=scale)
        assert grouped.sums[k] == pytest.approx(wanted.sums, rel=1e-9, abs=1e-6)
        assert about == pytest.approx(raw.mean(axis=0), rel=1e-9)
        size = np.linalg.norm(raw, axis=1)
        assert grouped.spread[k] == pytest.approx(size.std() / size.mean(), rel=1e-4)


def test_a_sound_fleet_is_what_fit_moments_finds_sensor_by_sensor(tmp_path):
    logs = [turned(k) for k in range(12)]
    parts = [columns(samples, f"board {k:02}") for k, samples in enumerate(logs)]
    table = calibrated(write(tmp_path / "a.parquet", *parts, shuffle=True))
    assert set(table["method"]) == {"adjusted"}
    for k, samples in enumerate(logs):
        fit = fit_moments(Moments.of(samples.field), Reference.constant(FIELD))
        affine = fit.calibration
        assert table["sensor"][k] == f"board {k:02}"
        assert table["rows"][k] == len(samples)
        assert table.bias[k] == pytest.approx(affine.bias, abs=1e-4 * fit.sd[0])
        assert table.matrix[k] == pytest.approx(affine.matrix, abs=1e-7)
        assert table.bias_sd[k] == pytest.approx(fit.sd[:3], rel=1e-5)
        assert table["heading_sd_deg"][k] == pytest.approx(fit.coverage.heading_sd_deg, rel=1e-5)
        assert table["noise"][k] == pytest.approx(fit.noise, rel=1e-6)
        assert table["model"][k] == affine.model
        assert (table["verdict"][k], table["status"][k]) == ("good", fit.status)
        assert table["duration_s"][k] == pytest.approx(samples.duration_s)
        size = np.linalg.norm(affine.correct(samples.field), axis=1)
        assert table["residual_rms"][k] == pytest.approx(size.std(), rel=0.02)


FAULTS = {
    "outliers": defects.with_outliers(0.05, seed=1),
    "changed": defects.magnet_attached(15.0, [3000.0, 0, 0]),
    "frozen": defects.frozen(2, start=10.0),
    "wavering": defects.with_correlated_noise(400.0, 2.0),
    "clipped": defects.clipped(45_000.0),
}


@pytest.mark.slow
def test_rows_decide_where_moments_cannot(tmp_path):
    """Broken, flat and short logs have the row that a log of their own would have."""
    logs = {"sound": turned(0)}
    for k, (name, fault) in enumerate(FAULTS.items()):
        logs[name] = simulate("tumble", n=300, seed=9 + k, rate_Hz=10.0, defects=[fault]).samples
    logs["level"] = simulate("circle", n=300, seed=4).samples
    logs["still"] = simulate("static", n=300, seed=5).samples
    logs["short"] = turned(6).select(np.arange(7))
    logs["noisy"] = turned(7, noise=1500.0)
    lost = columns(turned(8), "lost")
    lost["mag_x_nT"][::20] = np.nan
    parts = [columns(samples, name) for name, samples in logs.items()]
    path = write(tmp_path / "a.parquet", *parts, lost)
    table, whole = calibrated(path), calibrated(path, refine="all")
    by_moments = table["sensor"][table["method"] == "adjusted"].tolist()
    assert by_moments == ["sound"]
    for name in ("verdict", "findings", "model", "method", "status"):
        rows = table["sensor"] != "sound"
        assert table[name][rows].tolist() == whole[name][rows].tolist()
    assert table["verdict"].tolist() == whole["verdict"].tolist()
    sound = table["sensor"].tolist().index("sound")
    assert np.abs(table.bias[sound] - whole.bias[sound]).max() < 0.3 * whole.bias_sd[sound].min()
    said = dict(zip(table["sensor"], table["findings"], strict=True))
    assert "frozen axis" in said["frozen"]
    assert "field changed" in said["changed"]
    assert "prior" in said["level"]


def test_moments_alone_say_what_they_can(tmp_path):
    logs = {name: simulate(name, n=300, seed=4).samples for name in ("circle", "static")}
    logs["few"] = turned(1).select([0, 1, 2])
    logs["wrong unit"] = turned(2).with_columns(field=turned(2).field / 10)
    path = write(tmp_path / "a.parquet", *(columns(s, name) for name, s in logs.items()))
    table = calibrated(path, refine="none")
    assert dict(zip(table["sensor"], table["verdict"], strict=True)) == {
        "circle": "check",
        "few": "refused",
        "static": "refused",
        "wrong unit": "check",
    }
    assert table["findings"].tolist() == [("coverage",), ("coverage",), ("coverage",), ("scale",)]
    assert "3 readings do not determine a sphere" in table["status"][1]
    assert "do not determine an ellipsoid" in table["status"][2]


@pytest.mark.slow
def test_planted_faults_are_named_as_in_single_logs(tmp_path):
    """Swapped axes show in gravity alone; no sound board becomes suspect."""
    fleet = simulate_fleet(60, broken=0.2, swapped=0.1, duplicated=0.0, damaged=0.0, seed=2)
    rows = [pa.table(dict(table)) for table in make_tables(fleet)]
    write_table(pa.concat_tables(rows), tmp_path / "a.parquet")
    table = calibrated(tmp_path / "a.parquet", FleetSettings(field_nT=48_000.0))
    fault = dict(zip(fleet.truth["sensor"], fleet.truth["group"], strict=True))
    found = dict(zip(table["sensor"], table["findings"], strict=True))
    method = dict(zip(table["sensor"], table["method"], strict=True))
    for sensor, group in fault.items():
        if group == "swapped":
            assert "axes" in found[sensor]
    sound = [sensor for sensor, group in fault.items() if group == ""]
    assert sum(method[sensor] == "adjusted" for sensor in sound) >= len(sound) - 2
    assert table["temperature_C"] == pytest.approx(np.full(len(table), 25.0), abs=15)
    starts = dict(zip(table["sensor"], table["start"], strict=True))
    assert all(
        abs(starts[s] - start) < dt.timedelta(seconds=1)
        for s, start in zip(fleet.truth["sensor"], fleet.truth["start"], strict=True)
        if "field changed" not in found[s]  # of a stretch, which begins later
    )


def test_folders_by_sensor_texts_moments_and_lost_files(tmp_path):
    folder = tmp_path / "data"
    for k in (3, 20):
        samples = turned(k)
        part = {name: c for name, c in columns(samples, k).items() if name != "sensor"}
        first = np.datetime64("2026-03-01T12:00:00", "us")
        part["timestamp"] = first + (1e6 * part.pop("time_s")).astype("timedelta64[us]")
        (folder / f"board={k:03}").mkdir(parents=True)
        write_table(pa.table(part), folder / f"board={k:03}" / "part.parquet")
    (folder / "board=004").mkdir()
    (folder / "board=004" / "part.parquet").write_bytes(b"PAR1 and no more")
    table = calibrated(folder)
    assert table["sensor"].tolist() == ["003", "020", ""]
    assert table["verdict"].tolist() == ["good", "good", "refused"]
    assert table["source"][2].endswith("board=004/part.parquet")
    assert table["start"][0] == dt.datetime(2026, 3, 1, 12, tzinfo=dt.UTC)
    assert len(set(table["key"])) == 3


def test_a_file_whose_pages_are_damaged_is_a_row(tmp_path):
    (tmp_path / "d").mkdir()
    for k in (1, 2):
        write(tmp_path / "d" / f"{k}.parquet", columns(turned(k, 2000), k))
    content = bytearray((tmp_path / "d" / "2.parquet").read_bytes())
    content[4:9000] = bytes(8996)
    (tmp_path / "d" / "2.parquet").write_bytes(content)
    table = calibrated(tmp_path / "d")
    assert table["sensor"].tolist() == ["1", ""]
    assert table["verdict"].tolist() == ["good", "refused"]


def test_rows_without_readings_or_sensor_are_told(tmp_path):
    good, empty = columns(turned(1), "a"), columns(turned(2, 40), "b")
    good["mag_x_nT"][:2] = np.nan
    empty["mag_z_nT"][:] = np.inf
    nameless = columns(turned(3, 50), "c")
    nameless["sensor"] = np.full(50, None)
    parts = [{**p, "sensor": p["sensor"].astype(object)} for p in (good, empty, nameless)]
    table = calibrated(write(tmp_path / "a.parquet", *parts))
    said = dict(zip(table["sensor"], table["status"], strict=True))
    assert said["b"] == "none of its 40 rows holds three finite readings"
    assert said[""] == "50 rows name no sensor and were left out"
    assert "2 of 300 rows were left out (NaN or infinite field)" in said["a"]
    assert table["rows"].tolist() == [0, 298, 0]


def test_raw_counts_without_clock(tmp_path):
    raw = np.round(turned(5, 500).field / 60).astype(np.int16)
    names = {f"mag_{a}": raw[:, i] for i, a in enumerate("xyz")}
    path = write(tmp_path / "a.parquet", {"sensor": np.repeat([7, 8], 250), **names})
    table = calibrated(path, FleetSettings())
    assert set(table["unit_in"]) == {"raw"}
    assert np.isnan(table["duration_s"]).all()
    assert table["start"].tolist() == [None, None]
    assert table["magnitude"] == pytest.approx(np.full(2, FIELD / 60), rel=0.15)


def test_the_row_of_a_refined_sensor_is_that_of_its_log(tmp_path):
    from agonic.fleet.one_log import calibrate_log

    noisy = turned(7, noise=1500.0)
    path = write(tmp_path / "a.parquet", columns(noisy, "n"), columns(turned(1), "m"), shuffle=True)
    row = next(row for row in calibrated(path) if row.sensor == "n")
    log = write_csv(ag.Samples(field=noisy.field, time=noisy.time), tmp_path / "n.csv")
    alone = calibrate_log(str(log), settings=SETTINGS, folder=str(tmp_path)).rows[0]
    assert row.method == alone.method == "ellipsoid"
    assert row.bias_x == pytest.approx(alone.bias_x, abs=1e-3 * alone.bias_x_sd)
    assert (row.status, row.rows) == (alone.status, alone.rows)


def test_residuals_are_those_of_the_readings(tmp_path):
    samples = turned(3)
    dataset = find_dataset(write(tmp_path / "a.parquet", columns(samples, 1)))
    bias, matrix = np.array([[100.0, 0, -50]]), np.diag([1.01, 1, 0.99])[None]
    with connect() as db:
        sum_moments(db, dataset, dataset.channels[0])
        found = sum_residuals(db, dataset, dataset.channels[0], bias, matrix, np.array([FIELD]))
    field = (samples.field - bias[0]) @ matrix[0].T
    size = np.linalg.norm(field, axis=1)
    r = size / FIELD - 1
    assert found.sd[0] == pytest.approx(np.sqrt(np.mean(r**2)), rel=1e-6)
    assert found.largest.max() == pytest.approx(np.abs(r).max(), rel=1e-6)
    assert found.count.sum() == len(r)
    assert found.pull.sum(axis=1)[0] == pytest.approx((r[:, None] * field / size[:, None]).sum(0))
    late = samples.time > samples.time[0] + 7 / 8 * samples.duration_s
    assert found.squares[0, -1] == pytest.approx((r[late] ** 2).sum(), rel=0.1)


def test_which_column_tells_sensors_apart(tmp_path):
    part = columns(turned(1), "a")
    both = {**part, "Serial-Number": part["sensor"]}
    path = write(tmp_path / "a.parquet", both)
    with pytest.raises(AgonicError, match="sensor and Serial-Number could both"):
        find_dataset(path)
    assert find_dataset(path, "Serial-Number").sensor == "Serial-Number"
    with pytest.raises(LogError, match="no column 'x'; there are sensor"):
        find_dataset(path, "x")
    del part["time_s"]
    write_table(pa.table({k: v for k, v in part.items() if k != "sensor"}), tmp_path / "b.parquet")
    assert find_dataset(tmp_path / "b.parquet") is None
    with pytest.raises(AgonicError, match="no Parquet table with a column of sensors"):
        calibrated(tmp_path / "b.parquet")
