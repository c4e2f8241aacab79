"""What holds for every command: how an unforeseen error is told, and when a file is replaced."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

from agonic.atomic import list_written, overwrite_all

_CAUSES: tuple[tuple[tuple[str, ...], str], ...] = (
    (("MemoryError", "ArrayMemoryError"), "there is not enough memory for what it needs"),
    (("RecursionError",), "something in its input is nested too deeply"),
    (("LinAlgError",), "the readings do not determine what is computed from them"),
    (
        ("OverflowError", "FloatingPointError", "ZeroDivisionError"),
        "a number is too large to compute with",
    ),
)


class Interrupted(Exception):
    """A command was stopped by Ctrl-C; its text says what was kept, its status is as shells have
    it."""

    status = 130


def stop() -> Interrupted:
    """What to raise after Ctrl-C."""
    kept = ", ".join(list_written())
    return Interrupted(f"interrupted; {'kept: ' * bool(kept)}{kept or 'nothing was written'}")


def explain(error: Exception, arguments: Sequence[str]) -> str:
    """One line on an error that was not foreseen: the command, what was wrong, the next move."""
    name = type(error).__name__
    known = (words for names, words in _CAUSES if name in names)
    what = next(known, "it failed in an unexpected way")
    command = " ".join(["agonic", *arguments])
    shown = command if len(command) <= 200 else command[:199] + "…"
    said = " ".join(f"{name}: {error}".split())[:200]
    return (
        f"{shown}: {what} ({said}); look at the input for values that no sensor gives, and please "
        "report this with the line above: AGONIC_DEBUG=1 shows where it happened"
    )


def add_columns(command: Any) -> None:
    """Give a command that reads a log with `--unit` the option `--columns`."""
    at = [k for k, param in enumerate(command.params) if "--unit" in param.opts]
    if at:
        command.params.insert(at[0] + 1, _make_options()["columns"])


def add_force(command: Any) -> None:
    """Give a command that writes a file the option `--force`."""
    if any("--out" in param.opts for param in command.params):
        command.params.append(_make_options()["force"])


@cache
def _make_options() -> dict[str, Any]:
    """The options, as Typer makes them of a command that has nothing else."""
    import typer

    def give(named: str | None) -> None:
        from agonic.logs.headers.column_names import give_names

        give_names(named)

    def note(value: bool) -> None:
        if value:
            overwrite_all()

    columns = typer.Option(
        None,
        "--columns",
        metavar="NAMES",
        help="What the columns are, where headers do not say: time=t,x=mx,y=my,z=mz.",
        callback=give,
        expose_value=False,
    )
    force = typer.Option(
        False,
        "--force",
        help="Replace a file that agonic did not write; never one that is read.",
        callback=note,
        expose_value=False,
    )
    app = typer.Typer(add_completion=False)

    @app.command()
    def only(columns: str | None = columns, force: bool = force) -> None:
        """Nothing but the options."""

    return {param.name: param for param in typer.main.get_command(app).params}
