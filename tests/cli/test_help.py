"""Help: of every command, with examples that parse, in any terminal's width."""

import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest

from agonic.cli import GROUPS, make_command, run
from agonic.cli.commands import EXAMPLES

AGONIC = make_command()


def walk(path: str, command: Any) -> Iterator[tuple[str, Any]]:
    yield path, command
    for name, one in getattr(command, "commands", {}).items():
        yield from walk(f"{path} {name}", one)


EVERY = dict(walk("agonic", AGONIC))
ALONE = ["agonic", "agonic fit", "agonic plan", "agonic simulate"]


def parse(command: Any, name: str, words: list[str]) -> str:
    """The command that the words call, whose every word it takes."""
    context = command.make_context(name, words)
    rest = [*context._protected_args, *context.args]
    if not rest:
        return name
    assert hasattr(command, "commands"), rest
    called, below, words = command.resolve_command(context, rest)
    return f"{name} {parse(below, called, words)}"


def test_every_command_has_two_examples() -> None:
    assert EXAMPLES.keys() == EVERY.keys()
    assert all(len(set(examples)) == 2 for examples in EXAMPLES.values())


@pytest.mark.parametrize("path", EVERY)
def test_examples_are_commands_that_there_are(path: str) -> None:
    for example in EXAMPLES[path]:
        _, *words = shlex.split(example)
        assert parse(AGONIC, "agonic", words).startswith(path)


@pytest.mark.parametrize("path", ALONE)
def test_alone_a_command_of_commands_is_its_help(path: str, capsys) -> None:
    _, *words = path.split()
    assert run(words) == 0
    alone = capsys.readouterr()
    assert run([*words, "--help"]) == 0
    assert alone == capsys.readouterr()
    assert alone.out.startswith(f"Usage: {path} ")
    assert alone.err == ""


def test_commands_stand_in_groups_beside_what_they_do(capsys) -> None:
    run([])
    said = capsys.readouterr().out
    places = [said.index(f"\n{group}:\n") for group in GROUPS]
    assert places == sorted(places)
    assert "-V, --version" in said
    assert "--install-completion" in said
    for group in GROUPS.values():
        assert all(f"\n  {name} " in said for name in group)


@pytest.mark.parametrize("width", [40, 80, 120, 200])
def test_help_fits_the_terminal_and_names_no_types(width: int, capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    for path, command in EVERY.items():
        _, *words = path.split()
        assert run([*words, "--help"]) == 0
        said = capsys.readouterr().out
        assert all(len(line) <= width for line in said.splitlines() if " " in line.strip()), path
        assert "…" not in said
        assert not re.search(r"<(str|int|float|path|list|bool|file)", said)
        text = " ".join(said.replace(" \\\n", " ").split())
        for paragraph in command.help.split("\n\n"):
            assert " ".join(paragraph.split()) in text
        assert all(" ".join(example.split()) in text for example in EXAMPLES[path])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "calibrate",
            "Missing LOG, as in: agonic calibrate flight.bin; see agonic calibrate --help",
        ),
        ("calibrate a b", "agonic fleet LOG... -o DIR; see agonic calibrate --help"),
        (
            "apply a b",
            "as in: agonic apply mag.json walk.csv -o corrected.csv; see agonic apply --help",
        ),
        ("calibrte x", "Did you mean 'calibrate', 'cite'? See agonic --help"),
        ("fit ellipsoid x --seed 3", "; see agonic fit ellipsoid --help"),
    ],
)
def test_wrong_words_are_one_line_that_leads_to_help(words: str, said: str, capsys) -> None:
    assert run(words.split()) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert told.err.strip().endswith(said)


def test_completion_is_on(monkeypatch, capsys) -> None:
    monkeypatch.setenv("_AGONIC_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "agonic cal")
    monkeypatch.setenv("COMP_CWORD", "1")
    with pytest.raises(SystemExit):
        run(["cal"])
    assert "calibrate" in capsys.readouterr().out
