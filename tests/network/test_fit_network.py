"""`agonic fit network`, from an empty folder as a user would."""

import json

import numpy as np
import pytest

import agonic as ag
from agonic.cli import main
from agonic.network.simulate import simulate_nonaffine


def run(*words, capsys) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    said = capsys.readouterr()
    return int(ended.value.code or 0), said.out, said.err


@pytest.fixture
def folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("simulate", "nonaffine", "-o", "bent.csv", "-n", 1500, capsys=capsys)[0] == 0
    assert run("simulate", "paper-space", "-o", "paper.csv", "-n", 600, capsys=capsys)[0] == 0
    capsys.readouterr()
    return tmp_path


def test_a_network_is_trained_written_and_applied(folder, capsys):
    status, out, _ = run(
        "fit",
        "network",
        "bent.csv",
        "--reference",
        "bent.reference.csv",
        "--hidden",
        8,
        "--inputs",
        "field,temperature,temperature_rate",
        "-o",
        "net.json",
        "--figure",
        "t.svg",
        capsys=capsys,
    )
    assert status == 0
    assert "the network is better" in " ".join(out.split())
    assert (folder / "t.svg").read_text().count("<svg") == 1
    assert run("apply", "net.json", "bent.csv", "-o", "field.csv", capsys=capsys)[0] == 0
    known = simulate_nonaffine(n=1500).field
    assert np.sqrt(np.mean((ag.read("field.csv").field - known) ** 2)) < 40.0
    assert run("verify", "net.json", "bent.csv", "--field", 50_000, capsys=capsys)[0] == 0


@pytest.mark.slow
def test_two_layers_from_the_command_line(folder, capsys):
    words = ["fit", "network", "bent.csv", "--reference", "bent.reference.csv", "--json"]
    words += ["--inputs", "field,temperature", "--hidden", "5,4", "-o", "net.json"]
    status, out, _ = run(*words, "--report", "net.html", capsys=capsys)
    said = json.loads(out)
    assert status == 0
    assert said["hidden"] == [5, 4]
    assert ag.load("net.json").shape.widths == (4, 5, 4, 3)
    assert "second node 4" in (folder / "net.html").read_text()
    assert run("apply", "net.json", "bent.csv", "-o", "field.csv", capsys=capsys)[0] == 0
    assert run("export", "net.json", "--to", "c", "-o", "net.h", capsys=capsys)[0] == 0


def test_on_an_affine_sensor_the_base_is_written(folder, capsys):
    status, out, _ = run(
        "fit",
        "network",
        "paper.csv",
        "--reference",
        "paper.reference.csv",
        "-o",
        "cal.json",
        "--json",
        capsys=capsys,
    )
    found = json.loads(out)
    assert status == 0
    assert found["schema"] == "agonic/fit-network@1"
    assert (found["chosen"], found["calibration_kind"]) == ("base", "affine")
    assert ag.load("cal.json").kind == "affine"


@pytest.mark.slow
def test_the_table_of_nodes(folder, capsys):
    status, out, _ = run(
        "fit",
        "network",
        "paper.csv",
        "--reference",
        "paper.reference.csv",
        "--base",
        "none",
        "--stopping",
        "plain",
        "--select",
        "--figure",
        "table.svg",
        "--json",
        capsys=capsys,
    )
    table = json.loads(out)["table"]
    assert status == 0
    assert [row["hidden"] for row in table] == [7, 6, 5, 4, 3, 2]
    assert table[-1]["regression"] < 0.9 < 0.998 < table[-2]["regression"]
    assert "hidden nodes" in (folder / "table.svg").read_text()


@pytest.mark.slow
def test_a_magnitude_is_enough(folder, capsys):
    status, out, _ = run(
        "fit", "network", "bent.csv", "--field", 50_000, "--hidden", 6, "--json", capsys=capsys
    )
    found = json.loads(out)
    assert status in (0, 1)
    assert found["target"] == "magnitude"
    assert found["unseen_rms_nT"] < 0.7 * found["unseen_base_rms_nT"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["bent.csv"], "the field that the sensor was in is not known"),
        (["bent.csv", "--field", "50000", "--base", "nothing.json"], "neither affine, none, nor"),
        (["bent.csv", "--field", "50000", "--inputs", "moon"], "inputs must be some of"),
        (["bent.csv", "--field", "50000", "--target", "vector"], 'target="magnitude"'),
        (["bent.csv", "--reference", "nowhere.csv"], "nowhere.csv"),
        (["bent.csv", "--field", "50000", "--hidden", "3,x"], "two as 5,3"),
    ],
)
def test_what_cannot_be_is_one_line(folder, capsys, words, said):
    status, out, err = run("fit", "network", *words, capsys=capsys)
    assert status == 2
    assert out == ""
    assert said in err
    assert len(err.strip().splitlines()) == 1
