"""Directives whose tables come from the source: column names and the bibliography."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from agonic.citations import CITATIONS
from agonic.logs.headers.quantities import QUANTITIES, Quantity, canonical_header
from agonic.units import NANOTESLA_PER, RAW


class ColumnNames(SphinxDirective):
    """The table of canonical column names, their aliases and units."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        rows = ["| canonical | also understood | units |", "|---|---|---|"]
        rows += [f"| {' | '.join(_cells(quantity))} |" for quantity in QUANTITIES]
        return self.parse_text_to_nodes("\n".join(rows))


def _cells(quantity: Quantity) -> Iterator[str]:
    """Canonical header, aliases and units of a quantity."""
    axes = quantity.axes.split() or [" "]
    unit = "nT" if quantity.column == "field" else None
    yield ", ".join(f"`{canonical_header(quantity.column, axis.strip(), unit)}`" for axis in axes)
    preferred = f"; before all others: {quantity.preferred}" if quantity.preferred else ""
    weak = f"; where nothing else is: {quantity.weak}" if quantity.weak else ""
    yield quantity.aliases + preferred + weak
    yield " ".join((*NANOTESLA_PER, RAW) if quantity.column == "field" else quantity.units)


class Bibliography(SphinxDirective):
    """Every reference by its key."""

    def run(self) -> list[nodes.Node]:
        """A definition list."""
        entries = [f"`{key}`\n: {_linked(text)}\n" for key, text in sorted(CITATIONS.items())]
        return self.parse_text_to_nodes("\n".join(entries))


def _linked(text: str) -> str:
    """A reference with its DOI as a link."""
    before, found, doi = text.rpartition("doi:")
    return f"{before}[doi:{doi}](https://doi.org/{doi})" if found else text


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("column-names", ColumnNames)
    app.add_directive("bibliography", Bibliography)
    return {"parallel_read_safe": True}
