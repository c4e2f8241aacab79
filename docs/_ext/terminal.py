"""Directives that run what they show: `terminal` for commands, `commands` for every help text.

The commands of a page share one empty folder. Lines start with `$`; `agonic` runs in this process,
all else in a shell. A command that fails is an error unless `$ echo $?` follows it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from shlex import split
from tempfile import TemporaryDirectory
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from agonic.cli import make_command, run

ECHO = "echo $?"


def executed(command: str, folder: str) -> tuple[str, int]:
    """What a command prints, and its exit status."""
    words = split(command)
    if words[0] != "agonic":
        done = subprocess.run(
            command, shell=True, cwd=folder, capture_output=True, text=True, env=environment()
        )
        return done.stdout + done.stderr, done.returncode
    said = StringIO()
    with chdir(folder), redirect_stdout(said), redirect_stderr(said):
        status = run(words[1:])
    return said.getvalue(), status


def environment() -> dict[str, str]:
    """The variables of this process, with its own Python found first."""
    beside = str(Path(sys.executable).parent)
    return {**os.environ, "PATH": os.pathsep.join([beside, os.environ.get("PATH", "")])}


class Terminal(SphinxDirective):
    """Commands as typed, and what they print now."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """A block of text."""
        if "terminal" not in self.env.temp_data:
            self.env.temp_data["terminal"] = TemporaryDirectory()
        folder = self.env.temp_data["terminal"].name
        commands = [line.removeprefix("$").strip() for line in self.content if line.strip()]
        text = "\n".join(self._lines(commands, folder))
        return [nodes.literal_block(text, text, language="console")]

    def _lines(self, commands: list[str], folder: str) -> Iterator[str]:
        status = 0
        for command, following in zip(commands, [*commands[1:], ""], strict=True):
            yield f"$ {command}"
            if command == ECHO:
                yield str(status)
                continue
            printed, status = executed(command, folder)
            if status and following != ECHO:
                raise self.error(f"{command!r} left with status {status}:\n{printed}")
            yield from printed.rstrip("\n").split("\n") if printed.strip() else ()


class Commands(SphinxDirective):
    """A section for every command, with its help text."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        return [_section(command, text) for command, text in helps("agonic", make_command())]


def helps(path: str, command: Any) -> Iterator[tuple[str, str]]:
    """A command with its help text, and then those of the commands below it."""
    yield path, executed(f"{path} --help", os.curdir)[0].rstrip()
    for name, one in getattr(command, "commands", {}).items():
        yield from helps(f"{path} {name}", one)


def _section(command: str, text: str) -> nodes.section:
    """A titled section with the help of a command."""
    section = nodes.section(ids=[nodes.make_id(command)], names=[command])
    section += nodes.title(command, "", nodes.literal(command, command))
    section += nodes.literal_block(text, text, language="text")
    return section


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("terminal", Terminal)
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
