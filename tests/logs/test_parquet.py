"""Parquet tables mean what text tables of the same names mean."""

from datetime import UTC, datetime

import numpy as np
import pytest

from agonic.errors import LogError, MissingExtraError
from agonic.logs.read import open_log, read, sensors

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

FIELD = np.array([[20.5, -1.25, 43.0], [19.75, 3.5, 42.5], [18.0, 7.25, -42.125]])
XYZ = {f"mag_{a}_uT": FIELD[:, k] for k, a in enumerate("xyz")}


@pytest.fixture
def table(tmp_path):
    def write(columns, **options):
        path = tmp_path / "log.parquet"
        pq.write_table(pa.table(columns), path, **options)
        return path

    return write


def test_numbers_and_units(table):
    path = table(
        {"time_ms": [0, 20, 40], **XYZ, "temp": pa.array([21.5, None, 22.5]), "n": [1] * 3}
    )
    samples = read(path)
    np.testing.assert_array_equal(samples.field, FIELD * 1e3)
    np.testing.assert_array_equal(samples.time, [0, 0.02, 0.04])
    np.testing.assert_allclose(samples.temperature, [21.5, 22, 22.5])
    assert [stream.name for stream in open_log(path).streams] == ["n"]


@pytest.mark.parametrize("zone", [None, "UTC", "+02:00"])
@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_moments(table, zone, unit):
    start = np.datetime64("2026-03-01T12:00:00.250", unit)
    moments = start + (np.array([0, 20, 40]) * np.timedelta64(1, "ms")).astype(f"m8[{unit}]")
    column = pa.array(moments).cast(pa.timestamp(unit, tz=zone))
    samples = read(table({"timestamp": column, **XYZ}))
    assert samples.epoch == datetime(2026, 3, 1, 12, tzinfo=UTC)
    np.testing.assert_allclose(samples.time, [0.25, 0.27, 0.29], atol=1e-12)


def test_nested_and_dotted_columns(table):
    rows = [dict(zip("xyz", row, strict=True)) for row in FIELD.tolist()]
    np.testing.assert_array_equal(read(table({"mag": pa.array(rows)})).field, FIELD)
    dotted = {f"magnetometer.{a}": FIELD[:, k] for k, a in enumerate("xyz")}
    np.testing.assert_array_equal(read(table(dotted), unit="G").field, FIELD * 1e5)


def test_sensors_in_rows(table):
    path = table({"sensor": ["a", "b", "a"], **XYZ})
    assert sensors(path) == ("a", "b")
    np.testing.assert_array_equal(read(path, "a").field, FIELD[[0, 2]] * 1e3)


def test_what_is_no_log(table, monkeypatch):
    with pytest.raises(LogError, match=r"no magnetometer columns found among 'a', 'b'"):
        open_log(table({"a": [1.0], "b": ["x"]}))
    with pytest.raises(LogError, match="more than 4096 are no log"):
        open_log(table({f"c{i}": [1.0] for i in range(5000)}))
    path = table(XYZ)
    data = path.read_bytes()
    path.write_bytes(data[:-8] + (10**9).to_bytes(4, "little") + b"PAR1")
    with pytest.raises(LogError, match="too long for a log, or damaged"):
        open_log(path)
    monkeypatch.setitem(__import__("sys").modules, "pyarrow.parquet", None)
    with pytest.raises(MissingExtraError, match=r"agonic\[tables\]"):
        open_log(path)
