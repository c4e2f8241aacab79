"""The documents that agonic began with, made again by the runner of `agonic reproduce`."""

import json
import shlex
from pathlib import Path

import pytest
from msgspec.structs import replace

from agonic.cli import run
from agonic.errors import AgonicError
from agonic.reproduce.report import describe_reproduction, list_commands
from agonic.reproduce.run import (
    Item,
    Row,
    Source,
    find_numbers,
    load_documents,
    reproduce,
    with_own_data,
)

DOCUMENTS = load_documents()


def make_item(**given: object) -> Item:
    return Item(**{"at": "", "what": "", "page": "", "command": "", "key": ""} | given)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_number_is_made_and_misses_only_where_it_is_said_why(
    name: str, tmp_path: Path
) -> None:
    rows = reproduce(DOCUMENTS[name], tmp_path)
    assert [row.failed for row in rows if row.failed] == []
    told = {row.item.what for row in rows if row.item.missed}
    assert {row.item.what for row in rows if row.verdict == "missed"} == told
    made = describe_reproduction(DOCUMENTS[name], rows, tmp_path)
    drawn = [section for section in made.sections if ": " in section.title]
    assert len(drawn) == len(DOCUMENTS[name].figures)


def test_every_item_has_one_limit_of_the_document_or_of_ours() -> None:
    items = [item for source in DOCUMENTS.values() for item in source.items]
    assert len(items) > 70
    for item in items:
        assert bool(item.limit) != bool(item.ours), item.what
        assert item.says if item.limit else not item.missed, item.what


def test_commands_are_all_of_agonic() -> None:
    for source in DOCUMENTS.values():
        assert {shlex.split(one)[0] for one in list_commands(source)} == {"agonic"}


def test_a_number_beside_its_limit() -> None:
    table = make_item(limit=[">= 5.44", "0 to 1"])
    assert Row(table, [5.5, 0.5]).verdict == "met"
    assert Row(table, [5.5, 1.5]).verdict == "missed"
    assert Row(make_item(limit="== 12"), [12.0, 11.0]).verdict == "missed"
    assert Row(table, [], "no such file").verdict == "failed"


def test_a_number_out_of_a_file_beside_the_truth_of_another(tmp_path: Path) -> None:
    (tmp_path / "mr.csv").write_text("# by agonic\nparameter,value\nMR10,5\nMR20,7\n")
    (tmp_path / "truth.json").write_text('{"sensors": {"a.b": {"bias": [5.5, 7.0]}}}')
    item = make_item(key="mr.csv:0,1.value", truth="truth.json:sensors.a.b.bias", factor=10.0)
    assert find_numbers(item, {}, tmp_path) == [5.0]


def test_what_fails_is_said_and_the_others_go_on(tmp_path: Path) -> None:
    field = "agonic field --at 50.4,30.5 --date 2026-05-01"
    items = [
        make_item(command=field, key="elements.nothing", limit="> 0"),
        make_item(command="agonic info nowhere.csv", key="rows", limit="> 0"),
        make_item(command=field, key="elements.magnitude", unit="nT", limit="> 50000"),
    ]
    source = Source(name="uav", title="", origin="", setup=[], items=items)
    rows = reproduce(source, tmp_path)
    assert [row.verdict for row in rows] == ["failed", "failed", "met"]
    assert "nothing" in rows[0].failed
    assert "nowhere.csv" in rows[1].failed


def test_own_data_take_the_place_of_what_is_simulated(tmp_path: Path) -> None:
    own = tmp_path / "my flight.csv"
    own.touch()
    source = with_own_data(DOCUMENTS["uav"], [own])
    assert source.setup == []
    commands = list_commands(source)
    assert f"agonic heading mixed/setup.toml '{own}' -o headings.csv" in commands
    assert not [one for one in commands if "simulate" in one or "turned.csv" in one]
    assert 0 < len(source.items) < len(DOCUMENTS["uav"].items)
    assert not [item for item in source.items if isinstance(item.truth, str)]


def test_own_data_that_are_not_there_or_too_many(tmp_path: Path) -> None:
    with pytest.raises(AgonicError, match="is not there"):
        with_own_data(DOCUMENTS["samsat"], [tmp_path / "recorded"])
    with pytest.raises(AgonicError, match="no more"):
        with_own_data(DOCUMENTS["samsat"], [tmp_path, tmp_path])


def test_the_command_on_own_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["simulate", "alignment", "-o", "mine", "--seed", "9"]) == 0
    capsys.readouterr()
    short = replace(DOCUMENTS["patent"], items=DOCUMENTS["patent"].items[:1])
    monkeypatch.setattr("agonic.reproduce.run.load_documents", lambda: {"patent": short})
    assert run(["reproduce", "patent", "--with", "mine", "-o", "made", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["schema"] == "agonic/reproduce@1"
    (item,) = said["items"]
    assert item["verdict"] == "met"
    assert item["limit"] == "< 0.49"
    page = (tmp_path / "made" / "report.html").read_text("utf-8")
    assert "2″ make 0.49 nT" in page
    assert "Figure 1" in page
