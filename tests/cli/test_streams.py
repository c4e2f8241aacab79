"""Standard input, terminals without Unicode, and Ctrl-C."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import agonic as ag
from agonic.cli import run
from agonic.recording import files
from agonic.simulation import simulate


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ag.write_csv(simulate("tumble", n=600, seed=1).samples, "log.csv")


@pytest.mark.parametrize("command", ["calibrate - --field 50000", "fit ellipsoid -", "info -"])
def test_a_dash_is_what_is_piped_in(command: str, monkeypatch, capsys) -> None:
    said = []
    for words in (command.split(), command.replace("-", "log.csv", 1).split()):
        piped = io.TextIOWrapper(io.BytesIO(Path("log.csv").read_bytes()))
        monkeypatch.setattr(sys, "stdin", piped)
        assert run([*words, "--json"]) == 0
        said.append(json.loads(capsys.readouterr().out))
    for one in said:
        one.pop("file", None)
        for found in one.get("sensors", [one]):
            found.pop("files", None)
    assert said[0] == said[1]


def test_a_dash_with_nothing_piped_in_is_told(monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    assert run(["info", "-"]) == 2
    assert "nothing is" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("encoding", "more"), [("ascii", "--verbose"), ("cp1252", "--verbose"), ("ascii", "--json")]
)
def test_a_terminal_without_unicode_gets_ascii(encoding: str, more: str) -> None:
    source = str(Path(ag.__file__).parents[1])
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONPATH": source}
    command = [sys.executable, "-m", "agonic", "calibrate", "log.csv", more]
    done = subprocess.run(command, capture_output=True, env=environment)
    assert done.returncode == 0, done.stderr
    text = done.stdout.decode(encoding)
    if more == "--json":
        assert json.loads(text)["sensors"][0]["verdict"] == "good"
    else:
        assert text.startswith("+ mag: good")
        assert "?" not in text
        assert "\\u" not in text


def test_ctrl_c_says_what_was_kept(monkeypatch, capsys) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(files, "save_setup", interrupt)
    assert run(["calibrate", "log.csv", "--field", "50000", "-o", "out"]) == 130
    told = capsys.readouterr().err
    assert told == "agonic: interrupted; kept: out/mag.h, out/mag.json\n"
    assert {path.name for path in Path("out").iterdir()} == {"mag.h", "mag.json"}
    monkeypatch.setattr(files, "make_folder", interrupt)
    assert run(["calibrate", "log.csv", "-o", "other"]) == 130
    assert capsys.readouterr().err == "agonic: interrupted; nothing was written\n"
