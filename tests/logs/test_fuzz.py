"""Whatever a file holds, it is read or refused in one line: no other exception, no warning."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from agonic.errors import AgonicError
from agonic.exports.csv import write_csv
from agonic.logs.log import Log
from agonic.logs.read import open_log
from agonic.samples import Samples

CUTS, MUTATIONS = 8, 16  # make fuzz goes on for minutes
RECORDINGS = (
    "vehicle/ardupilot/center_0003.bin",
    "vehicle/px4/sample_log_small.ulg",
    "vehicle/fusion/sensor_data.csv",
    "vehicle/broad/34_disturbed_attached_magnet_3cm.mat",
    "orbit/iss_2021-04-16_all_photos_classified.csv",
    "orbit/swarmA_MAGA_LR_1B_20160101_10s.cdf",
    "orbit/swarmA_MAGA_LR_1B_20160101_10s.csv",
    "observatory/BOU20200101vsec.sec",
    "pointclouds/aleksandrbazhin_mag_out.txt",
)
NANS = "t,mag_x_nT,mag_y_nT,mag_z_nT\n" + "nan,nan,nan,nan\n" * 50
TEXTS = {
    "only a header": b"time_s,mag_x_nT,mag_y_nT,mag_z_nT",
    "only blank lines": b"\n\r\n \t\n",
    "only comments": b"# a\n% b\n",
    "nan everywhere": NANS.encode(),
    "inf everywhere": NANS.replace("nan,", "inf,").encode(),
    "numbers too large": NANS.replace("nan", "1e999").encode(),
    "times without end": b"t,mx,my,mz\n1e300,1,2,3\n-1e300,1,2,3\n1e18,1,2,3\n",
    "an epoch without end": b"time_s,mx,my,mz,epoch_unix_s\n1,1,2,3,1e300\n2,1,2,3,1e300\n",
    "years without end": b"time,mx,my,mz\n9999-12-31T23:59:59-20:00,1,2,3\n",
    "ragged": b"t,mx,my,mz\n1,2\n3,4,5,6,7,8\n,,,,,\n9\n1,2,3,4\n",
    "more columns than rows": b"1,2,3,4,5\n",
    "an open quote": b't,mx,my,mz\n1,"2,3,4\n2,3,4,5\n' * 9,
    "a long quoted cell": b't,mx,my,mz\n1,"' + b"x" * 200_000 + b'",3,4\n1,2,3,4\n',
    "separators only": b",,,,\n;;;;\n",
    "not utf-8": b"t,mag_x_\xb5T,mag_y_\xff,mag_z\n1,2,3,4\n\xe9,\xfe,1,2\n",
    "half utf-16": b"\xff\xfet\x00,\x00m",
    "utf-16 noise": b"\xfe\xff" + bytes(range(256)),
    "other digits": "t,mx,my,mz\n١,٢,٣,٤\n1_0,2,3,4\n".encode(),
    "a huge single line": b"1 2 3 " * 500_000,
    "a million columns": b"a," * 10**6,
    "prose": b"Dear reader,\nthere is nothing here.\n",
    "motioncal garbage": b"Raw:\nRaw:1,2\nRaw:a,b,c,d,e,f,g,h,i\n",
    "a sensor for every row": b"sensor,mx,my,mz\n" + b"".join(b"%d,1,2,3\n" % i for i in range(99)),
    "only an accelerometer": b"sensor,x,y,z\naccelerometer,1,2,3\n",
    "one byte": b"\x00",
    "deep header": b"raw" * 30 + b",mx,my,mz\n1,2,3,4\n",
}
MAGICS = {
    "dataflash": b"\xa3\x95\x80",
    "ulog": b"ULog\x01\x12\x35\x01",
    "matlab 5": b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM",
    "matlab 7.3": b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n",
    "npz": b"PK\x03\x04".ljust(26, b"\0") + b"\x07\0\0\0mag.npy",
    "parquet": b"PAR1",
    "cdf": bytes.fromhex("cdf300010000ffff"),
    "compressed cdf": bytes.fromhex("cdf30001cccc0001"),
    "old cdf": bytes.fromhex("cdf260020000ffff"),
    "netcdf 3": b"CDF\x01",
    "hdf5": b"\x89HDF\r\n\x1a\n",
    "iaga-2002": b" Format                 IAGA-2002                                    |\n",
    "vires": b"Timestamp,B_NEC\n2016-01-01T00:28:00Z,{1;2;3}\n",
    "utf-8": b"\xef\xbb\xbf",
}


def outcome(path: Path) -> Log | str:
    """The log, or why there is none."""
    try:
        return open_log(path)
    except AgonicError as error:
        return str(error)


def assert_read_or_refused(path: Path) -> None:
    result = outcome(path)
    if isinstance(result, str):
        assert result.strip()
        assert "\n" not in result
        return
    assert result.sensors
    for samples in result.sensors:
        assert len(samples) > 0
        assert all(np.isfinite(column).all() for column in samples.columns().values())


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with a few changed, or a piece removed or repeated."""
    changed = np.frombuffer(data, np.uint8).copy()
    start, stop = np.sort(rng.integers(0, len(data), 2))
    match rng.integers(3):
        case 0:
            where = rng.integers(0, len(data), 1 + len(data) // 20_000)
            changed[where] = rng.integers(0, 256, len(where))
            return changed.tobytes()
        case 1:
            return data[:start] + data[stop:]
        case _:
            return data[:stop] + data[start:]


def assert_damage_is_handled(data: bytes, path: Path) -> None:
    rng = np.random.default_rng(len(data))
    for cut in rng.integers(1, len(data), CUTS):
        path.write_bytes(data[:cut])
        assert_read_or_refused(path)
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(data, rng))
        assert_read_or_refused(path)


