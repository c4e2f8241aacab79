"""The command line: one file per command, thin."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

from agonic.cli.commands import COMMANDS, EXAMPLES, GROUPS, KINDS
from agonic.console.standard_input import keep_standard_input
from agonic.console.terminal import allow_any_sign
from agonic.version import __version__

GOOD, FAILED, UNUSABLE = 0, 1, 2
"""Exit status: all well; a check failed or a fit was refused; bad input or usage."""

DEBUG = "AGONIC_DEBUG"
"""The environment variable that lets an error that was not foreseen show its traceback."""


def main(arguments: list[str] | None = None) -> None:
    """Run `agonic` and leave with its exit status; an error is one line on stderr."""
    # before NumPy is imported: small matrices lose far more to threads than they gain
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        allow_any_sign(stream)
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: list[str]) -> int:
    """The exit status of `agonic` with these arguments."""
    import typer

    from agonic.atomic import protect
    from agonic.console.boundary import Interrupted, explain
    from agonic.console.help import describe_usage_error
    from agonic.errors import AgonicError

    if arguments in (["--version"], ["-V"]):
        print(f"agonic {__version__}")
        return GOOD
    warnings.showwarning = _warner()
    try:
        with protect(), keep_standard_input(arguments) as words:
            command = make_command(next((word for word in words[:1] if word in COMMANDS), ""))
            status = command(args=words, prog_name="agonic", standalone_mode=False)
    except typer.TyperException as error:
        message, failure = describe_usage_error(error), UNUSABLE
    except Interrupted as stopped:
        message, failure = str(stopped), stopped.status
    except (AgonicError, OSError) as error:
        message, failure = str(error), UNUSABLE
    except Exception as error:  # a fault of ours: one line that says where, never a traceback
        if os.environ.get(DEBUG):
            raise
        message, failure = explain(error, arguments), UNUSABLE
    else:
        return int(status or GOOD)
    return _complain(message, failure, as_json="--json" in arguments)


def _warner() -> Callable[..., None]:
    """Prints a warning as one line, and the same one only once."""
    said: set[str] = set()

    def warn(message: Warning | str, *_: object, **__: object) -> None:
        line = " ".join(str(message).split())
        if line not in said:
            print(f"agonic: warning: {line}", file=sys.stderr)
        said.add(line)

    return warn


def _complain(message: str, status: int, *, as_json: bool) -> int:
    """The status, after one line on stderr; programs get an object with the same on stdout."""
    from agonic.console.output import print_json

    line = " ".join(message.split())
    if as_json:
        print_json("agonic/error@1", {"error": line, "status": status})
    print(f"agonic: {line}", file=sys.stderr)
    return status


@cache
def make_command(only: str = "") -> Any:
    """The command `agonic` with every other below it, or with one: making all takes a while. Kinds
    are made when they are asked for, and heavy imports wait until a command runs."""
    import typer

    from agonic.console.help import App, Group
    from agonic.console.kinds import Kinds, complete, register

    app = App(
        name="agonic",
        cls=Group,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    shown = typer.Option(False, "--version", "-V", help="Show the version and exit.")

    @app.callback()
    def answer(version: bool = shown) -> None:
        """Turn magnetometer readings into headings you can trust."""

    wanted = [name for name in COMMANDS if only in ("", name)]
    for heading, group in GROUPS.items():
        for name in group.keys() & set(wanted):
            if name in KINDS:
                kinds = App(cls=Kinds, help=group[name], subcommand_metavar="KIND ...")
                app.add_typer(kinds, name=name, rich_help_panel=heading)
            else:
                register(app, name, group[name], heading)
    command: Any = typer.main.get_command(app)
    command.commands = {name: command.commands[name] for name in wanted}
    for name in set(wanted) & KINDS.keys():
        command.commands[name].make_later(KINDS[name], EXAMPLES, f"agonic {name}")
    return complete(command, EXAMPLES, "agonic")
