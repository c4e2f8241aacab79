"""`agonic fleet` as a person or a script runs it."""

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agonic.cli import run
from agonic.fleet import run as fleet_run
from agonic.fleet.journal import Journal
from agonic.population import History, read_population
from tests.fleet.boards import write_bad, write_boards


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("command") / "logs"
    write_boards(folder, 6)
    write_bad(folder / "bad")
    return folder


pytestmark = pytest.mark.usefixtures("empty_folder")


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, Any]]:
    capsys.readouterr()
    status = run(["fleet", *arguments, "-o", "out", "--workers", "0", "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_counts_reasons_and_paths_are_told(logs: Path, capsys) -> None:
    status, said = answer(capsys, str(logs))
    assert said["schema"] == "agonic/fleet@1"
    population = read_population(said["table"])
    assert said["rows"] == said["logs"] == len(population) == 14
    counts = {word: population["verdict"].tolist().count(word) for word in said["verdicts"]}
    assert said["verdicts"] == counts
    assert counts["refused"] == 8
    assert sum(reason["rows"] for reason in said["reasons"]) == 14 - counts["good"]
    assert (said["calibrated"], said["resumed"]) == (14, 0)
    assert said["logs_per_second"] == pytest.approx(14 / said["seconds"])
    assert ": out</title>" in Path(said["page"]).read_text()
    assert status == 1
    status, again = answer(capsys, str(logs))
    assert (again["calibrated"], again["resumed"]) == (0, 14)
    assert again["verdicts"] == counts


@pytest.mark.slow
@pytest.mark.parametrize(("share", "status"), [("0.05", 1), ("0.5", 1), ("0.6", 0), ("1", 0)])
def test_the_status_is_by_the_share_without_calibration(logs, share, status, capsys) -> None:
    assert answer(capsys, str(logs), "--fail-above", share)[0] == status  # 8 of 14 are refused


def test_people_are_told_what_matters(logs: Path, capsys) -> None:
    assert run(["fleet", str(logs / "board*.csv"), "-o", "out", "--workers", "0"]) == 0
    said = capsys.readouterr().out
    assert "6 logs, 6 calibrations: " in said
    assert "6 made in" in said
    assert "out/fleet.parquet" in said
    assert "out/report.html" in said
    run(["fleet", str(logs), "-o", "out", "--workers", "0"])
    said = capsys.readouterr().out
    assert "6 were finished before" in said
    assert "Not good, because of" in said
    assert "3  other reasons" in said


@pytest.mark.parametrize(
    "arguments",
    [
        ["nowhere"],
        ["logs", "--engine", "spark"],
        ["logs", "--engine", "local", "--scheduler", "tcp://a:1"],
        ["logs", "--method", "guess"],
        ["logs", "--name", "("],
        ["logs", "--at", "everywhere"],
        ["logs", "--unit", "furlong"],
    ],
)
def test_bad_usage_is_one_line(logs: Path, arguments: list[str], capsys) -> None:
    given = [str(logs) if argument == "logs" else argument for argument in arguments]
    assert run(["fleet", *given, "-o", "out"]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert said.err.startswith("agonic: ")


INTERRUPTED = "agonic: interrupted; the same command goes on from where it was, with the same -o\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_while_the_journal_is_written(logs, number, capsys, monkeypatch) -> None:
    """Between two transactions there is nothing to keep."""

    def commit(journal: Journal) -> None:
        journal._db.execute("commit")
        signal.raise_signal(number)

    monkeypatch.setattr(Journal, "commit", commit)
    assert run(["fleet", str(logs), "-o", "cut", "--workers", "0"]) == 2
    assert capsys.readouterr().err == INTERRUPTED
    assert signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler)


@pytest.mark.parametrize("other", [None, ImportError("core failed to import")])
def test_an_interruption_that_a_library_loses(logs, other, capsys, monkeypatch) -> None:
    """Python drops what is raised while it cleans up, and some libraries make an error of it."""
    calibrate = fleet_run.calibrate_log

    def interrupted(*arguments: Any, **settings: Any) -> Any:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            if other:
                raise other from None
        return calibrate(*arguments, **settings)

    monkeypatch.setattr(fleet_run, "calibrate_log", interrupted)
    assert run(["fleet", str(logs), "-o", "cut", "--workers", "0"]) == 2
    assert capsys.readouterr().err == INTERRUPTED


def test_a_history_is_kept(logs: Path, capsys) -> None:
    for _ in range(2):
        answer(capsys, str(logs / "board*.csv"), "--store", "boards.sqlite")
    with History.open("boards.sqlite") as history:
        assert [kept.sensor for kept in history.sensors()] == [f"board{n:03}" for n in range(6)]
        assert {kept.calibrations for kept in history.sensors()} == {1}


@pytest.mark.parametrize("parted", [False, True])
def test_a_dataset_has_a_row_for_each_sensor(parted: bool, capsys) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    draw = np.random.default_rng(5)
    bias = draw.normal(size=(4, 3)) * 3000
    tables = []
    for sensor in range(4):
        way = draw.normal(size=(600, 3))
        field = 50_000 * way / np.linalg.norm(way, axis=1, keepdims=True)
        raw = field + bias[sensor] + draw.normal(size=field.shape) * 100
        columns = {f"mag_{axis}_nT": raw[:, i] for i, axis in enumerate("xyz")}
        tables.append(pa.table({"sensor": [f"s{sensor}"] * 600, **columns}))
    whole = pa.concat_tables(tables)
    Path("data").mkdir()
    if parted:
        parquet.write_to_dataset(whole, "data/all", partition_cols=["sensor"])
    else:
        parquet.write_table(whole, "data/all.parquet")
    write_boards(Path("data"), 1)
    _, said = answer(capsys, "data", "--field", "50000")
    assert (said["logs"], said["datasets"], said["rows"]) == (1, 1, 5)
    assert said["calibrated"] == 2
    rows = {row.sensor: row for row in read_population(said["table"])}
    for sensor in range(4):
        row = rows[f"s{sensor}"]
        found = np.array([row.bias_x, row.bias_y, row.bias_z])
        sd = np.array([row.bias_x_sd, row.bias_y_sd, row.bias_z_sd])
        assert np.all(np.abs(found - bias[sensor]) < 4.5 * sd)
    assert rows["board000"].verdict != "refused"
    before = Path(said["table"]).read_bytes()
    _, again = answer(capsys, "data", "--field", "50000")
    assert (again["calibrated"], again["resumed"]) == (0, 2)
    assert Path(again["table"]).read_bytes() == before


def test_a_long_table_is_read_piece_by_piece(capsys, monkeypatch) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    draw = np.random.default_rng(6)
    way = draw.normal(size=(20_000, 3))
    raw = 50_000 * way / np.linalg.norm(way, axis=1, keepdims=True) + [900.0, -400.0, 100.0]
    raw += draw.normal(size=raw.shape) * 100
    columns = {f"mag_{axis}_nT": raw[:, i] for i, axis in enumerate("xyz")}
    parquet.write_table(pa.table({"time_s": np.arange(20_000) * 0.02, **columns}), "long.parquet")
    monkeypatch.setattr("agonic.logs.large.mission.IN_MEMORY", 10_000)
    _, said = answer(capsys, "long.parquet", "--field", "50000")
    (row,) = read_population(said["table"])
    assert row.rows == 20_000
    errors = np.subtract([row.bias_x, row.bias_y, row.bias_z], [900.0, -400.0, 100.0])
    assert np.all(np.abs(errors) < 4.5 * np.array([row.bias_x_sd, row.bias_y_sd, row.bias_z_sd]))


def test_the_truth_of_a_simulated_fleet_is_no_log(capsys) -> None:
    assert run(["simulate", "fleet", "-o", "lab", "--sensors", "3", "--broken", "0"]) == 0
    Path("lab/board1.truth.csv").write_text("serial,bias_x\nA1,200\n")
    _, said = answer(capsys, "lab")
    logs = len(list(Path("lab/logs").iterdir()))
    assert (said["rows"], said["skipped"]) == (logs, 2)
    assert run(["info", "lab/truth.csv"]) == 2
    assert "the truth about a simulated fleet" in capsys.readouterr().err


@pytest.mark.parametrize(("sensor", "status"), [("good", 0), ("bad", 1)])
def test_any_refused_sensor_is_exit_status_1(logs, sensor, status, capsys) -> None:
    """One of many suffices, as the README says."""
    named = [str(logs / "board*.csv"), *([str(logs / "bad" / "short.csv")] * (sensor == "bad"))]
    assert run(["fleet", *named, "-o", "out", "--workers", "0"]) == status
