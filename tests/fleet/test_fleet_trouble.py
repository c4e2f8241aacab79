"""Names, files and journals that a fleet meets in the field."""

import os
import socket
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from agonic.errors import AgonicError
from agonic.fleet.engine import Dask
from agonic.fleet.inputs import JOURNAL, find_inputs
from agonic.fleet.journal import Journal
from agonic.fleet.settings import FleetSettings
from agonic.population.store import History
from agonic.population.table import read_population
from tests.fleet.boards import run_here, write_boards


def write_table(path: Path, sensors: list[str], **more: list[str]) -> None:
    draw = np.random.default_rng(len(path.name))
    path.parent.mkdir(exist_ok=True)
    names = np.tile(sensors, 300)
    way = draw.normal(size=(len(names), 3))
    field = 50_000 * way / np.linalg.norm(way, axis=1, keepdims=True) + draw.normal(size=way.shape)
    columns = {f"mag_{axis}_nT": field[:, i] for i, axis in enumerate("xyz")}
    parquet.write_table(pa.table({"sensor": names, **more, **columns}), path)


@pytest.mark.skipif(os.name == "nt", reason="names there are Unicode")
def test_any_name_of_a_file_will_do(tmp_path: Path) -> None:
    write_boards(tmp_path, 3)
    names = [os.fsdecode(b"bad\xff.csv"), "a\n'b\".csv", "n" * 250 + ".csv"]
    for k, name in enumerate(names):
        os.rename(tmp_path / f"board{k:03}.csv", tmp_path / name)
    settings = FleetSettings(reports=True)
    done = run_here(tmp_path, out=tmp_path / "out", settings=settings)
    assert set(done.population["sensor"]) == {"bad\\udcff", "a\n'b\"", "n" * 250}
    assert all((tmp_path / "out" / row.report).is_file() for row in done.population)
    assert run_here(tmp_path, out=tmp_path / "out", settings=settings).resumed == 3


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes there")
@pytest.mark.parametrize("name", ["pipe.csv", "pipe.parquet"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    done = run_here(tmp_path / name, out=tmp_path / "out")
    assert "not a file" in done.population["status"][0]
    write_table(tmp_path / "a.parquet", ["s"])
    assert run_here(tmp_path, out=tmp_path / "out").datasets == 1


def test_results_are_no_part_of_a_dataset(tmp_path: Path) -> None:
    write_table(tmp_path / "in" / "a.parquet", ["s", "t"])
    out = tmp_path / "in" / "out"
    first = run_here(tmp_path / "in", out=out)
    (out / JOURNAL).unlink()
    again = run_here(tmp_path / "in", out=out)
    assert first.population["key"].tolist() == again.population["key"].tolist()


def test_a_journal_that_is_damaged_later_on_is_told_in_a_line(tmp_path: Path) -> None:
    write_boards(tmp_path / "in", 1)
    run_here(tmp_path / "in", out=tmp_path / "out")
    journal = tmp_path / "out" / JOURNAL
    content = bytearray(journal.read_bytes())
    content[4096:] = bytes(byte ^ 0x5A for byte in content[4096:])
    journal.write_bytes(content)
    with pytest.raises(AgonicError, match=r"journal.sqlite: .*delete it"):
        run_here(tmp_path / "in", out=tmp_path / "out")


def fill(path: Path) -> None:
    with Journal(path, work="w") as journal:
        journal._db.execute("pragma max_page_count = 9")
        journal._db.execute("insert into rows values ('w', 0, zeroblob(100000))")


def test_a_full_disk_is_told_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(AgonicError, match="make room"):
        fill(tmp_path / "journal")


def test_sensors_named_as_on_a_vehicle_are_of_logs(tmp_path: Path) -> None:
    for name in ("a.parquet", "b.parquet"):
        write_table(tmp_path / "in" / name, ["mag0", "MAG[1]"])
    assert len(find_inputs([tmp_path / "in"]).logs) == 2
    assert len(find_inputs([tmp_path / "in"], FleetSettings(sensor_column="sensor")).datasets) == 1
    write_table(tmp_path / "in" / "b.parquet", ["mag0", "mag17"])
    assert len(find_inputs([tmp_path / "in"]).datasets) == 1


def test_two_columns_of_sensors_are_asked_about(tmp_path: Path) -> None:
    write_table(tmp_path / "a.parquet", ["s"], device=["d"] * 300)
    with pytest.raises(AgonicError, match="say which"):
        find_inputs([tmp_path])


def test_one_magnetometer_of_a_dataset_can_be_taken(tmp_path: Path) -> None:
    write_table(tmp_path / "a.parquet", ["s"])
    for asked, verdict in (("mag", "good"), ("0", "good"), ("nope", "refused")):
        done = run_here(
            tmp_path / "a.parquet", out=tmp_path / "out", settings=FleetSettings(sensor=asked)
        )
        assert done.population["verdict"].tolist() == [verdict]


@pytest.mark.parametrize("wrong", [{"field_nT": -5.0}, {"date": "never"}])
def test_what_no_log_can_use_is_told_at_once(wrong: dict[str, object]) -> None:
    with pytest.raises(AgonicError):
        FleetSettings(**wrong)  # type: ignore[arg-type]


def test_nobody_at_an_address_is_told_within_seconds() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    for address in (f"tcp://127.0.0.1:{port}", "nonsense", "foo://x:1"):
        with pytest.raises(AgonicError, match="does not answer"):
            list(Dask(scheduler=address).run(abs, [1]))


def test_a_damaged_table_is_told_in_a_line(tmp_path: Path) -> None:
    write_boards(tmp_path / "in", 3)
    whole = run_here(tmp_path / "in", out=tmp_path / "out").table.read_bytes()
    draw, told = np.random.default_rng(2), 0
    for k in range(120):
        content = bytearray(whole[: None if k % 8 else int(draw.integers(len(whole)))])
        for at in draw.integers(max(len(content), 1), size=(1, 3, 20)[k % 3]):
            content[at : at + 1] = bytes([draw.integers(256)])
        (tmp_path / "x.parquet").write_bytes(content)
        try:
            read_population(tmp_path / "x.parquet")
        except AgonicError:
            told += 1
    assert told > 40


@pytest.mark.parametrize("kind", ["history", "journal"])
def test_a_damaged_database_is_told_in_a_line(kind: str, tmp_path: Path) -> None:
    write_boards(tmp_path / "in", 2)
    rows = run_here(tmp_path / "in", out=tmp_path / "out").population
    path = tmp_path / "out" / JOURNAL if kind == "journal" else tmp_path / "history"
    if kind == "history":
        with History.open(path) as history:
            history.add(rows)
    whole, draw, told = path.read_bytes(), np.random.default_rng(3), 0
    for k in range(30 if kind == "journal" else 150):
        content = bytearray(whole)
        for at in draw.integers(len(content), size=(1, 3, 20)[k % 3]):
            content[at] = draw.integers(256)
        path.write_bytes(content)
        try:
            if kind == "journal":
                run_here(tmp_path / "in", out=tmp_path / "out")
            else:
                with History.open(path) as history:
                    [history.of(one.sensor) for one in history.sensors()]
        except AgonicError:
            told += 1
    assert told > 3


def test_logs_that_ended_runs_are_rows_of_a_run_with_reports(tmp_path: Path) -> None:
    """A date of the year 9999, eleven rows with an axis at rest, a damaged MATLAB file."""
    scipy_io = pytest.importorskip("scipy.io")
    folder = tmp_path / "in"
    write_boards(folder, 1)
    rows = np.random.default_rng(2).normal(size=(400, 3)) * 30_000
    dated = [f"9999-12-31T00:{k // 60:02}:{k % 60:02}Z," for k in range(400)]
    lines = [when + ",".join(map(str, row)) for when, row in zip(dated, rows, strict=True)]
    head = "time,mag_x_nT,mag_y_nT,mag_z_nT\n"
    (folder / "late.csv").write_text(head + "\n".join(lines))
    still = np.column_stack([np.arange(11), rows[:11, :2], np.full(11, 100.0)])
    few = "\n".join(",".join(map(str, row)) for row in still)
    (folder / "few.csv").write_text(f"time_s,{head[5:]}{few}")
    scipy_io.savemat(folder / "bad.mat", {"mag_uT": rows / 1000}, do_compression=True)
    content = bytearray((folder / "bad.mat").read_bytes())
    content[150:170] = b"\xff" * 20
    (folder / "bad.mat").write_bytes(content)
    settings = FleetSettings(reports=True)
    for resumed in (0, 4):
        done = run_here(folder, out=tmp_path / "out", settings=settings)
        assert done.resumed == resumed
        verdicts = {Path(row.source).stem: row.verdict for row in done.population}
        assert set(verdicts) == {"board000", "late", "few", "bad"}
        assert verdicts["board000"] == "good"
        assert verdicts["few"] == verdicts["bad"] == "refused"
    assert (tmp_path / "out" / "report.html").is_file()
