"""What is said and shown of the calibrations of many sensors: a page, and the end of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agonic.fleet import summary_tables as tables
from agonic.fleet.group_section import describe_group
from agonic.fleet.summary_tables import embed_rows
from agonic.population import Outlier, Population, find_duplicates, find_outliers
from agonic.population.peers import Peers, find_peers
from agonic.readable import make_record
from agonic.report.digits import count, group_digits
from agonic.report.document import Document
from agonic.report.markup import Markup, element, markup
from agonic.report.section import Section, aside
from agonic.report.tables import draw_bar

if TYPE_CHECKING:
    from agonic.fleet.settings import FleetRun

MOST_GROUPS = 4
MAX_NAMED = 8
"""Of the sensors unlike the others, how many are named."""
MAX_REASONS = 5
"""How many reasons are told to people; programs are told all."""
_SHOWN = ("bias", "axes")  # quantities that a figure of biases shows


def describe_population(
    population: Population, *, title: str, outliers: Sequence[Outlier] | None = None
) -> Document:
    """The calibrations of many sensors as a page to look at and to search. Its page is dark and
    light, and has the same bytes for the same rows."""
    found = find_outliers(population) if outliers is None else outliers
    groups, same = find_peers(population), find_duplicates(population)
    notes = tables.collect_notes(found)
    noted = _mark_rows(len(population), found)
    belongs = _assign_groups(population, groups)
    verdicts = tables.count_verdicts(population)
    words = ", ".join(f"{n} {name}" for name, n in verdicts.items())
    bar = draw_bar([(f"share {name}", n) for name, n in verdicts.items()], words)
    shares = markup(bar, tables.describe_verdicts(verdicts))
    drawn = enumerate(groups[:MOST_GROUPS])
    rows = embed_rows(population, belongs, notes, noted)
    none = f"{count(len(population), 'calibration')} to search, sort and select with JavaScript on."
    table = element("div", element("p", none, class_="script-off"), id="browse")
    return Document(
        kind="Calibrations of many magnetometers",
        name=title,
        key_figures=tables.list_key_figures(population, found, same),
        sections=[
            Section("", [shares]),
            Section("What stands out", [tables.list_outliers(population, found, groups)]),
            Section("Refused, and to be checked", [tables.list_reasons(population)]),
            *(describe_group(g, k, np.flatnonzero(belongs == k), noted == 2) for k, g in drawn),
            Section("", _list_others(groups[MOST_GROUPS:])),
            Section("Duplicates", [tables.list_duplicates(same)] if same else []),
            Section("All calibrations", [table, rows]),
        ],
        styles=["fleet.css"],
        scripts=["fleet_rows.js", "fleet_table.js", "fleet_figures.js", "fleet.js"],
    )


def describe_run(run: FleetRun) -> Document:
    """What a run over a fleet came to, for people and for programs."""
    verdicts = tables.count_verdicts(run.population)
    reasons = count_reasons(run.population)
    words = ", ".join(f"{n} {word}" for word, n in verdicts.items())
    read = [count(run.logs, "log")] if run.logs or not run.datasets else []
    read += [count(run.datasets, "dataset")] if run.datasets else []
    return Document(
        schema="agonic/fleet@1",
        name="fleet",
        status=f"{' and '.join(read)}, {count(len(run.population), 'calibration')}: {words}",
        sections=[
            Section("", [_describe_work(run)], printed=True),
            _list_reasons(reasons),
            Section("", _list_unusual(run), printed=True),
        ],
        values={
            **make_record(run),
            "rows": len(run.population),
            "verdicts": verdicts,
            "reasons": [{"reason": reason, "rows": rows} for reason, rows in reasons],
            "logs_per_second": run.calibrated / run.seconds if run.seconds else 0.0,
        },
    )


# ---- the end of a run ----------------------------------------------------------------------------


def count_reasons(population: Population) -> list[tuple[str, int]]:
    """Why rows are not good, the most frequent first: the gravest finding, or what was said."""
    columns = (population[name].tolist() for name in ("verdict", "findings", "status"))
    counts = Counter(
        findings[0] if findings else status
        for verdict, findings, status in zip(*columns, strict=True)
        if verdict != "good"
    )
    return sorted(counts.items(), key=lambda pair: (-pair[1], pair[0]))


def _describe_work(run: FleetRun) -> str:
    parts = (
        (run.calibrated, f"{run.made} made in {run.seconds:.1f} s ({run.rate:.3g} a second)"),
        (run.resumed, f"{run.resumed} were finished before"),
        (run.repeated, f"{run.repeated} have the content of another"),
        (run.skipped, f"{count(run.skipped, 'file')} of another kind left out"),
    )
    return "; ".join(text for n, text in parts if n)


def _list_reasons(reasons: Sequence[tuple[str, int]]) -> Section:
    lines = [f"{rows:>6}  {reason}" for reason, rows in reasons[:MAX_REASONS]]
    others = sum(rows for _, rows in reasons[MAX_REASONS:])
    lines += [f"{others:>6}  other reasons"] if others else []
    return Section("Not good, because of", lines, printed=True)


def _list_unusual(run: FleetRun) -> list[str]:
    sensors = sorted({outlier.sensor for outlier in run.outliers})
    lines = []
    if sensors:
        more = len(sensors) - MAX_NAMED
        names = ", ".join(sensors[:MAX_NAMED]) + (
            f" and {group_digits(more)} more" if more > 0 else ""
        )
        lines.append(f"{count(len(sensors), 'sensor')} unlike the others: {names}")
    if run.duplicates:
        lines.append(f"{count(len(run.duplicates), 'log')} more than once")
    return lines


# ---- the page ------------------------------------------------------------------------------------


def _mark_rows(rows: int, found: Sequence[Outlier]) -> NDArray[np.uint8]:
    """0 for rows like the others, 1 for those that stand out, 2 where the bias does."""
    noted = np.zeros(rows, dtype=np.uint8)
    for one in found:
        noted[one.row] = max(int(noted[one.row]), 2 if one.quantity in _SHOWN else 1)
    return noted


def _assign_groups(population: Population, groups: Sequence[Peers]) -> NDArray[np.int8]:
    """The group of every calibration, −1 where it has none."""
    belongs = np.full(len(population), -1, dtype=np.int8)
    for k, group in reversed(list(enumerate(groups[:MOST_GROUPS]))):
        units = (population["unit_in"] == group.unit_in) & (
            population["unit_out"] == group.unit_out
        )
        if group.channel is None:
            channels = {g.channel for g in groups if g.unit_in == group.unit_in} - {None}
            units &= ~np.isin(population["channel"].astype(str), sorted(map(str, channels)))
        else:
            units &= population["channel"] == group.channel
        belongs[units & population.fitted] = k
    return belongs


def _list_others(groups: Sequence[Peers]) -> list[Markup]:
    if not groups:
        return []
    said = "; ".join(f"{group.name}: {count(len(group), 'sensor')}" for group in groups)
    return [aside(f"Not drawn, because they are few: {said}.")]
