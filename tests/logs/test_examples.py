"""Examples of functions inside the readers, by module, in `examples.md`: they hold as written."""

from __future__ import annotations

import doctest
import re
from importlib import import_module
from pathlib import Path

import pytest

_TEXT = Path(__file__).with_name("examples.md").read_text("utf-8")
_SECTIONS = re.split(r"^## ", _TEXT, flags=re.M)


@pytest.mark.parametrize("section", _SECTIONS[1:], ids=lambda text: text.partition("\n")[0])
def test_examples_hold(section: str) -> None:
    module = section.partition("\n")[0].strip()
    names = dict(vars(import_module(module)))
    for text in re.split(r"^`\w+`:\n", section, flags=re.M)[1:]:
        example = doctest.DocTestParser().get_doctest(text, names, module, "examples.md", 0)
        assert doctest.DocTestRunner().run(example, clear_globs=False).failed == 0, text
