"""Which files are logs, and who their sensors are."""

from pathlib import Path

import pytest

from agonic.errors import AgonicError
from agonic.fleet.inputs import find_inputs, name_sensors
from agonic.fleet.settings import FleetSettings
from agonic.population import Row
from tests.fleet.boards import run_here, write_boards


def names(*inputs: Path | str) -> list[str]:
    return [Path(log).name for log in find_inputs(inputs).logs]


def test_folders_are_searched_for_what_a_reader_knows(tmp_path: Path) -> None:
    write_boards(tmp_path / "a" / "b", 1)
    (tmp_path / "a" / "picture").write_bytes(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "a" / "page.html").write_text("<html>")
    (tmp_path / "a" / "notes.txt").write_text("Tuesday: board 7 fell off the bench\n")
    (tmp_path / "a" / "table.dat").write_text("1 2 3\n4 5 6\n7 8 1\n")
    (tmp_path / "a" / "broken.ulg").write_bytes(b"")
    (tmp_path / "a" / ".hidden.csv").write_text("1,2,3\n")
    done = run_here(tmp_path / "a", out=tmp_path / "out")
    rows = [Path(row.source).name for row in done.population]
    assert rows == ["board000.csv", "broken.ulg", "table.dat"]
    assert (done.logs, done.skipped) == (3, 3)
    # a second run is told the same
    again = run_here(tmp_path / "a", out=tmp_path / "out")
    assert (again.logs, again.skipped, again.resumed) == (3, 3, 3)
    # what is named is a row, whatever it is
    named = run_here(tmp_path / "a" / "notes.txt", out=tmp_path / "named")
    assert named.population["verdict"].tolist() == ["refused"]


def test_a_pattern_finds_what_it_matches_and_a_log_named_twice_counts_once(tmp_path: Path) -> None:
    write_boards(tmp_path, 3)
    assert names(tmp_path / "board00[01].csv") == ["board000.csv", "board001.csv"]
    assert names(tmp_path, tmp_path / "*.csv", tmp_path / "." / "board002.csv") == [
        "board000.csv",
        "board001.csv",
        "board002.csv",
    ]
    assert names(str(tmp_path / "**" / "*2.csv")) == ["board002.csv"]


def test_results_beside_the_logs_are_no_logs(tmp_path: Path) -> None:
    write_boards(tmp_path, 2)
    settings = FleetSettings(files=True)
    first = run_here(tmp_path, out=tmp_path, settings=settings)
    again = run_here(tmp_path, out=tmp_path, settings=settings)
    assert (again.logs, again.resumed, again.skipped) == (2, 2, first.skipped)


@pytest.mark.parametrize("name", ["nowhere", "nowhere/*.csv", "empty"])
def test_what_names_nothing_is_an_error(tmp_path: Path, name: str, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(AgonicError, match=r"no such file|no file matches|no log"):
        find_inputs([name])


def row(channel: str, device_id: int | None = None) -> Row:
    return Row(
        sensor="", source="", channel=channel, device_id=device_id, verdict="good", status=""
    )


@pytest.mark.parametrize(
    ("rows", "pattern", "expected"),
    [
        ([row("mag")], None, ["log"]),
        ([row("mag", 97539)], None, ["97539"]),
        ([row("MAG"), row("MAG2")], None, ["log MAG", "log MAG2"]),
        ([row("MAG", 5), row("MAG2", 6), row("MAG3")], None, ["5", "6", "log MAG3"]),
        ([row("MAG", 5), row("MAG2", 5)], None, ["log MAG", "log MAG2"]),  # not who is who
        ([row("mag", 97539)], r"SN(\d+)", ["31"]),
        ([row("MAG", 5), row("MAG2", 6)], r"SN\d+", ["SN31 MAG", "SN31 MAG2"]),
        ([row("mag")], r"(x)?/(?P<sensor>\w+)/", ["SN31"]),
        ([row("mag", 97539)], r"ABC(\d+)", ["97539"]),  # no match
    ],
)
def test_who_the_sensors_are(rows: list[Row], pattern: str | None, expected: list[str]) -> None:
    known = name_sensors("fleet/SN31/log.ulg", rows, pattern)
    assert [one.sensor for one in known] == expected
    assert {one.source for one in known} == {"fleet/SN31/log.ulg"}
