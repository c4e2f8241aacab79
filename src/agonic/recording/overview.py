"""The first screen of a log with several magnetometers: a few lines for each, and what to load."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from agonic.health import Finding, sort_findings
from agonic.recording.calibrated import Calibrated
from agonic.recording.numbers import describe_heading, describe_origin
from agonic.report import tables
from agonic.report.text import SIGNS, wrap
from agonic.report.verdict import sentence

USE = {"good": "use it", "check": "look at this first", "refused": "do not use it"}
"""What each verdict means for whoever has to decide."""


def say_overview(
    results: Sequence[Calibrated],
    failures: Sequence[tuple[str, str]],
    files: Mapping[str, Sequence[str]],
    width: int,
) -> Iterator[str]:
    """A sensor's verdict, its heading's error and what makes it, and its gravest objection; then
    which file holds which compasses. Every number, note and check is said with --verbose."""
    yield wrap(describe_origin(results), width=width, indent="")
    for result in results:
        yield from _say_sensor(result, width)
    for name, why in failures:
        yield wrap(f"{name}: refused, {USE['refused']}", width=width, indent="", label="✗ ")
        yield wrap(sentence(why), width=width)
    yield from _say_files(results, files, width)


def _say_sensor(result: Calibrated, width: int) -> Iterator[str]:
    said = [f"{result.samples.name}: {result.verdict}"]
    if result.verdict != "refused":
        largest = ", ".join(tables.list_shares(result.fit.shares)[:1])
        made = f" ({largest})" if largest else ""
        said.append(f"heading good to {describe_heading(result)[0]}{made}")
    said.append(USE[result.verdict])
    yield wrap(", ".join(said), width=width, indent="", label=f"{SIGNS[result.verdict]} ")
    grave = list_grave(result)
    if grave:
        more = f" (and {len(grave) - 1} more)" if len(grave) > 1 else ""
        yield wrap(f"{sentence(grave[0].sentence)}{more}", width=width)


def list_grave(result: Calibrated) -> list[Finding]:
    """What speaks against a result, the gravest first."""
    return [one for one in sort_findings(result.objections) if one.severity != "note"]


def _say_files(
    results: Sequence[Calibrated], files: Mapping[str, Sequence[str]], width: int
) -> Iterator[str]:
    """What to load, where one file is for all compasses."""
    of_all = {Path(file).name for names in files.values() for file in names}
    one = next((name for name in sorted(of_all) if name.startswith("compass.")), None)
    if one is None:
        return
    loaded = [r.samples.name for r in results if r.verdict != "refused"]
    left = [r.samples.name for r in results if r.verdict == "refused"]
    words = f"{one} ({', '.join(loaded)}{'; not ' + ', '.join(left) if left else ''})"
    yield ""
    yield wrap(words, width=width, indent="", label="Load      ")
