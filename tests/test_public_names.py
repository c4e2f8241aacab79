"""Every public name can be imported, is explained, and shows how it is used."""

import doctest
import inspect
import re
import subprocess
import sys

import pytest

import agonic as ag

NAMES = [name for name in ag.__all__ if not name.startswith("__")]
ARRAYS = re.compile(r"\b(Array|ArrayLike|Mask|Index|NDArray)\b")
SHAPE = r"\((?:[a-z0-9…][ ,a-z0-9…·+]*)\)"
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


def parameters(function: object) -> list[inspect.Parameter]:
    every = inspect.signature(function).parameters.values()
    return [one for one in every if one.name not in ("self", "cls")]


def methods() -> list[tuple[str, object]]:
    """The public methods of public classes that take arrays."""
    return [
        (f"{name}.{key}", getattr(getattr(ag, name), key))
        for name in NAMES
        if inspect.isclass(getattr(ag, name)) and getattr(ag, name).__module__.startswith("agonic")
        for key, value in vars(getattr(ag, name)).items()
        if not key.startswith("_")
        and (inspect.isfunction(value) or isinstance(value, classmethod | staticmethod))
    ]


def without_shape(function: object) -> list[str]:
    """The parameters that take arrays and whose shape does not follow their name."""
    said = " ".join((inspect.getdoc(function) or "").split(">>>")[0].split())
    arrays = [p.name for p in parameters(function) if ARRAYS.search(str(p.annotation))]
    return [name for name in arrays if not re.search(rf"\b{name}\b[^.;]*?{SHAPE}", said)]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_names_its_parameters_and_the_shapes_of_arrays(name: str) -> None:
    function = getattr(ag, name)
    said = inspect.getdoc(function).split(">>>")[0]
    unsaid = [p.name for p in parameters(function) if not re.search(rf"\b{p.name}\b", said)]
    assert (unsaid, without_shape(function)) == ([], [])


@pytest.mark.parametrize(("name", "method"), methods())
def test_every_public_method_says_the_shapes_of_its_arrays(name: str, method: object) -> None:
    assert without_shape(method) == []


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
