"""What became of the calibration of one sensor over time: trends, steps and outliers."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from agonic.arrays import Index
from agonic.health import Finding
from agonic.health.finding import Judged
from agonic.history.trend import Trend
from agonic.population import Population
from agonic.readable import Shown


@dataclass(frozen=True)
class ParameterChange:
    """By how much one parameter moved, with its standard deviation."""

    name: Annotated[str, Shown(key="parameter")]
    unit: Annotated[str, Shown()]
    size: Annotated[float, Shown()]
    sd: Annotated[float, Shown()]


@dataclass(frozen=True)
class Event:
    """What happened: a "step" between two calibrations, an "outlier", or a "last" one that is off.

    It lies after `after` and not later than `before`, the moment of calibration number `place` (of
    those that are compared). `p_value` is how often chance makes one like it anywhere in the
    history; `parameters` are those in which it shows.
    """

    kind: Annotated[str, Shown()]
    place: int
    after: Annotated[datetime, Shown()]
    before: Annotated[datetime, Shown()]
    p_value: Annotated[float, Shown()]
    parameters: Annotated[tuple[ParameterChange, ...], Shown()]


@dataclass(frozen=True, kw_only=True, eq=False)
class Drift(Judged):
    """How one sensor moved: a trend for each parameter, what happened, and findings.

    `population` holds all calibrations in order of time, `compared` the numbers of those that were
    compared. `trends` is empty where they are too few. `verdict`, `ok` and `status` as for a fit.
    """

    sensor: str
    at: datetime
    population: Population
    compared: Index
    trends: tuple[Trend, ...]
    events: tuple[Event, ...]
    findings: tuple[Finding, ...]
    remarks: tuple[str, ...]

    def trend(self, name: str) -> Trend:
        """The trend of "bias x" … "cross yz"; raises `KeyError` for one that is not followed."""
        return {one.name: one for one in self.trends}[name]
