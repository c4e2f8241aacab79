"""What is written is read back to the last digit."""

import csv
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agonic.errors import AgonicError
from agonic.exports.csv import write_csv
from agonic.logs.read import read
from agonic.samples import COLUMNS, Samples
from agonic.usable_rows import VECTORS


def full(n=50, **changed):
    """Samples with every column, awkward digits included."""
    rng = np.random.default_rng(3)
    columns = {c: rng.normal(0, 10, (n, 3) if c in VECTORS else n) for c in COLUMNS}
    columns["time"] = np.cumsum(rng.uniform(0.01, 0.03, n))
    columns["throttle"] = rng.uniform(0, 1, n)
    columns["field"] *= 1e3 / 3
    return Samples(**columns | changed)


def assert_same(a, b):
    assert (a.unit, a.epoch, a.name, a.frame) == (b.unit, b.epoch, b.name, b.frame)
    assert a.columns().keys() == b.columns().keys()
    for name, values in a.columns().items():
        np.testing.assert_array_equal(values, b.columns()[name], err_msg=name)


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"unit": "raw"},
        {"epoch": datetime(2026, 3, 1, 12, 30, 15, 123457, tzinfo=UTC)},
        {"name": "MAG2", "frame": "b"},
        {"name": 'left, "outer"', "unit": "raw"},
        {"time": None, "temperature": None, "acceleration": None},
    ],
)
def test_round_trip(tmp_path, changed):
    samples = full(**changed)
    path = write_csv(samples, tmp_path / "samples.csv")
    assert_same(read(path), samples)
    assert dict(read(path).rejected) == {}


@given(st.lists(st.floats(-1e15, 1e15), min_size=3, max_size=3))  # beyond: left out at the door
def test_any_number_survives(tmp_path_factory, reading):
    path = tmp_path_factory.mktemp("any") / "samples.csv"
    write_csv(Samples(field=[reading], unit="nT"), path)
    np.testing.assert_array_equal(read(path).field, [reading])


def test_a_plain_reader_finds_canonical_names(tmp_path):
    path = write_csv(full(2), tmp_path / "samples.csv")
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0])[:5] == ["time_s", "mag_x_nT", "mag_y_nT", "mag_z_nT", "temperature_C"]
    assert {"acc_x_m_s2", "gyro_z_rad_s", "current_A", "latitude_deg", "station"} <= set(rows[0])
    assert float(rows[1]["mag_y_nT"]) == full(2).field[1, 1]


def test_a_folder_that_is_missing(tmp_path):
    with pytest.raises(AgonicError, match="there is no folder"):
        write_csv(full(2), tmp_path / "missing" / "samples.csv")
