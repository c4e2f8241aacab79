"""The source does not grow: figures of its size, each held to its limit in size.toml.

A figure above its limit fails, and so does one that fell without being written down. From the
root of the repository:

    python -m tests.test_size                       the figures beside their limits
    python -m tests.test_size --write               write the figures that fell
    python -m tests.test_size --write --raise NAME  write NAME although it grew; say in
                                                    docs/decisions why

All are counted in the text and its syntax trees; nothing of agonic is imported.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "agonic"
LIMITS = Path(__file__).with_name("size.toml")
CORE = (
    "recording",
    "health",
    "model",
    "ellipsoid",
    "attitude",
    "ellipse",
    "inertial",
    "maths/equation",
    "maths/estimation",
)
NOT_CORE = ("inertial/pair",)
LINES_OF_SLACK = 200
WRITE = "python -m tests.test_size --write"

CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")
WIDENING = re.compile(r"_*(widen|grow|inflate|keep_doubt|restate)(_|$)")
COVARIANCE = re.compile(r"(\w+_)?covariance")
Function = ast.FunctionDef | ast.AsyncFunctionDef


class Source(NamedTuple):
    """A module: its path in the package, its text, and its syntax tree."""

    path: str
    text: str
    tree: ast.Module


class Rule(NamedTuple):
    """What is counted, in one word for a message, and how; `slack` may be unwritten."""

    word: str
    count: Callable[[Sequence[Source]], int]
    core: bool = False
    slack: int = 0

    @property
    def place(self) -> str:
        return "the core" if self.core else "src"


def parse(text: str, path: str = "module.py") -> Source:
    return Source(path, text, ast.parse(text))


def read_sources(package: Path) -> list[Source]:
    """Every Python module of a package."""
    return [
        parse(path.read_text(encoding="utf-8"), path.relative_to(package).as_posix())
        for path in sorted(package.rglob("*.py"))
    ]


def is_core(path: str) -> bool:
    """Whether a module is in a folder of the core."""

    def within(folders: Iterable[str]) -> bool:
        return any(path.startswith(f"{folder}/") for folder in folders)

    return within(CORE) and not within(NOT_CORE)


def count_lines(sources: Sequence[Source]) -> int:
    """Lines as an editor numbers them, blank ones and comments too."""
    return sum(source.text.count("\n") for source in sources)


def count_constants(sources: Sequence[Source]) -> int:
    """Names in capitals that a module assigns a value with a number in it other than 0, 1 and −1.

    The number may stand anywhere in the value: `NEAR = 3.0`, `GRID = np.geomspace(0.03, 100, 18)`
    and `TERMS = {"bias": 12, "gains": 4}` are one constant each.
    """
    return sum(len(list(_constants(source.tree))) for source in sources)


def _constants(tree: ast.Module) -> Iterator[str]:
    for statement in tree.body:
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
            continue
        if any(map(_is_chosen_number, ast.walk(statement.value))):
            yield from filter(CONSTANT.fullmatch, _assigned_names(statement))


def _assigned_names(statement: ast.Assign | ast.AnnAssign) -> Iterator[str]:
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    for node in (node for target in targets for node in ast.walk(target)):
        if isinstance(node, ast.Name):
            yield node.id


def _is_chosen_number(node: ast.AST) -> bool:
    """Whether a node is a number that someone chose; −1 is 1 under a minus."""
    if not isinstance(node, ast.Constant) or isinstance(node.value, bool):
        return False
    return isinstance(node.value, int | float | complex) and node.value not in (0, 1)


def count_findings(sources: Sequence[Source]) -> int:
    """Calls of `Finding(`, also as `health.Finding(`."""
    return sum(1 for _ in _finding_calls(sources))


def count_finding_names(sources: Sequence[Source]) -> int:
    """Different names that calls of `Finding(` spell out, first or as `name=`, and rows of facts.

    A name that a variable holds is not seen.
    """
    calls = [*_finding_calls(sources), *_finding_calls(sources, "Fact")]
    given = (_argument(call, "name") for call in calls)
    texts = (node.value for node in given if isinstance(node, ast.Constant))
    return len({text for text in texts if isinstance(text, str)})


def _finding_calls(sources: Sequence[Source], name: str = "Finding") -> Iterator[ast.Call]:
    for source in sources:
        if f"{name}(" in source.text:
            calls = (node for node in ast.walk(source.tree) if isinstance(node, ast.Call))
            yield from (call for call in calls if _called(call) == name)


def _called(call: ast.Call) -> str:
    """The last part of the name that is called."""
    if isinstance(call.func, ast.Attribute):
        return call.func.attr
    return call.func.id if isinstance(call.func, ast.Name) else ""


def _argument(call: ast.Call, name: str) -> ast.expr | None:
    """The first argument of a call, or that of the name."""
    named = [keyword.value for keyword in call.keywords if keyword.arg == name]
    return next(iter([*call.args[:1], *named]), None)


def count_covariance_changes(sources: Sequence[Source]) -> int:
    """Functions that change a covariance after it was computed; one mechanism is the goal.

    Either the name says so: it begins with widen, grow, inflate, keep_doubt or restate. Or the
    function puts another in its place: it calls `replace` or `_replace` with `covariance=` or
    `…_covariance=`, whatever the value. A covariance that a result is made with is not counted,
    and what a function inside does is that function's.
    """
    return sum(len(list(_covariance_changes(source.tree))) for source in sources)


def _covariance_changes(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, Function) and (
            WIDENING.match(node.name) or any(map(_replaces_covariance, _own_nodes(node)))
        ):
            yield node.name


def _own_nodes(function: ast.AST) -> Iterator[ast.AST]:
    """What is inside a function, without the functions inside it."""
    for node in ast.iter_child_nodes(function):
        if not isinstance(node, Function):
            yield node
            yield from _own_nodes(node)


def _replaces_covariance(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Call)
        and _called(node) in ("replace", "_replace")
        and any(COVARIANCE.fullmatch(keyword.arg or "") for keyword in node.keywords)
    )


RULES = {
    "lines": Rule("line", count_lines, slack=LINES_OF_SLACK),
    "core_lines": Rule("line", count_lines, core=True, slack=LINES_OF_SLACK),
    "files": Rule("file", len),
    "constants": Rule("numeric constant", count_constants),
    "core_constants": Rule("numeric constant", count_constants, core=True),
    "findings": Rule("Finding call", count_findings),
    "finding_names": Rule("finding name", count_finding_names),
    "covariance_changes": Rule("covariance change", count_covariance_changes),
}


@cache
def measure(package: Path) -> Mapping[str, int]:
    """Every figure of a package."""
    whole = read_sources(package)
    core = [source for source in whole if is_core(source.path)]
    return {name: rule.count(core if rule.core else whole) for name, rule in RULES.items()}


def read_limits() -> dict[str, int]:
    return tomllib.loads(LIMITS.read_text(encoding="utf-8")) if LIMITS.exists() else {}


def object_to(rule: Rule, figure: int, limit: int) -> str:
    """What is wrong with a figure beside its limit; empty if nothing."""
    apart = abs(figure - limit)
    much = f"{rule.place} has {apart} {rule.word}{'s' * (apart != 1)}"
    if figure > limit:
        return (
            f"{much} more than tests/size.toml allows: delete something, "
            "or say in docs/decisions why not"
        )
    if apart > rule.slack:
        return f"{much} fewer than tests/size.toml allows: write the smaller figure: {WRITE}"
    return ""


def lower(
    limits: Mapping[str, int], figures: Mapping[str, int], raised: Iterable[str] = ()
) -> dict[str, int]:
    """The limits with each figure that fell, and with those that are raised on purpose.

    A limit that is not there yet is 0, so a new one is raised.
    """
    kept = {name: min(limits.get(name, 0), figure) for name, figure in figures.items()}
    return kept | {name: figures[name] for name in raised}


def format_limits(limits: Mapping[str, int]) -> str:
    """The text of size.toml."""
    head = f"# The size of src/agonic, only downwards: {WRITE} (see test_size.py)."
    return "\n".join([head, *(f"{name} = {limit}" for name, limit in limits.items()), ""])


def main(arguments: Sequence[str]) -> int:
    """Print the figures, write those that fell; 1 if one is above its limit."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the figures that fell")
    parser.add_argument("--raise", dest="raised", action="append", default=[], choices=RULES)
    asked = parser.parse_args(arguments)
    if asked.raised and not asked.write:
        parser.error("--raise goes with --write")
    figures, limits = measure(PACKAGE), read_limits()
    if asked.write:
        limits = lower(limits, figures, asked.raised)
        LIMITS.write_text(format_limits(limits), encoding="utf-8")
    for name, figure in figures.items():
        print(f"{name:20}{figure:8}  limit {limits.get(name, 0)}")
    grown = [name for name, figure in figures.items() if figure > limits.get(name, 0)]
    for name in grown:
        print(object_to(RULES[name], figures[name], limits.get(name, 0)), file=sys.stderr)
    return 1 if grown else 0


