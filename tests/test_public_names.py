"""Every public name can be imported, is explained, and shows how it is used."""

import doctest
import inspect
import subprocess
import sys

import pytest

import agonic as ag

NAMES = [name for name in ag.__all__ if not name.startswith("__")]
FUNCTIONS = [name for name in NAMES if inspect.isfunction(getattr(ag, name))]


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_is_explained(name: str) -> None:
    said = inspect.getdoc(getattr(ag, name))
    assert said
    assert said.splitlines()[0].endswith(".")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_shows_how_it_is_used(name: str) -> None:
    finder = doctest.DocTestFinder(recurse=False)
    examples = [example for test in finder.find(getattr(ag, name)) for example in test.examples]
    assert any(name in example.source for example in examples)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_is_fully_typed(name: str) -> None:
    signature = inspect.signature(getattr(ag, name))
    assert signature.return_annotation is not inspect.Signature.empty
    assert all(p.annotation is not p.empty for p in signature.parameters.values())


def test_dir_lists_the_public_names_and_nothing_else() -> None:
    assert dir(ag) == sorted(ag.__all__)
    assert ag.__version__.count(".") == 2
    with pytest.raises(AttributeError, match="no attribute 'fit_everything'"):
        _ = ag.fit_everything


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, agonic; print([m for m in ('numpy', 'scipy', 'rich') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
