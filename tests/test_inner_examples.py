"""Examples of functions that are not public: a file in each folder, run in their own modules."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

PLACES = sorted(Path(__file__).parent.glob("*/examples.txt"))


def read_examples(place: Path) -> list[tuple[str, str]]:
    """The name of each function and its example."""
    parts = place.read_text(encoding="utf-8").removeprefix("# ").split("\n# ")
    return [(name, text) for name, _, text in (part.partition("\n") for part in parts)]


EXAMPLES = [pytest.param(*one, id=one[0]) for place in PLACES for one in read_examples(place)]


def find_names(function: str) -> dict[str, object]:
    """All names of the module that a function, or a method of one of its classes, stands in."""
    module = function.rpartition(".")[0]
    try:
        return dict(vars(import_module(module)))
    except ModuleNotFoundError:
        return find_names(module)


@pytest.mark.parametrize(("function", "text"), EXAMPLES)
def test_an_example_holds(function: str, text: str) -> None:
    told: list[str] = []
    example = doctest.DocTestParser().get_doctest(text, find_names(function), function, function, 0)
    assert example.examples
    doctest.DocTestRunner().run(example, out=told.append)
    assert not told, "".join(told)
