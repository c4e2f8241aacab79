"""What hangs or crashes in a child process is one error, in time, and the next file is read."""

import os
import time

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs import child_process
from agonic.logs.read import open_log


def test_what_never_ends_is_stopped(monkeypatch):
    assert child_process.call(len, "warm") == 4
    monkeypatch.setattr(child_process, "LONGEST_S", 0.5)
    with pytest.raises(LogError, match=r"did not end within 0\.5 s"):
        child_process.call(time.sleep, 86_400)
    monkeypatch.undo()
    assert child_process.call(len, "next") == 4


def test_what_crashes_is_told():
    for _ in range(2):
        with pytest.raises(LogError, match="its library crashes"):
            child_process.call(os._exit, 3)
    assert child_process.call(len, "next") == 4


def test_what_fails_there_fails_here():
    with pytest.raises(RuntimeError, match="ValueError: invalid literal"):
        child_process.call(int, "x")
    with pytest.raises(LogError, match=r"nowhere\.csv: there is no such file"):
        child_process.call(open_log, "nowhere.csv")


def test_what_takes_all_memory_is_told():
    """More than the limit is asked for, and less is given."""
    with pytest.raises(MemoryError):
        child_process.call(bytearray, child_process.MOST_MEMORY + 1)
    assert len(child_process.call(bytearray, 1_000_000)) == 1_000_000


def test_an_hdf5_file_of_numbers(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.h5"
    field = np.random.default_rng(1).normal(0, 30, (50, 3))
    with h5py.File(path, "w") as file:
        file["mag"] = field
        file["mag"].attrs["units"] = "uT"
    np.testing.assert_allclose(open_log(path).sensors[0].field, field * 1e3)
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(LogError, match=f"{path}: cannot be read as netCDF"):
        open_log(path)
