"""`agonic reproduce`: the documents that agonic began with, each by one command."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from agonic.console.options import Json


def reproduce(
    document: Literal["samsat", "uav", "network", "patent"],
    out: Path | None = None,
    own: list[Path] | None = None,
    as_json: Json = False,
) -> int:
    """Make a published document again: its equations, figures, tables and claims.

    Each number is shown beside the document's, green where it is within the document's own limit
    and red where not. Exit status 1 where one is missed. The documents: a thermal chamber for a
    nanosatellite (samsat), a heading system (uav), a neural network (network), and the alignment
    with a star sensor (patent).

    Options
    -------
    document <DOCUMENT> : samsat, uav, network or patent.
    out -o DIR : Folder for report.html and all files.
    own --with DATA : Own data in place of the simulated; repeat it for a document of several
        inputs.
    """
    from contextlib import nullcontext
    from tempfile import TemporaryDirectory

    from agonic.atomic import make_folder
    from agonic.console.finish import finish
    from agonic.console.progress import progress
    from agonic.reproduce.report import describe_reproduction
    from agonic.reproduce.run import load_documents, with_own_data
    from agonic.reproduce.run import reproduce as reproduce_items

    source = load_documents()[document]
    if own:
        source = with_own_data(source, own)
    place = TemporaryDirectory() if out is None else nullcontext(str(make_folder(out)))
    with place as folder:
        home = Path(folder).resolve()
        rows = reproduce_items(source, home, lambda items: progress(items, document))
        made = describe_reproduction(source, rows, home)
        page = None if out is None else out / "report.html"
        finish(made, report=page, as_json=as_json)
    return 0 if all(row.verdict == "met" for row in rows) else 1
