"""NumPy archives of arrays under the names of columns."""

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log, read

FIELD = np.arange(15.0).reshape(5, 3)


@pytest.fixture
def archive(tmp_path):
    def write(**arrays):
        path = tmp_path / "log.npz"
        np.savez(path, **arrays)
        return path

    return write


@pytest.mark.parametrize("mag", [FIELD, FIELD.T], ids=["rows", "columns"])
def test_vectors_in_rows_or_columns(archive, mag):
    path = archive(mag_uT=mag, t=np.arange(5) / 50, temp=np.full(5, 21.0), picture=np.eye(4))
    samples = read(path)
    np.testing.assert_array_equal(samples.field, FIELD * 1e3)
    np.testing.assert_array_equal(samples.time, np.arange(5) / 50)
    assert samples.temperature[0] == 21
    assert [stream.name for stream in open_log(path).streams] == ["picture"]


def test_three_arrays_and_a_sampling_rate(archive):
    path = archive(mx=FIELD[:, 0], my=FIELD[:, 1], mz=FIELD[:, 2], fs=50.0)
    samples = read(path, unit="mG")
    np.testing.assert_array_equal(samples.field, FIELD * 1e2)
    np.testing.assert_allclose(samples.time, np.arange(5) / 50)


def test_arrays_of_another_length_are_left_out(archive):
    samples = read(archive(mag=FIELD, acc_g=np.ones((9, 3)), t=np.arange(9.0)))
    assert (samples.acceleration, samples.time) == (None, None)
    assert len(samples) == 5


def test_pickled_objects_are_not_loaded(archive):
    path = archive(mag=np.array([{"x": 1}, None], dtype=object))
    with pytest.raises(LogError, match="allow_pickle"):
        read(path)


def test_what_is_no_log(archive):
    with pytest.raises(LogError, match=r"no magnetometer columns found among 'picture'"):
        open_log(archive(picture=np.eye(4)))
    with pytest.raises(LogError, match="more than 4096 arrays"):
        open_log(archive(**{f"a{i}": np.zeros(1) for i in range(4100)}))


def test_one_array_and_structured_arrays(tmp_path):
    field = np.random.default_rng(6).normal(0.0, 30.0, (40, 3))
    time = np.arange(40) * 0.02
    np.save(tmp_path / "mag_uT.npy", field)
    np.testing.assert_allclose(read(tmp_path / "mag_uT.npy").field, field * 1e3)
    np.save(tmp_path / "run7.npy", field)
    assert read(tmp_path / "run7.npy").unit == "raw"
    named = np.rec.fromarrays([time, *field.T], names="time_s,mag_x_uT,mag_y_uT,mag_z_uT")
    np.savez(tmp_path / "log.npz", data=named)
    samples = read(tmp_path / "log.npz")
    np.testing.assert_allclose(samples.field, field * 1e3)
    np.testing.assert_allclose(samples.time, time)
    cut = tmp_path / "cut.npy"
    cut.write_bytes((tmp_path / "mag_uT.npy").read_bytes()[:-100])
    with pytest.raises(LogError, match="damaged"):
        read(cut)
