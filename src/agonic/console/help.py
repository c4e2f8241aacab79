"""Help as people read it: usage, what a command does, examples, and options, as wide as the
terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from agonic.console.boundary import stop
from agonic.console.progress import timing
from agonic.console.terminal import find_width

Row = tuple[str, str]
"""A name, and what it means."""

_KINDS = {int: "N", float: "NUMBER"}
"""What stands for the value of an option that names none itself, by its type; else its name."""


_PLAIN = {
    "Input should be": "it has to be",
    "a valid integer, unable to parse string as an integer": "a whole number",
    "a valid number, unable to parse string as a number": "a number",
    "greater than or equal to": "at least",
    "less than or equal to": "at most",
    "requires an argument": "needs a value",
}
"""How the parser of options says what was wrong, and how people do."""


class _Helped:
    """A command with its own form of help."""

    examples: Sequence[str] = ()

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        formatter.write("\n".join(render_help(self, ctx, find_width())) + "\n")


class Command(_Helped, TyperCommand):
    """A command without subcommands."""

    def invoke(self, ctx: Any) -> Any:
        """Run it, with a word where it takes long; Ctrl-C is told with what was kept."""
        try:
            with timing(ctx.command_path) if ctx.info_name != "live" else nullcontext():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            raise stop() from None


class Group(_Helped, TyperGroup):
    """A command of commands, which lists them under headings; alone it says what there is."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Without any word, help."""
        if not args and not ctx.resilient_parsing:
            typer.echo(ctx.get_help())
            ctx.exit()
        return super().parse_args(ctx, args)


class App(typer.Typer):
    """An application whose commands have this help."""

    def command(self, *args: Any, **settings: Any) -> Any:
        """As in Typer."""
        return super().command(*args, **{"cls": Command, **settings})


def render_help(command: Any, ctx: Any, width: int) -> Iterator[str]:
    """The lines of a command's help, none wider than `width` where words allow."""
    yield from _wrap(f"Usage: {_describe_usage(command, ctx)}", width, "", "       ")
    for paragraph in (command.help or "").split("\n\n"):
        if paragraph.strip():
            yield ""
            yield from _wrap(" ".join(paragraph.split()), width, "  ", "  ")
    if command.examples:
        yield from ("", "Examples:")
        for example in command.examples:
            *lines, last = _wrap(example, width - 2, "  ", "      ")
            yield from (*(f"{line} \\" for line in lines), last)
    arguments, options = _list_parameters(command, ctx)
    sections: dict[str, list[Row]] = {"Arguments": arguments}
    for name, one in getattr(command, "commands", {}).items():
        says = " ".join((one.help or "").split("\n\n")[0].split())
        sections.setdefault(one.rich_help_panel or "Commands", []).append((name, says))
    for title, rows in {**sections, "Options": options}.items():
        if rows:
            yield from ("", f"{title}:", *write_rows(rows, width))


def write_rows(rows: Sequence[Row], width: int) -> Iterator[str]:
    """Names, and beside them, or below where they are long, what they mean."""
    column = min(max(len(name) for name, _ in rows), max(10, width // 3))
    rest = " " * (column + 4)
    for name, says in rows:
        beside = len(name) <= column
        if not beside or not says:
            yield from _wrap(name, width, "  ", "      ")
        if says:
            yield from _wrap(says, width, f"  {name:<{column}}  " if beside else rest, rest)


def _wrap(text: str, width: int, first: str, others: str) -> list[str]:
    return textwrap.wrap(
        text,
        width,
        initial_indent=first,
        subsequent_indent=others,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _describe_usage(command: Any, ctx: Any) -> str:
    words = [ctx.command_path, "[OPTIONS]"]
    for param in command.params:
        if param.param_type_name == "argument":
            name = _name_value(param)
            words.append((name if param.required else f"[{name}]") + "..." * (param.nargs != 1))
    words += [command.subcommand_metavar] if hasattr(command, "commands") else []
    return " ".join(words)


def _list_parameters(command: Any, ctx: Any) -> tuple[list[Row], list[Row]]:
    """The arguments and the options with what they mean."""
    arguments, options = [], []
    for param in command.get_params(ctx):
        record = param.get_help_record(ctx)
        if record is None:
            continue
        if param.param_type_name == "argument":
            arguments.append((_name_value(param), param.help or ""))
            continue
        names = ", ".join(sorted(param.opts, key=len))
        names += "".join(f"/{name}" for name in param.secondary_opts)
        valued = not (param.is_flag or param.count)
        options.append((f"{names} {_name_value(param)}" if valued else names, record[1]))
    return arguments, options


def _name_value(param: Any) -> str:
    """What stands for the value of a parameter: the word it names, by its type, or its own name."""
    if param.metavar:
        name = str(param.metavar).removesuffix("...")
        return name[1:-1] if name.startswith("[") else name
    kind = _KINDS.get(param.type_descriptor.annotation)
    return kind or str(max(param.opts, key=len)).strip("-").upper()


def describe_usage_error(error: Any) -> str:
    """What was wrong with the words of a command, in one line, and where its help is."""
    context, param = getattr(error, "ctx", None), getattr(error, "param", None)
    command = "agonic" if context is None else context.command_path
    said = error.format_message().rstrip(".?")
    if type(error).__name__ == "MissingParameter" and param is not None:
        is_argument = param.param_type_name == "argument"
        said = f"Missing {_name_value(param) if is_argument else max(param.opts, key=len)}"
        for example in getattr(context.command, "examples", ())[:1] if context else ():
            said += f", as in: {example}"
    if command == "agonic calibrate" and "unexpected extra argument" in said:
        said = "calibrate takes one LOG; for several there is: agonic fleet LOG... -o DIR"
    for jargon, plain in _PLAIN.items():
        said = said.replace(jargon, plain)
    return f"{said}{'? See' if 'Did you mean' in said else '; see'} {command} --help"
