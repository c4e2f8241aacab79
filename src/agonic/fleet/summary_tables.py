"""What a fleet amounts to, in words and tables: verdicts, reasons, what stands out, duplicates."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from agonic.fleet.embedded_rows import VERDICTS, make_link
from agonic.population import Duplicate, Outlier, Population
from agonic.population.peers import LEAST, Peers
from agonic.report.digits import count, group_digits, percent, write_minus
from agonic.report.markup import Markup, element, markup, table
from agonic.report.tables import mark
from agonic.report.verdict import MEANINGS, sentence

MOST_NAMED = 200
"""Sensors that stand out are listed up to here; the table has all."""

MOST_REASONS = 30
_FIRST = re.compile(r"(?<=\.)\s+(?=[A-Z])")  # where a second sentence begins
_BEGIN = re.compile(r"[;:('\"\d]")  # before what differs from log to log
MOST_DUPLICATES = 100


def count_verdicts(population: Population) -> dict[str, int]:
    """How many rows have each verdict."""
    return {name: int((population["verdict"] == name).sum()) for name in VERDICTS}


def list_key_figures(
    population: Population, found: Sequence[Outlier], same: Sequence[Duplicate]
) -> list[tuple[str, str, str]]:
    """Sensors, logs, verdicts and what stands out, the numbers to look at first."""
    number, n = count_verdicts(population), max(len(population), 1)
    sensors, logs = (len(set(population[name].tolist())) for name in ("sensor", "source"))
    standing = len({one.sensor for one in found})
    return [
        ("Sensors", group_digits(sensors), "by their names"),
        ("Logs", group_digits(logs), count(len(population), "calibration")),
        *(
            (
                MEANINGS[name][0],
                group_digits(number[name]),
                f"{percent(number[name] / n)}, {MEANINGS[name][1]}",
            )
            for name in VERDICTS
        ),
        ("Stand out", group_digits(standing), "sensors unlike the others"),
        ("Duplicates", group_digits(len(same)), "logs that are there more than once"),
    ]


# ---- sensors that stand out ----------------------------------------------------------------------


def collect_notes(found: Sequence[Outlier]) -> dict[int, str]:
    """What is said of a row, all its sentences together."""
    said: dict[int, list[str]] = {}
    for one in found:
        said.setdefault(one.row, []).append(sentence(one.sentence))
    return {row: " ".join(sentences) for row, sentences in said.items()}


def list_outliers(
    population: Population, found: Sequence[Outlier], groups: Sequence[Peers]
) -> Markup:
    """The sensors that stand out, each with its sentences, the most striking first."""
    said = collect_notes(found)
    rank: dict[int, float] = {}
    for one in found:
        rank[one.row] = min(rank.get(one.row, 0.0), -one.distance)
    rows = sorted(said, key=lambda row: (rank[row], row))
    few = [group for group in groups if not group.enough]
    lines = [
        element(
            "p",
            f"{count(len(group), 'sensor')} ({group.name}) are too few to find what is usual: at "
            f"least {LEAST} are needed.",
            class_="aside",
        )
        for group in few
    ]
    if not rows:
        told = any(group.enough for group in groups)
        none = element("p", "No sensor stands out from the others.") if told else ""
        return markup(none, *lines)
    body = [
        (
            link_sensor(population, row),
            element("span", population["source"][row], class_="source"),
            write_minus(said[row]),
        )
        for row in rows[:MOST_NAMED]
    ]
    more = len(rows) - len(body)
    if more > 0:
        words = f"{count(more, 'more sensor')} of this kind: in the table, choose “stands out”."
        lines.append(element("p", words))
    return markup(
        table(("Sensor", "Log", "What is unlike the others"), body, class_="standing"), *lines
    )


def link_sensor(population: Population, row: int) -> Markup:
    """A sensor by its name, with a link to its report where there is one."""
    name, report = population["sensor"][row], population["report"][row]
    return markup(name) if report is None else element("a", name, href=make_link(report))


# ---- reasons -------------------------------------------------------------------------------------


@dataclass
class _Reason:
    number: dict[str, int] = field(default_factory=lambda: dict.fromkeys(VERDICTS, 0))
    examples: list[int] = field(default_factory=list)


def list_reasons(population: Population) -> Markup:
    """The first reason why each was refused or is to be checked, the most frequent first."""
    odd = np.flatnonzero(population["verdict"] != "good")
    if not len(odd):
        return element("p", "Every calibration is good.")
    found: dict[str, _Reason] = {}
    for row in odd.tolist():
        entry = found.setdefault(_get_reason(population, row), _Reason())
        entry.number[population["verdict"][row]] += 1
        if len(entry.examples) < 3:
            entry.examples.append(row)
    order = sorted(found, key=lambda r: (-found[r].number["refused"], -found[r].number["check"], r))
    body = [_make_reason_row(population, name, found[name]) for name in order[:MOST_REASONS]]
    head = ("Reason", "Refused", "To check", "For example")
    shown = table(head, body, class_="reasons")
    left = len(order) - len(body)
    return markup(shown, element("p", f"{count(left, 'other reason')}.") if left > 0 else "")


def _get_reason(population: Population, row: int) -> str:
    """The first finding of a row; where there is none, how its status begins."""
    findings: tuple[str, ...] = population["findings"][row]
    return findings[0] if findings else _BEGIN.split(population["status"][row])[0][:60].strip()


def _make_reason_row(population: Population, name: str, reason: _Reason) -> Sequence[str]:
    first = reason.examples[0]
    logs = ", ".join(dict.fromkeys(str(population["source"][row]) for row in reason.examples))
    status = write_minus(sentence(_FIRST.split(str(population["status"][first]))[0]))
    example = markup(status, " ", element("span", logs, class_="source"))
    return (name, *(group_digits(reason.number[v]) for v in ("refused", "check")), example)


# ---- the rest ------------------------------------------------------------------------------------


def describe_verdicts(number: Mapping[str, int]) -> Markup:
    """The words of the bar of verdicts."""
    parts = (
        mark(name, f"{group_digits(n)} {MEANINGS[name][0].lower()}") for name, n in number.items()
    )
    return element("p", *parts, class_="legend verdicts")


def list_duplicates(same: Sequence[Duplicate]) -> Markup:
    """The logs that are there more than once."""
    shown = [element("li", f"{one.sentence}.") for one in same[:MOST_DUPLICATES]]
    left = len(same) - len(shown)
    more = element("p", f"{count(left, 'more log')} of this kind.") if left > 0 else ""
    said = element("p", "Each counts once for what is usual.", class_="aside")
    return markup(said, element("ul", *shown, class_="duplicates"), more)