@pytest.mark.parametrize("content", TEXTS.values(), ids=TEXTS.keys())
def test_odd_texts(tmp_path, content):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    assert_read_or_refused(path)


@pytest.mark.parametrize("length", [1, 7, 100, 5000])
def test_noise(tmp_path, length):
    rng = np.random.default_rng(length)
    for _ in range(10):
        path = tmp_path / "log.bin"
        path.write_bytes(rng.bytes(length))
        assert_read_or_refused(path)


@pytest.mark.parametrize("magic", MAGICS.values(), ids=MAGICS.keys())
def test_a_right_start_with_noise_behind(tmp_path, magic):
    rng = np.random.default_rng(1)
    path = tmp_path / "log.bin"
    for length in (0, 1, 8, 100, 5000):
        path.write_bytes(magic + rng.bytes(length))
        assert_read_or_refused(path)


def _written(kind: str, path: Path) -> None:
    rng = np.random.default_rng(0)
    field, time = rng.normal(0, 3e4, (300, 3)), np.arange(300) / 50
    if kind == "csv":
        write_csv(Samples(field=field, time=time), path)
    elif kind == "npz":
        with path.open("wb") as stream:
            np.savez_compressed(stream, mag_nT=field, t=time)
    elif kind == "mat":
        savemat(path, {"mag": field, "imu": {"acc": field, "t": time}}, do_compression=True)
    elif kind == "hdf":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w", userblock_size=512) as file:
            file["mag"] = field.T
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")
    else:
        pq, pa = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow")
        columns = {f"mag_{a}": field[:, k] for k, a in enumerate("xyz")}
        pq.write_table(pa.table({"time_s": time, "sensor": ["a"] * 300, **columns}), path)


@pytest.mark.parametrize("kind", ["csv", "npz", "mat", "hdf", "parquet"])
def test_damaged_tables(tmp_path, kind):
    path = tmp_path / "log"
    _written(kind, path)
    assert open_log(path).sensors[0].field.shape == (300, 3)
    assert_damage_is_handled(path.read_bytes(), path)


@pytest.mark.recordings
@pytest.mark.parametrize("name", RECORDINGS)
def test_damaged_recordings(recordings, tmp_path, name):
    data = (recordings / name).read_bytes()
    assert_damage_is_handled(data[: 300_000 + len(data) // 10], tmp_path / "log")
