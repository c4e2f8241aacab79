"""`Compared`: a population with what is unusual in it, said in its rows."""

from __future__ import annotations

from dataclasses import dataclass

from agonic.population.duplicate import Duplicate, find_duplicates
from agonic.population.outlier import Outlier, find_outliers
from agonic.population.population import Population


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
