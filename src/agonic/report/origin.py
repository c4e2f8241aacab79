"""Where a result came from that is no calibration: files with their checksums, and the software."""

from __future__ import annotations

from collections.abc import Sequence

from agonic.citations import find_citation
from agonic.provenance import Input, Provenance
from agonic.report.digits import count
from agonic.report.section import Section


def list_inputs(*inputs: Input | None, method: Sequence[str] = (), equation: str = "") -> Section:
    """A section of the files with their checksums, each once, the software, published sources.

    >>> made = list_inputs(Input(name="log.csv", sha256="ab", count=3), None)
    >>> made.blocks[0]["Inputs"]
    'log.csv, 3 rows, SHA-256 ab'
    """
    files = {one.sha256: one for one in inputs if one is not None}
    made = Provenance()
    entries = {
        "Equation": equation,
        "Inputs": "; ".join(
            f"{one.name}, {count(one.count, 'row')}, SHA-256 {one.sha256}" for one in files.values()
        ),
        "Software": f"{made.software}, {made.created}",
        "Sources": "; ".join(map(find_citation, method)),
    }
    return Section("Provenance", [{name: said for name, said in entries.items() if said}])
