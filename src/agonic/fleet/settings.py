"""`FleetSettings`: what was asked of every log of a fleet."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated

from agonic.errors import AgonicError, check_choice
from agonic.field.decimal_year import decimal_year
from agonic.population import Duplicate, Outlier, Population
from agonic.readable import Shown
from agonic.reference import Reference
from agonic.units import find_unit
from agonic.version import __version__

METHODS = ("auto", "ellipsoid", "levelled", "inertial", "vector")


@dataclass(frozen=True, kw_only=True, slots=True)
class FleetSettings:
    """What was asked of every log, as for `agonic calibrate`.

    Parameters
    ----------
    unit : of the field where a log names none.
    at : latitude, longitude (degrees) and altitude (metres), where all logs were recorded.
    date : for the world model; without, each log's own.
    undated : the date of logs that know none, where `date` is not given; today at the first run.
    field_nT : magnitude of the field, nT, where it is known.
    method : "auto", "ellipsoid", "levelled", "inertial" or "vector".
    sensor : name or number of the sensor to take from each log; without, all.
    name : a regular expression whose group in a log's path is who the sensor is.
    sensor_column : the column of a Parquet dataset that tells its sensors apart.
    files, reports : whether calibration files, or whole folders with a report, are written of logs

    >>> FleetSettings(unit="uT").asked
    '{"unit": "uT", "method": "auto"}'
    """

    unit: str | None = None
    at: tuple[float, float, float] | None = None
    date: str | None = None
    undated: str | None = None
    field_nT: float | None = None
    method: str = "auto"
    sensor: str | None = None
    name: str | None = None
    sensor_column: str | None = None
    files: bool = False
    reports: bool = False

    def __post_init__(self) -> None:
        check_choice("method", self.method, METHODS)
        if self.unit is not None:
            find_unit(self.unit)
        if self.date is not None:
            decimal_year(self.date)
        if self.field_nT is not None:
            Reference.constant(self.field_nT)
        if self.name is not None:
            try:
                re.compile(self.name)
            except re.error as error:
                raise AgonicError(f"name {self.name!r} is no regex: {error}") from None

    @property
    def asked(self) -> str:
        """What the figures depend on, as JSON."""
        kept = {name: value for name, value in asdict(self).items() if name not in _APART}
        return json.dumps({name: value for name, value in kept.items() if value is not None})

    @property
    def work(self) -> str:
        """What a finished row depends on beside the content of its log, as one digest."""
        return digest(self.asked, self.files or self.reports, self.reports)


_APART = ("name", "files", "reports", "undated")


def digest(*parts: object) -> str:
    """One digest of some parts and the version of the software."""
    return sha256(json.dumps([*map(str, parts), __version__]).encode()).hexdigest()


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
