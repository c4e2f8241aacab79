"""`simulate_campaign`: a campaign in a climatic chamber with known truth, as the published one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.maths.estimation.noise.autoregression import autoregress
from agonic.readable import Readable
from agonic.samples import Samples
from agonic.simulation.draws import draw_directions, make_knots
from agonic.simulation.thermal import make_readings, random_drifting
from agonic.thermal.campaign.description import MODELS, Description, Sensor
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.fit.readings import KELVIN
from agonic.thermal.plan.plan import HANDLING_MIN, ThermalPlan, plan_thermal


@dataclass(frozen=True, kw_only=True)
class Faults:
    """What went wrong in a campaign.

    Parameters
    ----------
    missing : stations that were never recorded. stuck : the sensor whose thermometer stands still.
    swapped : two stations exchanged in the description. drift : nT by which the chamber's field
        moves steadily from the first station to the last. truncated : stations whose recording
        ends in the middle. kelvin : temperatures are in kelvin and nothing says so.
    """

    missing: tuple[int, ...] = ()
    stuck: str = ""
    swapped: tuple[int, int] | None = None
    drift: float = 0.0
    truncated: tuple[int, ...] = ()
    kelvin: bool = False


def check_faults(faults: Faults, plan: ThermalPlan) -> None:
    """Raise `AgonicError` for faults at stations or sensors that there are not."""
    numbers = plan.description.numbers
    named = {*faults.missing, *faults.truncated, *(faults.swapped or ())}
    if named - set(numbers):
        raise AgonicError(f"there is no station {min(named - set(numbers))} to spoil")
    names = [sensor.name for sensor in plan.sensors]
    if faults.stuck and faults.stuck not in names:
        raise AgonicError(f"there is no sensor {faults.stuck!r}; there are {', '.join(names)}")
    if len(set(numbers) - set(faults.missing)) < 1:
        raise AgonicError("all stations are missing; nothing is left to simulate")


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedCampaign(Readable):
    """A campaign and the truth behind it.

    `description` what is told of it; `truth` by sensor the calibration that would undo it;
    `rotations` by station how the box really stood; `facts` the settings. `station(number)` makes
    the readings of one station, `campaign` holds those of all.
    """

    description: Description
    truth: Mapping[str, Thermal]
    rotations: Mapping[int, Rotation]
    faults: Faults
    facts: Mapping[str, Any]
    knots: Array = field(repr=False)
    field_knots: Array = field(repr=False)
    seeds: Mapping[tuple[str, int], np.random.SeedSequence] = field(repr=False)

    def field_n(self, time_s: Array) -> Array:
        """The chamber's field (n, 3), nT, so many seconds after the campaign began."""
        return np.asarray(CubicSpline(self.knots, self.field_knots)(time_s))

    def start_s(self, number: int) -> float:
        """When the recording of a station began."""
        assert self.description.profile is not None
        profile = self.description.profile
        each = profile.recorded_s + 60.0 * (profile.hold_min + HANDLING_MIN)
        return self.description.numbers.index(number) * each

    def station(self, number: int) -> dict[str, Samples]:
        """The readings of all sensors at a station."""
        assert self.description.profile is not None
        profile, rate = self.description.profile, self.facts["rate_Hz"]
        n = round(profile.recorded_s * rate)
        since = np.arange(n) / rate
        kept = slice(0, round(0.4 * n)) if number in self.faults.truncated else slice(None)
        ticks = np.arange(0.0, profile.recorded_s + 2 * TICK_S, TICK_S)
        level = np.interp(since, ticks, apply_lag(profile.at(ticks), self.facts["lag_s"]))
        time = self.start_s(number) + since
        field_b = self.rotations[number].apply(self.field_n(time), inverse=True)
        return {
            sensor.name: self._readings(sensor, number, time, level, field_b, kept)
            for sensor in self.description.sensors
        }

    def _readings(
        self, sensor: Sensor, number: int, time: Array, level: Array, field_b: Array, kept: slice
    ) -> Samples:
        """What one sensor and its thermometer say."""
        rng = np.random.default_rng(self.seeds[sensor.name, number])
        truth = self.truth[sensor.name]
        rate = np.gradient(level, time)
        raw = make_readings(truth, field_b, level, rate)
        raw += self.facts["noise"][sensor.name] * rng.standard_normal(raw.shape)
        add_spikes(raw, self.facts["anomalies"], rng)
        model = MODELS.get(sensor.model)
        if model is not None and self.facts["quantised"]:
            raw = np.clip(np.round(raw / model.step) * model.step, -model.limit, model.limit)
        shown = level + self.facts["temperature_noise_C"] * rng.standard_normal(len(level))
        if self.faults.stuck == sensor.name:
            shown = np.full_like(shown, np.round(shown[len(shown) // 7], 2))
        if self.faults.kelvin:
            shown = shown + KELVIN
        return Samples(
            time=time[kept],
            field=raw[kept],
            unit="nT",
            temperature=np.round(shown[kept], 3),
            station=np.full(len(time[kept]), float(number)),
            name=sensor.name,
            notes=("simulated",),
        )

    @property
    def recorded(self) -> tuple[int, ...]:
        """The numbers of the stations that were recorded."""
        return tuple(n for n in self.description.numbers if n not in self.faults.missing)

    def stations(self) -> Iterator[tuple[int, dict[str, Samples]]]:
        """The stations that were recorded, one after the other."""
        for number in self.recorded:
            yield number, self.station(number)

    @cached_property
    def campaign(self) -> Campaign:
        """All recordings in memory."""
        recordings: dict[str, dict[int, Samples]] = {}
        for number, made in self.stations():
            for name, samples in made.items():
                recordings.setdefault(name, {})[number] = samples
        return Campaign(recordings=recordings, description=self.description)


def simulate_campaign(
    sensors: str | Sequence[Sensor] | ThermalPlan = "2xMMC5883MA,3xMPU-9255",
    *,
    rate_Hz: float = 1.0,
    magnitude: float = 48_000.0,
    inclination_deg: float = 65.0,
    noise: float | None = None,
    drift: float = 20_000.0,
    gain_drift: float = 0.01,
    hysteresis: float = 100.0,
    field_sd: float = 50.0,
    field_pace_s: float = 7_200.0,
    fixture_sd_deg: float = 1.0,
    anomalies: float = 1e-4,
    quantised: bool = True,
    lag_s: float = 120.0,
    temperature_noise_C: float = 0.01,
    faults: Faults | None = None,
    seed: int = 0,
) -> SimulatedCampaign:
    """Readings of a campaign in a climatic chamber whose truth is known.

    A sensor reads A(T) field_b + bias(T) + hysteresis + noise, with A and bias cubic in its own
    temperature; field_b is the chamber's field at the moment, turned by the station and by the
    error of the fixture there.

    Parameters
    ----------
    sensors : a plan, or what `plan_thermal` takes. By default the sensors of Nikolaev et al. 2023:
        two at 25 nT a step within ±800 µT, three at 150 nT within ±4800 µT.
    rate_Hz : readings a second of each sensor (of a plan: its own).
    magnitude, inclination_deg : the chamber's field, nT and degrees.
    noise : of one reading, nT; default: as usual for each model.
    drift : largest change of a bias over the range, nT. gain_drift : of an entry of the matrix.
    hysteresis : how far the bias is off while cooling at the planned rate, nT at most.
    field_sd, field_pace_s : slow changes of the chamber's field that all sensors see, nT, s.
    fixture_sd_deg : error of the fixture's turns. anomalies : share of readings that are spikes.
    quantised : readings come in the steps of the model and within its range.
    lag_s : by which the box follows the chamber. temperature_noise_C : of the thermometers.
    faults : what goes wrong. seed : of everything random.

    Returns a `SimulatedCampaign`. Raises `AgonicError` for faults at stations or sensors that
    there are not.

    >>> made = simulate_campaign("2xMMC5883MA", rate_Hz=0.02)
    >>> made.campaign.rows, made.campaign.sensors
    (6912, ('MMC5883MA-1', 'MMC5883MA-2'))
    """
    facts = dict(locals())
    del facts["sensors"], facts["faults"]
    if isinstance(sensors, ThermalPlan):
        plan = sensors
    else:
        plan = plan_thermal(
            sensors,
            rate_Hz=rate_Hz,
            noise=noise or None,
            magnitude=magnitude,
            inclination_deg=inclination_deg,
        )
    spoilt = faults or Faults()
    check_faults(spoilt, plan)
    truth_rng, fixture_rng, field_rng = np.random.default_rng(seed).spawn(3)
    errors = Rotation.from_rotvec(
        np.radians(fixture_sd_deg) * fixture_rng.standard_normal((len(plan.stations), 3))
    )
    rotations = {
        s.number: s.rot_nb * errors[k] for k, s in enumerate(plan.stations) if s.rot_nb is not None
    }
    made = np.random.SeedSequence(seed)
    pairs = [(sensor.name, s.number) for sensor in plan.sensors for s in plan.stations]
    knots, values = draw_field(field_rng, plan, field_sd, field_pace_s, spoilt.drift)
    noises = {s.name: _find_noise(s, noise) for s in plan.sensors}
    facts |= {name: getattr(plan, name) for name in ("rate_Hz", "magnitude", "inclination_deg")}
    return SimulatedCampaign(
        description=_describe(plan, spoilt.swapped, noises, quantised),
        truth=MappingProxyType(_draw_truth(truth_rng, plan, drift, gain_drift, hysteresis)),
        rotations=MappingProxyType(rotations),
        faults=spoilt,
        facts=MappingProxyType(facts | {"noise": noises}),
        knots=knots,
        field_knots=values,
        seeds=MappingProxyType(dict(zip(pairs, made.spawn(len(pairs)), strict=True))),
    )


def _draw_truth(
    rng: np.random.Generator, plan: ThermalPlan, drift: float, gain_drift: float, hysteresis: float
) -> dict[str, Thermal]:
    """The calibration of each sensor over the range of the plan."""
    half = plan.profile.span_C / 2
    rate = plan.profile.cooling_C_per_min / 60.0
    return {
        sensor.name: random_drifting(
            rng,
            centre_C=plan.profile.lowest_C + half,
            half_range_C=half,
            drift=drift,
            gain_drift=gain_drift,
            per_rate=hysteresis / rate,
            sensor=sensor.name,
        )
        for sensor in plan.sensors
    }


def _find_noise(sensor: Sensor, given: float | None) -> float:
    """The noise before rounding to steps."""
    noise = sensor.noise if given is None else given
    return MODELS[sensor.model].noise if noise is None else noise


def _describe(
    plan: ThermalPlan,
    swapped: tuple[int, int] | None,
    noises: Mapping[str, float],
    quantised: bool,
) -> Description:
    """The description as it will be read: perhaps with two stations exchanged."""
    stations = list(plan.stations)
    if swapped is not None:
        i, j = (plan.description.numbers.index(number) for number in swapped)
        stations[i], stations[j] = (
            replace(stations[i], pose=stations[j].pose, rot_nb=stations[j].rot_nb),
            replace(stations[j], pose=stations[i].pose, rot_nb=stations[i].rot_nb),
        )
    sensors = []
    for sensor in plan.sensors:
        model = MODELS.get(sensor.model)
        step = model.step if model is not None and quantised else 0.0
        sensors.append(replace(sensor, noise=float(np.hypot(noises[sensor.name], step / 12**0.5))))
    return replace(
        plan.description,
        stations=tuple(stations),
        sensors=tuple(sensors),
        magnitude=plan.magnitude,
        inclination_deg=plan.inclination_deg,
    )


TICK_S = 1.0
"""Between the temperatures that `lagged` takes."""
_SPIKE = (2_000.0, 60_000.0)


def draw_field(
    rng: np.random.Generator, plan: ThermalPlan, sd: float, pace_s: float, drift: float
) -> tuple[Array, Array]:
    """Knots of the chamber's field over the campaign: slow changes, and a steady drift."""
    total = plan.duration_s
    knots = make_knots(total, pace_s)
    dip = np.radians(plan.inclination_deg)
    steady = plan.magnitude * np.array([np.cos(dip), 0.0, np.sin(dip)])
    away = draw_directions(rng, 1)[0] * drift
    values = steady + sd * rng.standard_normal((len(knots), 3))
    return knots, values + np.outer(knots / total - 0.5, away)


def apply_lag(level: Array, lag_s: float) -> Array:
    """A temperature that follows with a lag, τ dT/dt = chamber − T, a value a second."""
    if lag_s <= 0.0:
        return level
    share = 1.0 - np.exp(-TICK_S / lag_s)
    return np.asarray(level[0] + autoregress(share * (level - level[0]), 1.0 - share))


def add_spikes(raw: Array, share: float, rng: np.random.Generator) -> None:
    """Add spikes to a share of the rows."""
    rows = np.flatnonzero(rng.random(len(raw)) < share)
    sizes = rng.uniform(*_SPIKE, len(rows))
    raw[rows] += draw_directions(rng, len(rows)) * sizes[:, None]
