"""The magnetometers under test: the models that are known by name, and how a list is written."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot, sqrt

from agonic.errors import AgonicError


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

    >>> [sensor.name for sensor in parse_sensors("2xMMC5883MA,HMC5883L:200")]
    ['MMC5883MA-1', 'MMC5883MA-2', 'HMC5883L']
    >>> round(parse_sensors("MPU-9255")[0].reading_sd, 1)
    402.3
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
