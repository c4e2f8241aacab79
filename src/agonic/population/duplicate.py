"""`Duplicate`: the same log more than once in a population."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from agonic.population.outlier import Outlier, find_outliers
from agonic.population.population import Population
from agonic.readable import Shown


@dataclass(frozen=True)
class Duplicate:
    """Logs with the same content: their names, and the sensors that they are said to be of.
    `contested` where one channel of them is said to be of several sensors."""

    sha256: str
    sources: Annotated[tuple[str, ...], Shown()]
    sensors: Annotated[tuple[str, ...], Shown()]
    rows: tuple[int, ...]
    contested: bool

    @property
    def sentence(self) -> Annotated[str, Shown()]:
        """What is the same."""
        if len(self.sources) == 1:
            return f"{_list_names(self.sensors)} of {self.sources[0]} have the same readings"
        said = f"{_list_names(self.sources)} are the same log"
        if self.contested:
            said += f", said to be of {len(self.sensors)} sensors: {_list_names(self.sensors)}"
        return said


def find_duplicates(population: Population) -> tuple[Duplicate, ...]:
    """Logs that are in a population more than once, under other names or of other sensors. Source:
    equal digests are equal content (FIPS 180-4)."""
    by_digest: dict[str, list[int]] = {}
    for row, digest in enumerate(population["sha256"].tolist()):
        if digest:
            by_digest.setdefault(digest, []).append(row)
    found = []
    for digest, rows in by_digest.items():
        sources = tuple(dict.fromkeys(population["source"][rows].tolist()))
        if len(sources) > 1:
            sensors = population["sensor"][rows].tolist()
            said = set(zip(population["channel"][rows].tolist(), sensors, strict=True))
            contested = len(said) > len({channel for channel, _ in said})
            named = tuple(dict.fromkeys(sensors))
            found.append(Duplicate(digest, sources, named, tuple(rows), contested))
    known = {row for one in found for row in one.rows}
    return (
        *found,
        *(one for one in _find_within_sources(population) if not known.issuperset(one.rows)),
    )


def _find_within_sources(population: Population) -> Iterator[Duplicate]:
    """Sensors of one source whose bias and noise agree in seven digits, which is no chance."""
    figures = np.column_stack([population.bias, population["noise"]]).astype(np.float32)
    usable = np.flatnonzero(np.isfinite(figures).all(axis=1) & (figures != 0).all(axis=1))
    by_figures: dict[tuple[str, bytes], list[int]] = {}
    for row, digits in zip(usable.tolist(), figures[usable], strict=True):
        by_figures.setdefault((population["source"][row], digits.tobytes()), []).append(row)
    for (source, _), rows in by_figures.items():
        sensors = tuple(dict.fromkeys(population["sensor"][rows].tolist()))
        if len(sensors) > 1:
            digest = population["sha256"][rows[0]]
            yield Duplicate(digest, (source,), sensors, tuple(rows), True)


def _list_names(names: tuple[str, ...]) -> str:
    """Names as a sentence has them; of many, the first few."""
    shown = names if len(names) <= 5 else (*names[:4], f"{len(names) - 4} more")
    return f"{', '.join(shown[:-1])} and {shown[-1]}"


@dataclass(frozen=True)
class Compared:
    """A population whose column `unusual` is filled, and what it was filled from."""

    population: Population
    outliers: tuple[Outlier, ...]
    duplicates: tuple[Duplicate, ...]


def compare(population: Population) -> Compared:
    """Set each sensor against the others, and say in its row what is unlike them.

    >>> from agonic.population import Row
    >>> rows = [Row(sensor=s, source=f"{s}.csv", sha256="5e", verdict="good", status="")
    ...         for s in "ab"]
    >>> compare(Population.of(rows)).population["unusual"][0]
    'a.csv and b.csv are the same log, said to be of 2 sensors: a and b.'
    """
    found, same = find_outliers(population), find_duplicates(population)
    said: dict[int, list[str]] = {}
    for one in found:
        said.setdefault(one.row, []).append(one.sentence[:1].upper() + one.sentence[1:])
    for copies in same:
        for row in copies.rows:
            said.setdefault(row, []).append(copies.sentence)
    unusual = population["unusual"].copy()
    for row, sentences in said.items():
        unusual[row] = " ".join(f"{text.rstrip('.')}." for text in sentences)
    return Compared(Population({**population.columns, "unusual": unusual}), found, same)
