"""Whatever a public name is given that it does not take, it says what it was given and needs."""

import dataclasses
import inspect
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import agonic as ag
from agonic.misuse import explain_misuse
from tests.test_public_names import FUNCTIONS, NAMES, find

WRONG = {
    "a thing": object(),
    "a number": 3.5,
    "words": "north",
    "nothing": None,
    "a list": [1, "a"],
}

MADE_BY_HAND = [
    name
    for name in NAMES
    if dataclasses.is_dataclass(find(name))
    and not any(part in name for part in ("Fit", "Calibrated", "Simulated", "State", "Coverage"))
]
"""Classes that people make themselves, not those that a fit returns."""


def required(thing: Any) -> list[str]:
    every = inspect.signature(thing).parameters.values()
    return [p.name for p in every if p.default is p.empty and p.kind is not p.VAR_KEYWORD]


def call(thing: Any, value: Any) -> None:
    """Call with one value for all that is required."""
    given = dict.fromkeys(required(thing), value)
    bound = inspect.signature(thing).bind_partial()
    bound.arguments.update(given)
    thing(*bound.args, **bound.kwargs)


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("name", [name for name in FUNCTIONS if required(find(name))])
def test_functions_tell_what_they_need(
    name: str, wrong: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with suppress(ag.AgonicError):  # all else is an error of the test
        call(find(name), wrong)


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("name", MADE_BY_HAND)
def test_nouns_tell_what_they_need(name: str, wrong: Any) -> None:
    if not required(find(name)):
        return
    with suppress(ag.AgonicError):  # all else is an error of the test
        call(find(name), wrong)


def test_the_sentence_names_what_was_given_and_what_is_needed() -> None:
    setup = ag.Setup(compasses=(ag.Compass(calibration=ag.Affine(bias=[0] * 3, matrix=np.eye(3))),))
    with pytest.raises(ag.AgonicError) as told:
        ag.heading(setup, ag.Samples(field=[[20_000.0, 0.0, 40_000.0]]))
    assert str(told.value).startswith("heading: samples was given as Setup; needed: ")
    assert "; heading: setup was given as Samples" in str(told.value).replace("\n", " ")
    with pytest.raises(ag.AgonicError, match=r"calibration was given as str \('mag.json'\)"):
        ag.Compass(calibration="mag.json")


def test_an_error_of_another_cause_stays_what_it_is() -> None:
    def fail(number: float) -> None:
        raise ValueError("something else")

    with pytest.raises(ValueError, match="something else"):
        explain_misuse(fail, "agonic")(3.0)
    with pytest.raises(ag.AgonicError, match="fail: number was given as str"):
        explain_misuse(fail, "agonic")("three")
