"""Reading logs beside the libraries that read them too: python -m benchmarks.readers [--quick].

Every rival is asked for the same columns of the same file; what it gives is not yet a recording of
a magnetometer in nT with times that increase, which is what agonic gives.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.logs.dataflash_writer import dataflash, parameters
from tests.logs.tlog_writer import heartbeat, tlog
from tests.logs.ulog_writer import ulog

import agonic as ag
from benchmarks import facts, tables
from benchmarks.timing import Pair, measure

Array = NDArray[np.float64]

NAMES = ("time_s", "mag_x_nT", "mag_y_nT", "mag_z_nT")
INTRODUCTION = """Processor time of whole calls, the best of {rounds} rounds in which agonic and the
other library take turns (of what takes over two seconds, of one). agonic checks, scales and hashes
the file; the others give columns. Over: agonic's time over the other's."""


class File(NamedTuple):
    """A kind of log: how one of so many readings is written, and who else reads it."""

    kind: str
    suffix: str
    write: Callable[[Path, int], None]
    rivals: dict[str, Callable[[Path], Any]]
    rows: int


def readings(n: int) -> Array:
    """Times and axes (n, 4) of a sensor that is turned, nT to the tenth."""
    rng = np.random.default_rng(0)
    field = rng.standard_normal((n, 3))
    field *= 50_000.0 / np.linalg.norm(field, axis=1, keepdims=True)
    return np.column_stack([np.arange(n) / 100.0, np.round(field, 1)])


# --- files -------------------------------------------------------------------------------------


def write_csv(path: Path, n: int) -> None:
    """Times to the millisecond and axes to the tenth of a nT."""
    form = ("%.3f", "%.1f", "%.1f", "%.1f")
    np.savetxt(path, readings(n), form, delimiter=",", header=",".join(NAMES), comments="")


def write_parquet(path: Path, n: int) -> None:
    import pyarrow as pa
    from pyarrow.parquet import write_table

    write_table(pa.table(dict(zip(NAMES, readings(n).T, strict=True))), path, compression="zstd")


def write_mat(path: Path, n: int) -> None:
    """MATLAB 7.3: HDF5 behind a block of text."""
    import h5py

    columns = readings(n)
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"], file["mag_nT"] = columns[:, :1].T, columns[:, 1:].T
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


def write_dataflash(path: Path, n: int) -> None:
    """Compass at 50 Hz, motion at 200, attitude at 50, place at 5."""
    rng = np.random.default_rng(0)
    t = {rate: 1e6 + np.arange(n * rate // 50) * 1e6 / rate for rate in (5, 50, 200)}
    field = {f"Mag{axis}": rng.integers(-600, 600, len(t[50])) for axis in "XYZ"}
    path.write_bytes(
        dataflash(
            parameters({"COMPASS_OFS_X": 10.5, "COMPASS_DIA_X": 1.0}),
            ("MAG", {"TimeUS": t[50], "Health": 1, "OfsX": 10, **field}),
            ("IMU", {"TimeUS": t[200], "AccZ": rng.normal(-9.81, 0.1, len(t[200]))}),
            ("ATT", {"TimeUS": t[50], "Yaw": rng.uniform(0, 360, len(t[50]))}),
            ("GPS", {"TimeUS": t[5], "Status": 3, "GWk": 2300, "Lat": 47.0, "Lng": 8.0}),
        )
    )


def write_tlog(path: Path, n: int) -> None:
    """A compass, attitude beside it, and a heartbeat now and then."""
    mag = (readings(n)[:, 1:] / 100.0).astype(int)  # milligauss
    sent = []
    for k, (x, y, z) in enumerate(mag.tolist()):
        at, clock = 0.02 * k, {"time_boot_ms": 20 * k}
        if k % 50 == 0:
            sent.append((at, *heartbeat(3)))
        sent.append((at, "SCALED_IMU2", {**clock, "xmag": x, "ymag": y, "zmag": z}))
        sent.append((at, "ATTITUDE", {**clock, "yaw": 0.001 * (k % 3000)}))
    path.write_bytes(tlog(sent))


def write_ulog(path: Path, n: int) -> None:
    """A magnetometer at 100 Hz beside a gyro and an accelerometer."""
    time, *axes = readings(n).T
    stamps = (time * 1e6 + 1e6).astype("<u8")
    mag = {name: (axis / 1e5).astype("<f4") for name, axis in zip("xyz", axes, strict=True)}
    motion = {"timestamp": stamps}
    for name in ("gyro_rad", "accelerometer_m_s2"):
        motion[name] = np.column_stack(axes).astype("<f4") / 5000
    device = np.full(n, 396825, "<u4")
    path.write_bytes(
        ulog(
            {
                "sensor_mag[0]": {"timestamp": stamps, "device_id": device, **mag},
                "sensor_combined[0]": motion,
            }
        )
    )


# --- who else reads them -----------------------------------------------------------------------


def with_numpy(path: Path) -> Array:
    return np.loadtxt(path, delimiter=",", skiprows=1)


def with_pyarrow_csv(path: Path) -> Any:
    from pyarrow import csv

    return [column.to_numpy() for column in csv.read_csv(path)]


def with_pyarrow(path: Path) -> Any:
    from pyarrow.parquet import read_table

    return [column.to_numpy() for column in read_table(path)]


def with_h5py(path: Path) -> list[Array]:
    import h5py

    with h5py.File(path) as file:
        return [file[name][()] for name in ("time", "mag_nT")]


def with_dfreader(path: Path) -> int:
    """pymavlink's reader of dataflash logs; the same types of messages, one by one."""
    from pymavlink.DFReader import DFReader_binary

    from agonic.logs.ardupilot.dataflash import WANTED

    reader, rows = DFReader_binary(str(path), zero_time_base=True), 0
    while (message := reader.recv_match(type=list(WANTED))) is not None:
        rows += message.get_type().startswith("MAG")
    reader.close()
    return rows


