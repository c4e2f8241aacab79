"""Files that are damaged or made to harm: one line each, at once, in little memory."""

from __future__ import annotations

import io
import os
import resource
import sqlite3
import struct
import zipfile
import zlib
from contextlib import closing, suppress

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from agonic.errors import LogError
from agonic.logs import child_process
from agonic.logs.arrays.stored import read_version_5
from agonic.logs.read import open_log, read
from tests.logs.damage import damaged
from tests.logs.workbook_writer import write_xlsx

FIELD = np.arange(300.0).reshape(100, 3) % 17 + [20.0, 1.0, 43.0]


@pytest.fixture(autouse=True)
def little_memory():
    """No test here may take more than a gigabyte beyond what it has."""
    with open("/proc/self/statm") as stream:
        used = int(stream.read().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + 1_000_000_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


@pytest.mark.parametrize("compressed", [False, True])
def test_reads_matlab_5_as_scipy_does(tmp_path, compressed):
    rng = np.random.default_rng(1)
    given = {kind: rng.integers(0, 100, (7, 3)).astype(kind) for kind in "bBhHiIlLfd"}
    given |= {
        "small": np.int16([[3]]),
        "cube": rng.normal(size=(2, 3, 4)),
        "flag": np.array([True]),
    }
    given |= {"imu": {"mag": FIELD, "inner": {"gyr": FIELD[:, 0]}, "note": "text"}, "text": "words"}
    path = tmp_path / "log.mat"
    savemat(path, {f"v_{key}": value for key, value in given.items()}, do_compression=compressed)
    ours, theirs = read_version_5(path), loadmat(path, simplify_cells=True)
    for name, value in ours.items():
        if isinstance(value, dict):
            np.testing.assert_array_equal(value["mag"], FIELD)
            np.testing.assert_array_equal(value["inner"]["gyr"], FIELD[:, 0])
            assert value["note"] == "text"
        else:
            np.testing.assert_array_equal(value, theirs[name])
            kind = np.asarray(value).dtype.kind
            assert kind == np.asarray(theirs[name]).dtype.kind or name == "v_flag"
    assert set(ours) == {f"v_{key}" for key in given}


def test_no_damage_to_a_matlab_file_is_more_than_one_line(tmp_path):
    path = tmp_path / "log.mat"
    for compressed in (False, True):
        savemat(path, {"imu": {"mag_uT": FIELD}, "t": np.arange(100.0)}, do_compression=compressed)
        whole = np.fromfile(path, np.uint8)
        rng = np.random.default_rng(3)
        for turn in range(300):
            if turn % 2:
                changed = whole.copy()
                changed[rng.integers(0, min(len(whole), 600))] = rng.integers(0, 256)
            else:
                changed = damaged(whole, rng)
            changed.tofile(path)
            with suppress(LogError):
                open_log(path)


@pytest.fixture
def small_child(monkeypatch):
    """A child process that may take 300 MB."""
    child = child_process.Child(most_memory=300_000_000)
    monkeypatch.setattr(child_process, "_child", child)
    yield
    child.close()


@pytest.mark.slow
def test_a_matlab_bomb(tmp_path, small_child):
    path = tmp_path / "bomb.mat"
    count = 50_000_000
    flags, name = element(6, struct.pack("<II", 6, 0)), element(1, b"mag")
    head = flags + element(5, struct.pack("<ii", count, 1)) + name
    head += struct.pack("<II", 9, 8 * count)
    machine = zlib.compressobj(1)
    zeros = machine.compress(struct.pack("<II", 14, len(head) + 8 * count) + head)
    zeros += b"".join(machine.compress(bytes(8_000_000)) for _ in range(50)) + machine.flush()
    begin = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"
    path.write_bytes(begin + struct.pack("<II", 15, len(zeros)) + zeros)
    with pytest.raises(LogError, match="memory"):
        open_log(path)
    huge = flags + element(5, struct.pack("<ii", 2**31 - 1, 2**31 - 1)) + name
    path.write_bytes(begin + element(14, huge + element(9, bytes(80))))
    with pytest.raises(LogError, match="damaged"):
        open_log(path)


@pytest.mark.slow
def test_numpy_bombs(tmp_path, small_child):
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, mag_uT=np.zeros((20_000_000, 3)))
    with pytest.raises(LogError, match="memory"):
        open_log(path)
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        stream, {"descr": "<f8", "fortran_order": False, "shape": (10**11, 3)}
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mag_uT.npy", stream.getvalue() + bytes(24))
    with pytest.raises(LogError, match="damaged"):
        open_log(path)


