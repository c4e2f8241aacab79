"""`FleetRun`: what became of a fleet."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from agonic.population import Duplicate, Outlier, Population


@dataclass(frozen=True, kw_only=True)
class FleetRun:
    """The table of a fleet, where it is kept, and how it came about.

    `outliers` and `duplicates` are what is unusual. `calibrated` logs and datasets were worked on,
    and `made` rows of them; `resumed` were finished by an earlier run, `repeated` have the content
    of another; `skipped` files of folders are no logs.
    """

    population: Population
    outliers: tuple[Outlier, ...]
    duplicates: tuple[Duplicate, ...]
    table: Path
    page: Path
    logs: int
    datasets: int
    calibrated: int
    made: int
    resumed: int
    repeated: int
    skipped: int
    seconds: float

    @property
    def rate(self) -> float:
        """Rows made in a second."""
        return self.made / self.seconds if self.seconds else 0.0
