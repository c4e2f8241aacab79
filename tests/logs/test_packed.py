"""Compressed recordings are read as they are, damaged ones as far as they go."""

import bz2
import gzip
import hashlib
import lzma

import pytest

from agonic.errors import LogError
from agonic.logs.read import accepts, open_log

TABLE = b"time_s,mag_x_uT,mag_y_uT,mag_z_uT\n" + b"".join(
    b"%d,20,%d,43\n" % (i, i % 97) for i in range(5000)
)


def pack_zstd(data: bytes) -> bytes:
    return pytest.importorskip("pyarrow").compress(data, codec="zstd", asbytes=True)


@pytest.mark.parametrize(
    ("ending", "pack"),
    [("gz", gzip.compress), ("bz2", bz2.compress), ("xz", lzma.compress), ("zst", pack_zstd)],
)
def test_a_packed_table(tmp_path, ending, pack):
    path = tmp_path / f"log.csv.{ending}"
    path.write_bytes(pack(TABLE))
    log = open_log(path)
    assert accepts(path)
    assert (log.path, log.source.name, len(log.sensors[0])) == (path, path.name, 5000)
    assert log.source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    path.with_name(path.name + ".toml").write_text('[columns]\nx = "mag_y_uT"\n')
    assert log.sensors[0].field[3, 1] == 3000.0
    with pytest.raises(LogError, match=r"no magnetometer|of x, y and z"):
        open_log(path)  # the names beside it hold


def test_a_packed_file_that_ends_early(tmp_path):
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(TABLE)[:-3000])
    log = open_log(path)
    assert 1000 < len(log.sensors[0]) < 5000
    assert "the compressed file is damaged after" in log.notes[0]


def test_what_is_packed_is_named(tmp_path):
    path = tmp_path / "log.gz"
    for content, said in ((b"", "the file is empty"), (bytes(range(256)) * 9, "binary data")):
        path.write_bytes(gzip.compress(content))
        assert not accepts(path)
        with pytest.raises(LogError, match=said) as caught:
            open_log(path)
        assert str(caught.value).startswith(str(path))
    path.write_bytes(b"\x1f\x8b\x08" + bytes(99))
    with pytest.raises(LogError, match="cannot be unpacked"):
        open_log(path)