@pytest.fixture(params=["mat", "nc"])
def hdf5(request, tmp_path):
    """Makes a file of HDF5, with good readings, that another function adds to."""
    h5py = pytest.importorskip("h5py")

    def make(change):
        path = tmp_path / f"log.{request.param}"
        block = 512 if request.param == "mat" else 0
        with h5py.File(path, "w", userblock_size=block) as file:
            for k, axis in enumerate("xyz"):
                file[f"mag_{axis}_uT"] = FIELD[:, k]
            change(h5py, file)
        if block:
            with path.open("r+b") as stream:
                stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
        return path

    return make


def check_left_out(path, column, why):
    """A netCDF file is read without the column; a MATLAB file is refused for it."""
    if path.suffix == ".mat":
        with pytest.raises(LogError, match=why):
            read(path)
    else:
        assert getattr(read(path), column) is None
        assert any(why in note for note in open_log(path).notes)


def test_links_out_of_a_file_and_around_are_not_followed(hdf5, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "secret").write_bytes(bytes(800))

    def change(h5py, file):
        file["heading_deg"] = h5py.ExternalLink(str(tmp_path / "pipe"), "/x")
        file["other"] = h5py.SoftLink("/other")
        group = file.create_group("group")
        group["again"] = group
        group["root"] = file["/"]

    np.testing.assert_allclose(read(hdf5(change)).field, FIELD * 1e3)


def test_values_in_another_file_are_not_read(hdf5, tmp_path):
    (tmp_path / "secret").write_bytes(bytes(800))

    def change(h5py, file):
        kept = [(str(tmp_path / "secret"), 0, 800)]
        file.create_dataset("temperature_C", (100,), "f8", external=kept)

    check_left_out(hdf5(change), "temperature", "another file")


def test_sparse_chunks_take_no_memory(hdf5):
    def change(h5py, file):
        file.create_dataset("current_A", (10**9,), "f8", chunks=(1000,))
        file.create_dataset("throttle", (10**8, 4), "f8", chunks=(1000, 4), compression="gzip")

    path = hdf5(change)
    assert path.stat().st_size < 20_000
    check_left_out(path, "current_A", "declares")


def test_long_attributes_take_no_time(hdf5):
    def change(h5py, file):
        for name in ("units", "missing_value"):
            file["mag_x_uT"].attrs[name] = " " * 60_000
        file["time"] = np.arange(100.0)
        file["time"].attrs["units"] = "s since " + " " * 60_000 + "x"

    np.testing.assert_allclose(read(hdf5(change)).field, FIELD * 1e3)


@pytest.mark.parametrize("stream", [False, True])
def test_arrow_bombs(tmp_path, stream):
    """What packed buffers declare is not given beyond the limit of memory; a batch of nothing."""
    pa = pytest.importorskip("pyarrow")
    path = tmp_path / "bomb.arrow"

    def write(columns, packing=None):
        table = pa.table(columns)
        options = pa.ipc.IpcWriteOptions(compression=packing)
        make = pa.ipc.new_stream if stream else pa.ipc.new_file
        with pa.OSFile(str(path), "wb") as sink, make(sink, table.schema, options=options) as to:
            to.write_table(table)

    good = {f"mag_{axis}_uT": FIELD[:, k] for k, axis in enumerate("xyz")}
    kind = {"sensor": pa.array(["a"] * 100).dictionary_encode()}
    for packing in (None, "lz4", "zstd"):
        write(good | kind, packing)
        np.testing.assert_allclose(read(path).field, FIELD * 1e3)
    data, true = path.read_bytes(), struct.pack("<q", 800)
    assert data.count(true) >= 3
    for false in (2**40, 2**62):
        path.write_bytes(data.replace(true, struct.pack("<q", false)))
        with pytest.raises(LogError, match=r"(more than 4 GB of memory.*|^[^ ]* )damaged"):
            open_log(path)
    write(dict.fromkeys(good, pa.nulls(10**9)))
    with pytest.raises(LogError):
        open_log(path)


