"""`FleetRun`: what became of a fleet."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from agonic.population import Duplicate, Outlier, Population
from agonic.readable import Shown


@dataclass(frozen=True, kw_only=True)
class FleetRun:
    """The table of a fleet, where it is kept, and how it came about.

    `outliers` and `duplicates` are what is unusual. `calibrated` logs and datasets were worked on,
    and `made` rows of them; `resumed` were finished by an earlier run, `repeated` have the content
    of another; `skipped` files of folders are no logs.
    """

    population: Population
    outliers: Annotated[tuple[Outlier, ...], Shown()]
    duplicates: Annotated[tuple[Duplicate, ...], Shown()]
    table: Annotated[Path, Shown()]
    page: Annotated[Path, Shown()]
    logs: Annotated[int, Shown()]
    datasets: Annotated[int, Shown()]
    calibrated: Annotated[int, Shown()]
    made: int
    resumed: Annotated[int, Shown()]
    repeated: Annotated[int, Shown()]
    skipped: Annotated[int, Shown()]
    seconds: Annotated[float, Shown()]

    @property
    def rate(self) -> Annotated[float, Shown(key="rows_per_second")]:
        """Rows made in a second."""
        return self.made / self.seconds if self.seconds else 0.0
