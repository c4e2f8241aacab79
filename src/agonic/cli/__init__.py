"""The command line: one file per command, thin."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from io import TextIOWrapper
from typing import Any

from agonic.version import __version__

COMMANDS = {
    "calibrate": "agonic.cli.calibrate",
    "fleet": "agonic.fleet.commands.fleet",
    "history": "agonic.history.command",
    "live": "agonic.live.command",
    "info": "agonic.recording.commands.info",
    "fit": "agonic.cli.fit",
    "apply": "agonic.cli.apply",
    "verify": "agonic.recording.commands.verify",
    "heading": "agonic.headings.commands.heading",
    "export": "agonic.cli.export",
    "report": "agonic.cli.report",
    "field": "agonic.cli.field",
    "plan": "agonic.cli.plan",
    "simulate": "agonic.cli.simulate",
    "track": "agonic.inflight.commands.track",
    "retrain": "agonic.network.commands.retrain",
    "cite": "agonic.cli.cite",
    "demo": "agonic.recording.commands.demo",
}
"""Each command and its module, in the order in which `agonic --help` lists them; groups last."""

GOOD, FAILED, UNUSABLE = 0, 1, 2
"""Exit status: all well; a check failed or a fit was refused; bad input or usage."""

DEBUG = "AGONIC_DEBUG"
"""The environment variable that lets an error that was not foreseen show its traceback."""


def main(arguments: list[str] | None = None) -> None:
    """Run `agonic` and leave with its exit status; an error is one line on stderr."""
    # before NumPy is imported: small matrices lose far more to threads than they gain
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if isinstance(sys.stdout, TextIOWrapper):  # a name of a file may hold what cannot be printed
        sys.stdout.reconfigure(errors="backslashreplace")
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: list[str]) -> int:
    """The exit status of `agonic` with these arguments."""
    import typer

    from agonic.atomic import protect
    from agonic.console.boundary import explain
    from agonic.errors import AgonicError

    if arguments in (["--version"], ["-V"]):
        print(f"agonic {__version__}")
        return GOOD
    warnings.showwarning = _warner()
    try:
        with protect():
            status = _app()(args=arguments, prog_name="agonic", standalone_mode=False)
    except typer.TyperException as error:
        context = getattr(error, "ctx", None)
        command = "agonic" if context is None else context.command_path
        return _complain(f"{error.format_message()} (see {command} --help)")
    except (typer.Abort, KeyboardInterrupt):
        return _complain("interrupted; nothing was written")
    except typer.Exit as leave:
        return int(leave.exit_code)
    except (AgonicError, OSError) as error:
        return _complain(str(error))
    except Exception as error:  # a fault of ours: one line that says where, never a traceback
        if os.environ.get(DEBUG):
            raise
        return _complain(explain(error, arguments))
    return int(status or GOOD)


def _warner() -> Callable[..., None]:
    """Prints a warning as one line, and the same one only once."""
    said: set[str] = set()

    def warn(message: Warning | str, *_: object, **__: object) -> None:
        line = " ".join(str(message).split())
        if line not in said:
            print(f"agonic: warning: {line}", file=sys.stderr)
        said.add(line)

    return warn


def _complain(message: str) -> int:
    print(f"agonic: {' '.join(message.split())}", file=sys.stderr)
    return UNUSABLE


def _app() -> Any:
    """The application with every command; their heavy imports wait until they run."""
    import typer

    from agonic.console.boundary import add_force

    app = typer.Typer(
        name="agonic",
        help="Magnetometer readings into a direction one can trust.",
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for module in COMMANDS.values():
        import_module(module).add_to(app)
    command = typer.main.get_command(app)
    add_force(command)
    return command