@pytest.mark.parametrize("name", RULES)
def test_the_source_is_as_small_as_was_written(name: str) -> None:
    wrong = object_to(RULES[name], measure(PACKAGE)[name], read_limits()[name])
    assert not wrong, wrong


def test_every_limit_is_of_a_figure_and_written_as_the_command_writes_it() -> None:
    limits = read_limits()
    assert list(limits) == list(RULES)
    assert LIMITS.read_text(encoding="utf-8") == format_limits(limits)


def test_every_folder_of_the_core_has_modules() -> None:
    assert [folder for folder in CORE if not list((PACKAGE / folder).rglob("*.py"))] == []


def test_lines_are_counted_as_an_editor_numbers_them() -> None:
    assert count_lines([parse("A = 1\n\n# why\n"), parse(""), parse("B = 2\n")]) == 4


@pytest.mark.parametrize(
    ("path", "core"),
    [
        ("model/term.py", True),
        ("model/terms/time.py", True),
        ("inertial/fit.py", True),
        ("inertial/pair/fit.py", False),
        ("field/world_model.py", False),
        ("modelled/fit.py", False),
        ("maths/equation/gauge.py", True),
        ("maths/rotations/deviation.py", False),
        ("fit.py", False),
    ],
)
def test_the_core_is_its_folders(path: str, core: bool) -> None:
    assert is_core(path) is core


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("NEAR = 3.0", 1),
        ("_NEAR_DEG: float = -3.0", 1),
        ("GRID = np.geomspace(0.03, 100.0, 18)", 1),
        ("TERMS = {'bias': 12, 'gains': 4}", 1),
        ("A = B = 2", 2),
        ("A, B = 2, 3", 2),
        ("ZERO = 0\nONE = 1\nDOWN = -1.0\nYES = True\nNAMES = ('x', '2')", 0),
        ("near = 3.0\nNear = 3.0\nNEAR: float", 0),
        ("def f():\n    NEAR = 3.0\nclass C:\n    NEAR = 3.0", 0),
    ],
)
def test_a_constant_is_a_chosen_number_with_a_name(text: str, count: int) -> None:
    assert count_constants([parse(text)]) == count


