"""The directive `public`: one line a name, each documented from its docstring."""

from __future__ import annotations

import inspect
from importlib import import_module
from types import ModuleType
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import agonic


class Public(SphinxDirective):
    """A table of public names with their first sentences, then each in full."""

    has_content = True
    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The nodes of the names in the content, of agonic or of the group in the argument."""
        names = [line.strip() for line in self.content if line.strip()]
        package = import_module(".".join(["agonic", *self.arguments]))
        unknown = sorted(set(names) - set(package.__all__))
        if unknown:
            raise self.error(f"not public: {', '.join(unknown)}")
        text = "\n".join(["```{eval-rst}", *(_documented(package, name) for name in names), "```"])
        return self.parse_text_to_nodes(text)


def _documented(package: ModuleType, name: str) -> str:
    """The autodoc directive of a name."""
    thing, named = getattr(package, name), f"{package.__name__}.{name}"
    if not inspect.isclass(thing):
        return f".. autofunction:: {named}\n"
    if issubclass(thing, Exception):
        return f".. autoexception:: {named}\n   :show-inheritance:\n"
    again = "   :no-index:\n" if package is not agonic and name in agonic.__all__ else ""
    return f".. autoclass:: {named}\n   :members:\n   :inherited-members: tuple, Readable\n{again}"


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("public", Public)
    return {"parallel_read_safe": True}