def with_mavutil(path: Path) -> int:
    """pymavlink's reader of telemetry; the same types of messages, one by one."""
    from pymavlink import mavutil

    link, rows = mavutil.mavlink_connection(str(path)), 0
    while (message := link.recv_match(type=["SCALED_IMU2", "ATTITUDE", "HEARTBEAT"])) is not None:
        rows += message.get_type().startswith("SCALED")
    link.close()
    return rows


def with_pyulog(path: Path) -> Any:
    from pyulog import ULog

    return ULog(str(path), ["sensor_mag", "sensor_combined"]).data_list


FILES = (
    File("CSV, four columns", ".csv", write_csv, {"numpy": with_numpy}, 1_000_000),
    File("CSV, four columns", ".csv", write_csv, {"pyarrow": with_pyarrow_csv}, 1_000_000),
    File("Parquet, four columns", ".parquet", write_parquet, {"pyarrow": with_pyarrow}, 1_000_000),
    File("MATLAB 7.3, four columns", ".mat", write_mat, {"h5py": with_h5py}, 1_500_000),
    File("ArduPilot dataflash", ".bin", write_dataflash, {"pymavlink": with_dfreader}, 80_000),
    File("ArduPilot telemetry", ".tlog", write_tlog, {"pymavlink": with_mavutil}, 100_000),
    File("PX4 ULog", ".ulg", write_ulog, {"pyulog": with_pyulog}, 600_000),
)


def read_pairs(folder: Path, share: float) -> list[tuple[Pair, int]]:
    """Each kind of file, of a share of the usual readings, beside each rival; its bytes."""
    pairs = []
    for file in FILES:
        n = round(file.rows * share)
        path = folder / f"{file.suffix[1:]}{n}{file.suffix}"
        if not path.exists():
            file.write(path, n)
        for rival, read in file.rivals.items():
            name = f"{file.kind}, {n:,} readings".replace(",", " ").replace("  ", ", ")
            pair = Pair(name, partial(ag.read, path), rival, partial(read, path))
            pairs.append((pair, path.stat().st_size))
    return pairs


def main() -> None:
    """Print the table."""
    asked = tables.arguments("reading logs", draws=3)
    warnings.simplefilter("ignore")
    rows = []
    with TemporaryDirectory() as folder:
        for pair, size in read_pairs(Path(folder), 0.05 if asked.quick else 1.0):
            tables.progress(f"readers: {pair.name} beside {pair.rival}")
            spent = measure(pair, asked.draws)
            rows.append(
                (
                    pair.name,
                    f"{size / 1e6:.1f}",
                    f"{spent.ours:.3f}",
                    facts.name_version(pair.rival),
                    f"{spent.theirs:.3f}",
                    f"{spent.ratio:.3g}",
                )
            )
    print(INTRODUCTION.format(rounds=asked.draws) + "\n")
    print(tables.markdown(("log", "MB", "agonic, s", "beside", "its time, s", "over"), rows))


if __name__ == "__main__":
    main()
