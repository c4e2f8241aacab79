"""SQLite databases and Arrow files: the tables in them, and what is made to harm."""

import sqlite3

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log, read
from tests.logs.damage import damaged
from tests.logs.test_fuzz import assert_read_or_refused

N = 60
TIME = np.arange(N) * 0.02
FIELD = np.random.default_rng(6).normal(0.0, 30.0, (N, 3)).round(2)
ACC = np.tile([0.1, -0.2, 9.8], (N, 1))


def check(samples):
    np.testing.assert_allclose(samples.field, FIELD * 1e3)
    np.testing.assert_allclose(samples.time - samples.time[0], TIME, atol=1e-6)


@pytest.fixture
def database(tmp_path):
    """A table for each sensor, as apps have it, and one of something else."""
    path = tmp_path / "log.db"
    with sqlite3.connect(path) as made:
        for name, values in (("magnetometer", FIELD), ("accelerometer", ACC)):
            made.execute(f"CREATE TABLE {name} (id INTEGER PRIMARY KEY, ts_ms, x REAL, y REAL, z)")
            made.execute(f"CREATE INDEX by_{name} ON {name} (x)")  # in whose order none is read
            rows = [(t * 1e3, *row) for t, row in zip(TIME, values.tolist(), strict=True)]
            made.executemany(f"INSERT INTO {name} (ts_ms, x, y, z) VALUES (?, ?, ?, ?)", rows)
        made.execute("CREATE TABLE settings (key TEXT, value TEXT)")
        made.execute("INSERT INTO settings VALUES ('version', '4')")
        made.execute("CREATE VIEW mag_z AS SELECT x AS mag_x, y AS mag_y, z AS mag_z FROM missing")
    made.close()
    return path


def test_a_table_for_each_sensor(database):
    samples = read(database, unit="uT")
    check(samples)
    assert samples.name == "magnetometer"
    np.testing.assert_allclose(samples.acceleration, ACC)


def test_one_table_with_texts_and_gaps(tmp_path):
    path = tmp_path / "log"
    with sqlite3.connect(path) as made:
        made.execute('CREATE TABLE "my log" (time TEXT, mag_x_uT, mag_y_uT, mag_z_uT)')
        rows = [(f"2026-05-03T08:15:{t:06.3f}Z", *map(str, b)) for t, b in zip(
            TIME, FIELD.tolist(), strict=True)]  # fmt: skip
        made.executemany('INSERT INTO "my log" VALUES (?, ?, ?, ?)', [*rows, (None, 1, None, b"x")])
    made.close()
    log = open_log(path)
    check(log.sensors[0])
    assert log.sensors[0].epoch.isoformat() == "2026-05-03T08:15:00+00:00"
    assert "from its table 'my log'" in log.notes


def test_a_database_without_readings_or_with_damage_is_one_line(database, tmp_path):
    data, rng = np.frombuffer(database.read_bytes(), np.uint8), np.random.default_rng(2)
    path = tmp_path / "damaged"
    for _ in range(80):
        path.write_bytes(damaged(data, rng).tobytes())
        assert_read_or_refused(path)
    path.write_bytes(
        data.tobytes().replace(b"TABLE accelerometer (id", b'TABLE accelerometer ("\n')
    )
    assert_read_or_refused(path)  # SQLite's own words have lines
    with sqlite3.connect(path := tmp_path / "other") as made:
        made.execute("CREATE TABLE people (name, age)")
    made.close()
    with pytest.raises(LogError, match=r"no magnetometer columns found among 'people\.name'"):
        read(path)


@pytest.fixture
def table():
    pa = pytest.importorskip("pyarrow")
    moments = (1.7e9 + TIME) * 1e9
    axes = {f"mag_{a}_uT": FIELD[:, k] for k, a in enumerate("xyz")}
    return pa.table({"time": pa.array(moments.astype("int64"), pa.timestamp("ns", "UTC")), **axes})


@pytest.mark.parametrize("kind", ["file", "stream", "feather"])
def test_arrow(tmp_path, table, kind):
    import pyarrow as pa
    from pyarrow import feather

    path = tmp_path / "log"
    if kind == "feather":
        feather.write_feather(table, str(path), compression="zstd")
    else:
        make = pa.ipc.new_file if kind == "file" else pa.ipc.new_stream
        with make(str(path), table.schema) as writer:
            writer.write_table(table, max_chunksize=17)
    samples = read(path)
    check(samples)
    assert samples.epoch.timestamp() == 1.7e9
    data, rng = np.frombuffer(path.read_bytes(), np.uint8), np.random.default_rng(3)
    for _ in range(40):
        path.write_bytes(damaged(data, rng).tobytes())
        assert_read_or_refused(path)


def test_vectors_in_an_arrow_column(tmp_path, table):
    import pyarrow as pa

    vectors = pa.FixedSizeListArray.from_arrays(pa.array(FIELD.ravel()), 3)
    inside = pa.StructArray.from_arrays([vectors], ["mag_uT"])
    with pa.ipc.new_file(str(tmp_path / "log"), (whole := pa.table(
        {"time_s": TIME, "imu": inside})).schema) as writer:  # fmt: skip
        writer.write_table(whole)
    check(read(tmp_path / "log"))
