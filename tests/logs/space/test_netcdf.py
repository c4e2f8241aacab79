"""netCDF files of both versions: CF times, packed numbers, satellite variables, and damage."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file

from agonic.errors import MissingExtraError
from agonic.logs.formats import format_of
from agonic.logs.read import open_log, read
from tests.logs.damage import damaged, read_or_refused
from tests.logs.orbit_writer import swarm

h5py = pytest.importorskip("h5py")

N = 400
FIELD = np.random.default_rng(2).normal(0, 30, (N, 3))


def version_4(path: Path, start: str = "seconds since 2026-03-01 12:00:00") -> Path:
    """A file as netCDF's own library lays it out, dimension scales included."""
    with h5py.File(path, "w") as file:
        time = file.create_dataset("time", data=np.arange(N) / 10)
        time.attrs["units"] = start
        time.make_scale("time")
        axis = file.create_dataset("xyz", data=np.zeros(3, ">f4"))
        axis.make_scale("This is a netCDF dimension but not a netCDF variable.         3")
        mag = file.create_dataset("mag", data=FIELD.astype("f4"))
        mag.attrs["units"] = np.bytes_("uT")
        mag.dims[0].attach_scale(time)
        mag.dims[1].attach_scale(axis)
        packed = np.full(N, 2150, "i2")
        packed[5] = -9999
        temperature = file.create_dataset("temperature", data=packed)
        temperature.attrs.update(
            {"scale_factor": 0.01, "units": "degree_Celsius", "_FillValue": np.int16(-9999)}
        )
        for name, value in (("latitude", 52.0), ("longitude", 5.0)):
            place = file.create_dataset(name, data=np.full(N, value))
            place.attrs["units"] = f"degrees_{'north' if name == 'latitude' else 'east'}"
    return path


def version_3(path: Path, start: str) -> Path:
    with netcdf_file(path, "w") as file:
        file.createDimension("time", N)
        columns = {"time": np.arange(N) / 86400.0} | dict(
            zip(("mag_x", "mag_y", "mag_z"), FIELD.T, strict=True)
        )
        for name, values in columns.items():
            variable = file.createVariable(name, "d", ("time",))
            variable[:] = values
            variable.units = start if name == "time" else "nT"
    return path


def test_version_4(tmp_path: Path) -> None:
    log = open_log(version_4(tmp_path / "a.nc"))
    (sensor,) = log.sensors
    assert (log.format, sensor.epoch) == ("netCDF", datetime(2026, 3, 1, 12, tzinfo=UTC))
    np.testing.assert_allclose(sensor.field, FIELD * 1e3, rtol=1e-6)
    np.testing.assert_allclose(sensor.time, np.arange(N) / 10, atol=1e-6)
    np.testing.assert_allclose(sensor.temperature, 21.5)
    assert len(sensor) == N  # the fill value was a short hole
    assert (sensor.latitude_deg[0], sensor.longitude_deg[0]) == (52.0, 5.0)


def test_written_by_another_library(tmp_path: Path) -> None:
    h5netcdf = pytest.importorskip("h5netcdf")
    path = tmp_path / "b.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": N, "xyz": 3}
        time = file.create_variable("time", ("time",), "i8")
        time[:] = np.arange(N)
        time.attrs["units"] = "milliseconds since 1970-01-01"
        group = file.create_group("fluxgate")
        mag = group.create_variable("mag_nT", ("time", "xyz"), "f8")
        mag[:] = FIELD
    samples = read(path)
    assert samples.name == "fluxgate"
    np.testing.assert_array_equal(samples.field, FIELD)
    np.testing.assert_allclose(samples.time, np.arange(N) / 1e3)


@pytest.mark.parametrize(
    ("start", "epoch"),
    [
        ("days since 2000-1-1 0:0:0", datetime(2000, 1, 1, tzinfo=UTC)),
        ("days since 1858-11-17", datetime(1858, 11, 17, tzinfo=UTC)),
        ("days since 2026-03-01T00:00:00Z", datetime(2026, 3, 1, tzinfo=UTC)),
        ("days since 2026-03-01 00:00:00.0 UTC", datetime(2026, 3, 1, tzinfo=UTC)),
    ],
)
def test_version_3_needs_no_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: str, epoch: datetime
) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    samples = read(version_3(tmp_path / "c.nc", start))
    np.testing.assert_allclose(samples.field, FIELD)
    np.testing.assert_allclose(samples.time, np.arange(float(N)), atol=1e-5)
    assert samples.epoch == epoch


def test_satellite_variables(tmp_path: Path) -> None:
    variables = swarm()
    path = tmp_path / "swarm.nc"
    with h5py.File(path, "w") as file:
        for name, values in variables.items():
            file[name] = np.arange(len(values)) if name == "Timestamp" else values
        file["Timestamp"].attrs["units"] = "seconds since 2016-01-01"
    sensor = read(path, "B_VFM")
    assert (sensor.frame, sensor.epoch) == ("m", datetime(2016, 1, 1, tzinfo=UTC))
    np.testing.assert_array_equal(sensor.field, variables["B_VFM"])
    np.testing.assert_array_equal(sensor.scalar, variables["F"])


@pytest.mark.parametrize("version", [3, 4])
def test_damage_of_any_kind_gives_a_log_or_one_clear_sentence(tmp_path: Path, version: int) -> None:
    whole = tmp_path / "whole.nc"
    version_4(whole) if version == 4 else version_3(whole, "days since 2000-01-01")
    data, rng, read_well = np.fromfile(whole, dtype=np.uint8), np.random.default_rng(5), 0
    path = tmp_path / "fuzz.nc"
    for _ in range(150):
        path.write_bytes(damaged(data, rng).tobytes())
        if (log := read_or_refused(open_log, path)) is not None:
            read_well += 1
            assert all(np.isfinite(s.field).all() for s in log.sensors)
    assert read_well > 10


def test_a_missing_reader_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = version_4(tmp_path / "a.nc")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r"agonic\[space\]"):
        open_log(path)


def test_matlab_7_3_is_another_reader_s() -> None:
    head = b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n"
    assert format_of(head).module == "arrays.files"
    for netcdf in (b"CDF\x01", b"CDF\x02", bytes.fromhex("894844460d0a1a0a")):
        assert format_of(netcdf).module == "space.netcdf"
    assert format_of(b"CDF\x09").module == "text.csv_text"
