"""Every public name can be imported, is explained, and shows how it is used."""

import doctest
import inspect
import pickle
import re
import subprocess
import sys
from importlib import import_module
from operator import attrgetter

import pytest

import agonic as ag

GROUPS = {group: import_module(f"agonic.{group}") for group in ag.GROUPS}
DAILY = [name for name in ag.__all__ if not name.startswith("__") and name not in GROUPS]
NAMES = [*DAILY, *(f"{group}.{name}" for group, of in GROUPS.items() for name in of.__all__)]


def find(name: str) -> object:
    return attrgetter(name)(ag)


ARRAYS = re.compile(r"\b(Array|ArrayLike|Mask|Index|NDArray)\b")
SHAPE = r"\((?:[a-z0-9…][ ,a-z0-9…·+]*)\)"
FUNCTIONS = [name for name in NAMES if inspect.isfunction(find(name))]


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_is_explained(name: str) -> None:
    said = inspect.getdoc(find(name))
    assert said
    assert said.splitlines()[0].endswith(".")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_shows_how_it_is_used(name: str) -> None:
    finder = doctest.DocTestFinder(recurse=False)
    examples = [example for test in finder.find(find(name)) for example in test.examples]
    assert any(name.rpartition(".")[2] in example.source for example in examples)


def parameters(function: object) -> list[inspect.Parameter]:
    every = inspect.signature(function).parameters.values()
    return [one for one in every if one.name not in ("self", "cls")]


def methods() -> list[tuple[str, object]]:
    """The public methods of public classes that take arrays."""
    return [
        (f"{name}.{key}", getattr(find(name), key))
        for name in NAMES
        if inspect.isclass(find(name)) and find(name).__module__.startswith("agonic")
        for key, value in vars(find(name)).items()
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
    function = find(name)
    said = inspect.getdoc(function).split(">>>")[0]
    unsaid = [p.name for p in parameters(function) if not re.search(rf"\b{p.name}\b", said)]
    assert (unsaid, without_shape(function)) == ([], [])


@pytest.mark.parametrize(("name", "method"), methods())
def test_every_public_method_says_the_shapes_of_its_arrays(name: str, method: object) -> None:
    assert without_shape(method) == []


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_is_fully_typed(name: str) -> None:
    signature = inspect.signature(find(name))
    assert signature.return_annotation is not inspect.Signature.empty
    assert all(p.annotation is not p.empty for p in signature.parameters.values())


def test_dir_lists_the_public_names_and_nothing_else() -> None:
    assert dir(ag) == sorted(ag.__all__)
    assert ag.__version__.count(".") == 2
    with pytest.raises(AttributeError, match="no attribute 'fit_everything'"):
        _ = ag.fit_everything


@pytest.mark.parametrize("group", GROUPS)
def test_dir_of_a_group_lists_its_names(group: str) -> None:
    assert dir(GROUPS[group]) == sorted(GROUPS[group].__all__)
    assert getattr(ag, group) is GROUPS[group]
    with pytest.raises(AttributeError, match="no attribute 'fit_everything'"):
        _ = GROUPS[group].fit_everything


def test_the_list_of_names_is_short() -> None:
    assert len(dir(ag)) < 80


def test_names_that_moved_work_with_a_warning() -> None:
    with pytest.warns(DeprecationWarning, match=r"agonic\.thermal\.plan_thermal"):
        assert ag.plan_thermal is ag.thermal.plan_thermal
    assert ag.fit_thermal.__wrapped__ is ag.thermal.fit_thermal.__wrapped__
    assert ag.write_px4.__wrapped__ is ag.exports.write_px4.__wrapped__


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_can_be_sent_to_another_process(name: str) -> None:
    assert pickle.loads(pickle.dumps(find(name))) is find(name)


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, agonic; print([m for m in ('numpy', 'scipy', 'rich') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
