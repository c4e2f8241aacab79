"""`Description`: what a campaign is about: sensors, stations, profile, the chamber's field."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from math import hypot, sqrt
from typing import NamedTuple

from scipy.spatial.transform import Rotation

from agonic.errors import AgonicError
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.maths.stations import describe_pose, list_standard_rotations


def join_numbers(numbers: Iterable[int]) -> str:
    """Numbers in words, runs of three and more drawn together."""
    left = sorted(set(numbers))
    parts: list[str] = []
    while left:
        run = 1
        while run < len(left) and left[run] == left[0] + run:
            run += 1
        if run < 3:
            run = 1
        parts.append(f"{left[0]}–{left[run - 1]}" if run > 1 else f"{left[0]}")
        left = left[run:]
    return ", ".join(parts)


def name_stations(numbers: Iterable[int]) -> str:
    """Stations by number."""
    given = set(numbers)
    return f"station{'s' if len(given) > 1 else ''} {join_numbers(given)}"


class Told(NamedTuple):
    """What is said of a kind of fault: the finding's name, its message, and what to do."""

    name: str
    message: str
    action: str


@cache
def list_standard_stations() -> tuple[Station, ...]:
    """The twelve stations of `thermal.maths.stations`, numbered in the order of least handling."""
    return tuple(
        Station(number=number, pose=describe_pose(turned), rot_nb=Rotation.from_matrix(turned))
        for number, turned in enumerate(list_standard_rotations(), start=1)
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Station:
    """One static position: its `number`, the `pose` in words, and how the box stands.

    `rot_nb` turns the axes of the box into those of the chamber; `None` where it is not known.
    `file` is its recording, "" where the description's pattern names it.
    """

    number: int
    pose: str = ""
    rot_nb: Rotation | None = None
    file: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Description:
    """What one has to know to make sense of the recordings of a campaign.

    Parameters
    ----------
    sensors : those under test; none where the files are to tell.
    stations : the static positions.
    files : the name of a station's recording with {station} for its number, a pattern such as
        "*.csv", or one file with all stations.
    profile : the programme of the chamber; `None` where it is not known.
    magnitude : of the chamber's field, nT; inclination_deg : its dip, where known.
    rate_Hz : readings a second. name : of the campaign. notes : what to say of it.
    assumed : nobody described the stations: those of the standard are taken until readings say no.
    unit : of the field, where neither files nor sensors say. columns : the headers of columns that
        all sensors share, by what they hold (time, temperature).
    """

    sensors: tuple[Sensor, ...] = ()
    stations: tuple[Station, ...] = ()
    assumed: bool = False
    files: str = ""
    profile: Profile | None = None
    magnitude: float | None = None
    inclination_deg: float | None = None
    rate_Hz: float | None = None
    name: str = ""
    fixture_sd_deg: float = 1.0
    notes: tuple[str, ...] = field(default_factory=tuple)
    unit: str | None = None
    columns: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for what, given in (
            ("sensor", [sensor.name for sensor in self.sensors]),
            ("station", [station.number for station in self.stations]),
        ):
            twice = find_repeated(given)
            if twice:
                raise AgonicError(f"{what} {', '.join(map(str, twice))} is described twice")

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the stations."""
        return tuple(station.number for station in self.stations)

    @property
    def rotations(self) -> dict[int, Rotation] | None:
        """How the box stands at each station; `None` where that is not known of all."""
        known = {s.number: s.rot_nb for s in self.stations if s.rot_nb is not None}
        return known if known and len(known) == len(self.stations) else None


def find_repeated(values: Iterable[object]) -> list[object]:
    """The values that are there more than once."""
    return [value for value, times in Counter(values).items() if times > 1]


@dataclass(frozen=True, kw_only=True)
class Model:
    """A kind of magnetometer: `step` of its readings, `limit` of its range, `noise`, all nT.

    `noise` is the standard deviation of one reading on one axis before rounding to steps.
    """

    name: str
    step: float
    limit: float
    noise: float

    @property
    def reading_sd(self) -> float:
        """The noise of a reading with that of rounding, nT: √(noise² + step²/12)."""
        return hypot(self.noise, self.step / sqrt(12.0))


MODELS = {
    model.name: model
    for model in (
        Model(name="MMC5883MA", step=25.0, limit=800e3, noise=100.0),
        Model(name="MPU-9255", step=150.0, limit=4800e3, noise=400.0),
    )
}
"""Steps and ranges: Nikolaev et al. 2023, section 1.2; noise: of that order, state your own."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """One magnetometer of a campaign.

    `name` is what it is called; `column` what the files call it ("" for the name itself); `model`
    what it is; `unit` that of its readings where the files do not say; `noise` the standard
    deviation of a reading, nT, where it is known; `board` where it sits; `temperature_of` the
    sensor whose temperature is taken in place of its own; `columns` the headers of its columns by
    what they hold (x, y, z, temperature, time), where they do not say it.
    """

    name: str
    column: str = ""
    model: str = ""
    unit: str | None = None
    noise: float | None = None
    board: str = ""
    temperature_of: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)

    @property
    def reading_sd(self) -> float | None:
        """The noise of one reading, nT, as stated or as usual for the model."""
        if self.noise is not None:
            return self.noise
        return MODELS[self.model].reading_sd if self.model in MODELS else None


_ENTRY = re.compile(r"(?:(?P<times>\d+)\s*[x×]\s*)?(?P<model>[^=:]+?)(?::(?P<noise>[\d.]+))?")


def parse_sensors(text: str) -> tuple[Sensor, ...]:
    """The sensors of a list such as "2xMMC5883MA, 3xMPU-9255:400", noise in nT after the colon.

    Several of one model are numbered. Raises `AgonicError` for what is no list, and for a model
    that is not known and comes without noise.
    """
    found: list[Sensor] = []
    for entry in filter(None, (part.strip() for part in text.split(","))):
        match = _ENTRY.fullmatch(entry)
        times = int(match["times"] or 1) if match else 0
        if match is None or not 1 <= times <= 64:
            raise AgonicError(
                f"{entry!r} is not a sensor; write a model, 2xMODEL for two, MODEL:NOISE with the "
                "noise of a reading in nT"
            )
        model = _spell(match["model"].strip())
        noise = None if match["noise"] is None else float(match["noise"])
        if model not in MODELS and not noise:
            raise AgonicError(
                f"the noise of a {model} is not known; write {model}:NOISE, in nT "
                f"(known: {', '.join(MODELS)})"
            )
        found += [Sensor(name=model, model=model, noise=noise)] * times
    if not found:
        raise AgonicError("no sensors were named; write for instance 2xMMC5883MA,3xMPU-9255")
    return number_sensors(found)


def number_sensors(sensors: list[Sensor]) -> tuple[Sensor, ...]:
    """The sensors with a number after each name that occurs more than once."""
    names = [sensor.name for sensor in sensors]
    made = []
    for k, sensor in enumerate(sensors):
        many = names.count(sensor.name) > 1
        own = f"{sensor.name}-{names[:k].count(sensor.name) + 1}" if many else sensor.name
        made.append(Sensor(name=own, model=sensor.model, noise=sensor.noise, column=f"mag{k + 1}"))
    return tuple(made)


def _spell(model: str) -> str:
    """The known spelling of a model, or what was written."""
    plain = re.sub(r"[^a-z0-9]", "", model.lower())
    return next((name for name in MODELS if re.sub(r"[^a-z0-9]", "", name.lower()) == plain), model)
