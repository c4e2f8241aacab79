"""The directive `public`: one line a name, each documented from its docstring."""

from __future__ import annotations

import inspect
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import agonic


class Public(SphinxDirective):
    """A table of public names with their first sentences, then each in full."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """The nodes of the names in the content."""
        names = [line.strip() for line in self.content if line.strip()]
        unknown = sorted(set(names) - set(agonic.__all__))
        if unknown:
            raise self.error(f"not public: {', '.join(unknown)}")
        text = "\n".join(["```{eval-rst}", *(_documented(name) for name in names), "```"])
        return self.parse_text_to_nodes(text)


def _documented(name: str) -> str:
    """The autodoc directive of a name."""
    thing = getattr(agonic, name)
    if not inspect.isclass(thing):
        return f".. autofunction:: agonic.{name}\n"
    if issubclass(thing, Exception):
        return f".. autoexception:: agonic.{name}\n   :show-inheritance:\n"
    return f".. autoclass:: agonic.{name}\n   :members:\n   :inherited-members: tuple, Readable\n"


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("public", Public)
    return {"parallel_read_safe": True}
