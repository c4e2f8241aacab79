"""The options of a command as they were typed, for a command that goes on from it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import typer

NOT_OF_THE_RESULT = ("--json", "--open", "--verbose", "--force", "--store", "--as")
"""Options that say how a result is shown or kept, and that another run need not repeat."""


def list_typed_options(context: typer.Context) -> dict[str, str]:
    """The options that were typed for a command with their values, "" for a flag."""
    from agonic.logs.headers.column_names import write_given_names

    typed = {}
    for param in context.command.params:
        name = param.name or ""
        source = context.get_parameter_source(name)
        if param.param_type_name != "option" or source is None or source.name != "COMMANDLINE":
            continue
        value = context.params[name] if name in context.params else write_given_names()
        flag = "-o" if "-o" in param.opts else max(param.opts, key=len)
        if flag not in NOT_OF_THE_RESULT:
            typed[flag] = "" if value is True else str(value)
    return typed


def write_options(options: Mapping[str, str]) -> str:
    """Options as one types them, each with the blank before it.

    >>> write_options({"--at": "52.1,5.2", "--course": "", "--mounting": "x up, y forward"})
    " --at 52.1,5.2 --course --mounting 'x up, y forward'"
    """
    return "".join(
        f" {name}" + (f" {shlex.quote(value)}" if value else "") for name, value in options.items()
    )
