"""A command of several kinds, such as `agonic fit KIND`, each with options of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from functools import partial, wraps
from importlib import import_module
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, get_type_hints

import typer

from agonic.console.boundary import add_columns, add_force
from agonic.console.help import App, Group
from agonic.console.options import read_options, split_options


class Kinds(Group):
    """The kinds of a command, where options may stand before the kind. An unknown one is told the
    kind that is spelled nearly so or whose help has the word, and all."""

    def make_later(
        self,
        places: Mapping[str, Mapping[str, str]],
        examples: Mapping[str, Sequence[str]],
        path: str,
    ) -> None:
        """Make the kinds when they are asked for; `places` of their functions, by headings."""
        self._make = partial(_make_kinds, places, examples, path)
        del self.commands

    def __getattr__(self, name: str) -> Any:
        """The kinds, made at last."""
        if name != "commands":
            raise AttributeError(name)
        self.commands = self._make()
        return self.commands

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Move the kind to the front."""
        if args and args[0].startswith("-") and args[0] not in ctx.help_option_names:
            named = (
                k
                for k, word in enumerate(args)
                if word in self.commands and args[k - 1] not in ("-o", "--out")
            )
            at = next(named, None)
            if at is None:
                self._fail(ctx, "the kind is missing")
            else:
                args = [args[at], *args[:at], *args[at + 1 :]]
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command of the kind, or an error that names those that there are."""
        if args[0] not in self.commands:
            word = args[0].lower()
            named = [k for k, one in self.commands.items() if word in (one.help or "").lower()]
            near = get_close_matches(args[0], self.commands, n=1) or named[:1]
            meant = f" (did you mean {near[0]!r}?)" if near else ""
            self._fail(ctx, f"no kind {args[0]!r} to {ctx.info_name}{meant}")
        return super().resolve_command(ctx, args)

    def _fail(self, ctx: Any, what: str) -> None:
        ctx.fail(f"{what}; choose from {', '.join(self.commands)}")


def _make_kinds(
    places: Mapping[str, Mapping[str, str]], examples: Mapping[str, Sequence[str]], path: str
) -> dict[str, Any]:
    app = App(rich_markup_mode=None)
    for heading, kinds in places.items():
        for kind, place in kinds.items():
            register(app, kind, place, heading)
    return dict(complete(typer.main.get_command(app), examples, path).commands)


def register(app: typer.Typer, name: str, place: str, heading: str) -> None:
    """Make a function a command, listed under a heading. `place` is its module, with its name after
    a colon where the command is called otherwise. Of a function that is several commands the help
    stands in the `HELP` of its module."""
    home, _, function = place.partition(":")
    module = import_module(home)
    help = getattr(module, "HELP", {}).get(name)
    made = app.command(name, help=help, rich_help_panel=heading)
    made(expand(getattr(module, function or name.replace("-", "_"))))


def _find_hints(of: Any) -> dict[str, Any]:
    """The types of the parameters of a function or the fields of a group, with their options."""
    hints = get_type_hints(of, include_extras=True)
    described = read_options(split_options(of.__doc__ or "")[1])
    return {n: Annotated[h, described[n]] if n in described else h for n, h in hints.items()}


def expand(function: Callable[..., int]) -> Callable[..., int]:
    """The function of a command with each group of options, a named tuple, field by field, and with
    what its docstring says of the others."""
    hints = _find_hints(function)
    groups = {name: hint for name, hint in hints.items() if hasattr(hint, "_field_defaults")}
    parameters: list[Parameter] = []
    for name, given in signature(function).parameters.items():
        group = groups.get(name)
        of = {name: hints[name]} if group is None else _find_hints(group)
        defaults = {name: given.default} if group is None else group._field_defaults
        for field, hint in of.items():
            default = defaults.get(field, Parameter.empty)
            parameters.append(
                Parameter(field, Parameter.KEYWORD_ONLY, default=default, annotation=hint)
            )

    @wraps(function)
    def run(**options: Any) -> int:
        for name, group in groups.items():
            options[name] = group(**{field: options.pop(field) for field in group._fields})
        return function(**options)

    run.__doc__ = split_options(function.__doc__ or "")[0]
    run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return run


def complete(command: Any, examples: Mapping[str, Sequence[str]], path: str) -> Any:
    """The command, it and all below it with what no function says: examples, shared options."""
    command.examples = examples.get(path, ())
    add_columns(command)
    add_force(command)
    for name, one in vars(command).get("commands", {}).items():
        complete(one, examples, f"{path} {name}")
    return command
