"""`Description`: what a campaign is about: sensors, stations, profile, the chamber's field."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache

from scipy.spatial.transform import Rotation

from agonic.errors import AgonicError
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.campaign.sensors import Sensor
from agonic.thermal.maths.stations import describe_pose, list_standard_rotations


@cache
def list_standard_stations() -> tuple[Station, ...]:
    """The twelve stations of `thermal.maths.stations`, numbered in the order of least handling.

    >>> [station.pose for station in list_standard_stations()[:2]]
    ['top up, front to the back', 'top up, front to the right']
    """
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
    """The values that are there more than once.

    >>> find_repeated(["a", "b", "a"])
    ['a']
    """
    return [value for value, times in Counter(values).items() if times > 1]
