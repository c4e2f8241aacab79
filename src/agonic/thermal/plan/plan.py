"""`plan_thermal`: a campaign in a climatic chamber before it starts, and what it will tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import exp, log
from typing import Annotated

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.errors import AgonicError
from agonic.readable import Shown
from agonic.thermal.campaign.description import (
    Description,
    Sensor,
    Station,
    list_standard_stations,
    parse_sensors,
)
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.maths.stations import describe_turn
from agonic.thermal.plan.standard_errors import ExpectedErrors, expect_errors

HANDLING_MIN = 10.0
"""Minutes to open the chamber, turn the box and close it again."""
FILES = "station-{station:02d}.csv"
_BYTES_TIME, _BYTES_AXIS, _BYTES_TEMPERATURE = 9, 7, 7
"""Characters of a cell and its separator in CSV."""
_PARQUET_SHARE = 0.25


@dataclass(frozen=True, kw_only=True, eq=False)
class ThermalPlan:
    """A campaign to carry out: `description` with sensors, stations and profile, and the costs.

    `rate_Hz` readings a second of each sensor; `magnitude` (nT) and `inclination_deg` of the field
    that standard errors are stated for; `degree` of the polynomials; `bin_width_C`;
    `fixture_sd_deg` how well the turns are known; `chamber_sd` (nT) how far the field of a station
    may be from that of the others; `humidity_percent` of the air in the room.
    """

    description: Description
    rate_Hz: Annotated[float, Shown()]
    magnitude: float
    inclination_deg: float
    degree: int
    bin_width_C: float
    fixture_sd_deg: float
    chamber_sd: float
    humidity_percent: float = 50.0

    @property
    def dew_point_C(self) -> Annotated[float, Shown()]:
        """The temperature at which the air of the room gives off its water."""
        return find_dew_point(self.profile.room_C, self.humidity_percent)

    @property
    def dry_percent(self) -> Annotated[float, Shown(key="dry_below_percent")]:
        """The relative humidity, at the temperature of the room, below which nothing condenses."""
        return find_humidity(self.profile.room_C, self.profile.lowest_C)

    @property
    def profile(self) -> Profile:
        """What the chamber does at every station."""
        assert self.description.profile is not None
        return self.description.profile

    @property
    def stations(self) -> tuple[Station, ...]:
        """The static positions, in order."""
        return self.description.stations

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """The magnetometers under test."""
        return self.description.sensors

    @property
    def turns(self) -> tuple[str, ...]:
        """What to do with the box before each station."""
        first = "set it down"
        pairs = pairwise(station.rot_nb for station in self.stations)
        return (first, *(_describe_turn(before, after) for before, after in pairs))

    @property
    def station_s(self) -> float:
        """From closing the chamber to the end of the recording, at room temperature at first."""
        before = sum(segment.duration_s for segment in self.profile.before)
        return before + self.profile.recorded_s

    @property
    def duration_s(self) -> Annotated[float, Shown()]:
        """The whole campaign: a station after the first begins hot, and needs the hold only."""
        again = HANDLING_MIN * 60 + self.profile.hold_min * 60 + self.profile.recorded_s
        return self.station_s + (len(self.stations) - 1) * again

    @property
    def rows(self) -> Annotated[int, Shown()]:
        """Readings of all sensors at all stations."""
        each = round(self.profile.recorded_s * self.rate_Hz)
        return each * len(self.sensors) * len(self.stations)

    @property
    def bytes_csv(self) -> Annotated[int, Shown()]:
        """Disk space of the recordings as CSV, one row for all sensors of a moment."""
        row = _BYTES_TIME + len(self.sensors) * (3 * _BYTES_AXIS + _BYTES_TEMPERATURE)
        return round(self.rows / len(self.sensors)) * row

    @property
    def bytes_parquet(self) -> Annotated[int, Shown()]:
        """The same as Parquet."""
        return round(_PARQUET_SHARE * self.bytes_csv)

    @cached_property
    def expected(self) -> dict[str, dict[str, ExpectedErrors]]:
        """The standard errors of each sensor: "magnitude" only, and with "known" turns.

        The azimuth of the field in the chamber is not known before; the worst of eight counts.
        """
        made: dict[float, dict[str, ExpectedErrors]] = {}
        for sensor in self.sensors:
            noise = sensor.reading_sd or 0.0
            if noise not in made:
                made[noise] = self._compute_expected(noise)
        return {sensor.name: made[sensor.reading_sd or 0.0] for sensor in self.sensors}

    def _compute_expected(self, noise: float) -> dict[str, ExpectedErrors]:
        rot_nb = np.array([s.rot_nb.as_matrix() for s in self.stations if s.rot_nb is not None])
        level, seconds = self.profile.spread(self.bin_width_C)
        scaled = np.interp(level, (self.profile.lowest_C, self.profile.highest_C), (-1.0, 1.0))
        basis = np.asarray(np.polynomial.legendre.legvander(scaled, self.degree), np.float64)
        dip, turns = np.radians(self.inclination_deg), (None, self.fixture_sd_deg)
        found: list[list[ExpectedErrors]] = []
        for azimuth in np.radians(np.arange(0.0, 360.0, 45.0)):
            north, east = np.cos(dip) * np.cos(azimuth), np.cos(dip) * np.sin(azimuth)
            field_n = self.magnitude * np.array([north, east, np.sin(dip)])
            given = (rot_nb, field_n, basis, seconds * self.rate_Hz, noise)
            found.append(
                [
                    expect_errors(*given, fixture_sd_deg=turn, chamber_sd=self.chamber_sd)
                    for turn in turns
                ]
            )
        alone, known = (max(each, key=lambda e: e.bias) for each in zip(*found, strict=True))
        return {"magnitude": alone, "known": known}


def _describe_turn(before: Rotation | None, after: Rotation | None) -> str:
    if before is None or after is None:
        return "set it as described"
    return describe_turn(before.as_matrix(), after.as_matrix())


def _repeat_stations(stations: tuple[Station, ...], count: int) -> tuple[Station, ...]:
    """The stations, and some of them again under new numbers."""
    if not 0 <= count <= len(stations):
        raise AgonicError(
            f"{count} of {len(stations)} stations cannot be repeated; give 0 to {len(stations)}"
        )
    next_number = max((station.number for station in stations), default=0) + 1
    again = [stations[k * len(stations) // count] for k in range(count)]
    numbered = [replace(one, number=next_number + k) for k, one in enumerate(again)]
    return (*stations, *numbered)


def plan_thermal(
    sensors: str | Sequence[Sensor],
    *,
    range_C: tuple[float, float] = (-10.0, 50.0),
    rate_Hz: float = 10.0,
    noise: float | None = None,
    profile: Profile | None = None,
    stations: Sequence[Station] | None = None,
    repeat: int = 0,
    magnitude: float = 48_000.0,
    inclination_deg: float = 65.0,
    degree: int = 3,
    bin_width_C: float = 0.5,
    fixture_sd_deg: float = 1.0,
    chamber_sd: float = 0.0,
    humidity_percent: float = 50.0,
    name: str = "",
) -> ThermalPlan:
    """The campaign that calibrates magnetometers over a range of temperature.

    At every station the chamber goes through the same profile: heat, hold, record while it cools
    smoothly and heats in steps, hold. Standard errors come from the information matrix of the
    model, Σ (n/σ²) (J Jᵀ) ⊗ (φ φᵀ), for the readings that the profile leaves in each bin.

    Parameters
    ----------
    sensors : `Sensor`s, or a list such as "2xMMC5883MA,3xMPU-9255" (see `campaign.sensors`).
    range_C : lowest and highest temperature. rate_Hz : readings a second of each sensor.
    noise : of one reading on one axis, nT, for all sensors; default: as usual for the model.
    profile : rates and holds; default: 4 h of recording a station for 60 °C.
    stations : default: the standard twelve.
    repeat : so many of them, evenly chosen, are recorded again at the end: what a sensor did
        between two stations looks like another calibration unless some are. Of twelve, three
        have different faces up.
    magnitude, inclination_deg : the field to expect, nT and degrees.
    degree : of the polynomials in temperature. bin_width_C : of the bins.
    fixture_sd_deg : how well the turns of the fixture are known.
    chamber_sd : how far, nT, the field of a station may be from that of the others.
    humidity_percent : relative humidity of the air in the room, whose dew point tells whether
        water condenses in the cold.
    name : of the campaign.

    Returns a `ThermalPlan`. Raises `AgonicError` for a plan that cannot be carried out.

    Source: Nikolaev et al. 2023, sections 2 and 3.

    >>> plan = plan_thermal("2xMMC5883MA,3xMPU-9255")
    >>> plan.rows, round(plan.duration_s / 3600, 1), plan.turns[1][:7]
    (8640000, 53.3, 'turn it')
    >>> round(plan.expected["MMC5883MA-1"]["magnitude"].bias, 1)
    0.4
    """
    chosen = parse_sensors(sensors) if isinstance(sensors, str) else tuple(sensors)
    if noise is not None:
        chosen = tuple(replace(sensor, noise=noise) for sensor in chosen)
    if not chosen or any(not (sensor.reading_sd or 0.0) > 0.0 for sensor in chosen):
        raise AgonicError("a plan needs sensors and the noise of each, in nT above 0")
    if not 0.0 < rate_Hz <= 10_000.0 or not 0 <= degree <= 9 or not bin_width_C > 0.0:
        raise AgonicError(
            f"rate {rate_Hz:g} Hz, degree {degree} and bins of {bin_width_C:g} °C are not a plan; "
            "give a rate of 10 kHz at most, a degree of 0 to 9, and bins above 0"
        )
    lowest, highest = range_C
    made = profile or Profile(lowest_C=lowest, highest_C=highest)
    if not 0.0 < humidity_percent <= 100.0 or not -60.0 <= made.room_C <= 80.0:
        raise AgonicError(
            f"a room at {made.room_C:g} °C and {humidity_percent:g} % relative humidity is not "
            "possible; give -60 to 80 °C, and above 0 to 100 %"
        )
    described = Description(
        name=name,
        sensors=chosen,
        stations=_repeat_stations(tuple(stations or list_standard_stations()), repeat),
        files=FILES,
        profile=made,
        rate_Hz=rate_Hz,
        fixture_sd_deg=fixture_sd_deg,
    )
    if len(described.stations) < 9 or described.rotations is None:
        raise AgonicError("nine numbers need nine stations or more, each with its rot_nb")
    return ThermalPlan(
        description=described,
        rate_Hz=rate_Hz,
        magnitude=magnitude,
        inclination_deg=inclination_deg,
        degree=degree,
        bin_width_C=bin_width_C,
        fixture_sd_deg=fixture_sd_deg,
        chamber_sd=chamber_sd,
        humidity_percent=humidity_percent,
    )


_A, _B_C = 17.62, 243.12


def find_dew_point(temperature_C: float, humidity_percent: float) -> float:
    """The temperature, °C, at which air of a relative humidity gives off its water."""
    exponent = log(humidity_percent / 100.0) + _A * temperature_C / (_B_C + temperature_C)
    return _B_C * exponent / (_A - exponent)


def find_humidity(temperature_C: float, dew_point_C: float) -> float:
    """The relative humidity, %, of air with a dew point."""
    wet, saturated = (_A * t / (_B_C + t) for t in (dew_point_C, temperature_C))
    return 100.0 * exp(wet - saturated)