def test_findings_are_calls_and_their_names_what_is_spelt_out() -> None:
    sources = [
        parse("class Finding: ...\nfound = [Finding('static', 'refuse'), Finding('static')]"),
        parse("health.Finding(name='clipped')\nFinding(name, 'note')\nFinding(f'{a} drifts')"),
        parse("replace(found, name='other')\nFinding(what='is seen')\nFact('static', look)"),
    ]
    assert count_findings(sources) == 6
    assert count_finding_names(sources) == 2


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("def widen(fit): ...\ndef _inflate_by(fit): ...\ndef keep_doubt(fit): ...", 3),
        ("def widening(fit): ...\ndef _grows(fit): ...\ndef regrow(fit): ...", 0),
        ("def f(fit):\n    return fit._replace(covariance=2 * fit.covariance)", 1),
        ("def f(fit):\n    return replace(fit, star_covariance=more)", 1),
        ("def f(fit):\n    return fit._replace(params=more), Affine(covariance=more)", 0),
        ("def f(a):\n    g = a._replace(covariance=1)\n    return a._replace(covariance=g)", 1),
        ("def f(a):\n    def g(b):\n        return b._replace(covariance=1)\n    return g(a)", 1),
        ("class C:\n    async def f(self):\n        return replace(self, covariance=None)", 1),
    ],
)
def test_a_covariance_is_changed_by_name_or_by_replacement(text: str, count: int) -> None:
    assert count_covariance_changes([parse(text)]) == count


def test_limits_fall_by_themselves_and_rise_when_asked() -> None:
    figures = {"lines": 90, "files": 12, "findings": 5}
    limits = {"lines": 100, "files": 10}
    assert lower(limits, figures) == {"lines": 90, "files": 10, "findings": 0}
    assert lower(limits, figures, ["files"]) == {"lines": 90, "files": 12, "findings": 0}


def test_a_figure_above_or_far_below_its_limit_is_said() -> None:
    lines, names = RULES["lines"], RULES["core_constants"]
    assert object_to(lines, 184, 100).startswith("src has 84 lines more than tests/size.toml")
    assert object_to(lines, 100, 300) == object_to(names, 7, 7) == ""
    assert object_to(lines, 100, 301).startswith("src has 201 lines fewer")
    assert object_to(names, 6, 7).startswith("the core has 1 numeric constant fewer")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
