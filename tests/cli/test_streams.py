"""Standard input, terminals without Unicode, and Ctrl-C."""

import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import pytest

import agonic as ag
from agonic.cli import main, run
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


def as_a_process(encoding: str, *words: str) -> bytes:
    """What `agonic` leaves on a terminal of an encoding."""
    source = str(Path(ag.__file__).parents[1])
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONPATH": source}
    command = [sys.executable, "-m", "agonic", *words]
    done = subprocess.run(command, capture_output=True, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


def in_this_process(encoding: str, *words: str) -> bytes:
    """The same without the start of a process."""
    said = io.TextIOWrapper(io.BytesIO(), encoding)
    with redirect_stdout(said), pytest.raises(SystemExit) as left:
        main([*words])
    assert left.value.code == 0
    said.flush()
    return said.buffer.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("encoding", "more", "said"),
    [
        ("ascii", "--verbose", as_a_process),
        ("cp1252", "--verbose", in_this_process),
        ("ascii", "--json", in_this_process),
    ],
)
def test_a_terminal_without_unicode_gets_ascii(encoding: str, more: str, said) -> None:
    text = said(encoding, "calibrate", "log.csv", more).decode(encoding)
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
