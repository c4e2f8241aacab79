"""A command of several kinds, such as `agonic fit KIND`, each with options of its own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any, Protocol

import typer

from agonic.console.help import App, Group


class Kind(Protocol):
    """A module with a command: it adds one or more kinds to the group."""

    def add_to(self, kinds: typer.Typer) -> None:
        """Register the command."""


class Kinds(Group):
    """The kinds of a command: an unknown one is told all, and options may stand before the kind."""

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
            near = get_close_matches(args[0], self.commands, n=1)
            meant = f" (did you mean {near[0]!r}?)" if near else ""
            self._fail(ctx, f"no kind {args[0]!r} to {ctx.info_name}{meant}")
        return super().resolve_command(ctx, args)

    def _fail(self, ctx: Any, what: str) -> None:
        ctx.fail(f"{what}; choose from {', '.join(self.commands)}")


def add_kinds(
    app: typer.Typer, name: str, modules: Mapping[str, Iterable[Kind]], help: str
) -> None:
    """Register a command whose kinds are those of the modules, listed under their headings."""
    kinds = App(cls=Kinds, help=help, subcommand_metavar="KIND ...")
    for heading, group in modules.items():
        before = len(kinds.registered_commands)
        for module in group:
            module.add_to(kinds)
        for kind in kinds.registered_commands[before:]:
            kind.rich_help_panel = heading
    app.add_typer(kinds, name=name)