def test_a_database_with_blobs_and_endless_texts(tmp_path):
    """What is no reading is a gap and is not loaded, be it larger than memory."""
    path = tmp_path / "log.db"
    with closing(sqlite3.connect(path)) as base:
        base.execute("CREATE TABLE mag (time_s, mag_x_uT, mag_y_uT, mag_z_uT, temperature_C)")
        rows = [(k / 50, *row, 20.0) for k, row in enumerate(FIELD.tolist())]
        base.executemany("INSERT INTO mag VALUES (?,?,?,?,?)", rows)
        blob, text = "zeroblob(90000000)", "hex(zeroblob(1000000))"
        base.execute(f"UPDATE mag SET temperature_C = {blob} WHERE time_s BETWEEN 0.1 AND 0.15")
        base.execute(f"UPDATE mag SET mag_x_uT = {text} WHERE time_s BETWEEN 1 AND 1.05")
        base.commit()
    field = read(path).field
    assert 90 <= len(field) < 100
    assert set(field[:, 0]) <= set(FIELD[:, 0] * 1e3)


def test_a_sheet_that_is_listed_many_times_is_read_once(tmp_path):
    path = write_xlsx(
        tmp_path / "log.xlsx", {"a": [["mag_x_uT", "mag_y_uT", "mag_z_uT"], *FIELD.tolist()]}
    )
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    again = b"".join(b'<sheet name="s%d" sheetId="%d" r:id="rId1"/>' % (k, k) for k in range(2, 60))
    parts["xl/workbook.xml"] = parts["xl/workbook.xml"].replace(b"</sheets>", again + b"</sheets>")
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    assert [samples.name for samples in open_log(path).sensors] == ["mag"]


def test_a_text_that_unpacks_to_more_than_memory(tmp_path, monkeypatch):
    """What was given and what to do is told; the limit is that of a process of its own."""
    path = tmp_path / "log.zip"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("log.csv", "w") as stream,
    ):
        stream.write(b"mag_x_nT,mag_y_nT,mag_z_nT\n")
        for _ in range(40):
            stream.write(b"1,2,3\n" * 100_000)
    monkeypatch.setattr(child_process, "_child", child_process.Child(most_memory=200_000_000))
    with pytest.raises(LogError, match=r"4 GB of memory.*: damaged, or too long; .*cut it"):
        open_log(path)
    monkeypatch.undo()
    assert child_process.call(len, "next") == 4


def test_a_long_text_is_what_a_short_one_is(tmp_path, monkeypatch):
    """Names that were given, notes and all columns come from the process that reads it."""
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([np.arange(100), FIELD]), delimiter=",", header="t,a,b,c",
               comments="")  # fmt: skip
    names = "time_s=t,x=a,y=b,z=c"
    short = open_log(path, unit="uT", columns=names)
    monkeypatch.setattr("agonic.logs.read.LONG_TEXT", 0)
    long = open_log(path, unit="uT", columns=names)
    assert (long.notes, long.source, long.path) == (short.notes, short.source, short.path)
    assert long.sensors[0].notes == short.sensors[0].notes
    for name, column in short.sensors[0].columns().items():
        np.testing.assert_array_equal(long.sensors[0].columns()[name], column)
