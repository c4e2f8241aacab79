"""The field to expect where a log was recorded."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from agonic.errors import AgonicError, LogError, check_choice
from agonic.field.decimal_year import decimal_year, parse_date
from agonic.field.published import igrf, wmm, wmmhr
from agonic.field.world_model import Model
from agonic.reference import Reference
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class Expected:
    """The reference field at a place (north, east, down), and the dip, degrees, positive down."""

    reference: Reference
    inclination_deg: float


MODELS = {"igrf": igrf, "wmm": wmm, "wmmhr": wmmhr}
"""What a model is called where one is asked for."""


def choose_model(year: float, name: str | None = None) -> Model:
    """The model that is asked for by name, or WMM2025 in the years it was made for and IGRF
    before."""
    if name is not None:
        check_choice("model", name, tuple(MODELS))
        return MODELS[name]()
    return wmm() if 2025.0 <= year <= 2030.0 else igrf()


def field_at(
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float,
    date: str | None,
    samples: Samples,
    name: str | None = None,
) -> Expected:
    """What to expect at a place, on a date, or on the log's own, or else today."""
    when = date or (samples.epoch or datetime.now(UTC)).date().isoformat()
    model = choose_model(float(decimal_year(when)), name)
    here = model.at(latitude_deg, longitude_deg, altitude_m, when)
    source = f"{model.name} at {latitude_deg:g}°, {longitude_deg:g}°, {altitude_m:g} m on {when}"
    vector = [float(part) for part in (here.north, here.east, here.down)]
    reference = Reference.vector(vector, frame="n", sd=model.uncertainty.component, source=source)
    return Expected(reference=reference, inclination_deg=float(here.inclination_deg))


def describe_missing(samples: Samples) -> str:
    """What a log lacks for the field along its track to be known, in words."""
    parts = {
        "latitude": samples.latitude_deg,
        "longitude": samples.longitude_deg,
        "date": samples.epoch,
    }
    missing = [name for name, part in parts.items() if part is None]
    if not missing:
        return "date or positions are outside those of the world model"
    *others, last = missing
    return f"the log has no {', '.join(others)} or {last}" if others else f"the log has no {last}"


def field_along(
    samples: Samples, date: str | None = None, name: str | None = None
) -> Expected | None:
    """What to expect along a log's own track; None where it has no position or no date. One vector
    where the field hardly varies along the track, else one per sample."""
    epoch = parse_date(date) if date else samples.epoch
    if samples.latitude_deg is None or samples.longitude_deg is None or epoch is None:
        return None
    rows = len(samples)
    time = np.arange(rows, dtype=float) if samples.time is None else samples.time
    track = samples.with_columns(
        epoch=epoch,
        time=time,
        altitude_m=np.zeros(rows) if samples.altitude_m is None else samples.altitude_m,
    )
    middle = epoch + timedelta(seconds=float(np.median(time)))
    model = choose_model(float(decimal_year(middle)), name)
    try:
        vectors = model.along(track)
    except LogError:
        return None
    values = vectors.values
    size = np.linalg.norm(values, axis=1)
    dip = np.degrees(np.arcsin(values[:, 2] / size))
    source = f"{model.name} at the log's own place, {middle.date().isoformat()}"
    if np.ptp(values, axis=0).max() < 0.003 * size.mean():
        values = values.mean(axis=0)
    reference = Reference.vector(values, frame="n", sd=vectors.sd, source=source)
    return Expected(reference=reference, inclination_deg=float(np.median(dip)))


def _refuse_elsewhere(samples: Samples, latitude_deg: float, longitude_deg: float) -> None:
    """Raise `AgonicError` where the log's own positions are far from the place that was given."""
    if samples.latitude_deg is None or samples.longitude_deg is None:
        return
    north, east = np.radians([samples.latitude_deg, samples.longitude_deg])
    fixed, (own, other) = (north != 0) | (east != 0), np.radians([latitude_deg, longitude_deg])
    cosine = np.sin(north) * np.sin(own) + np.cos(north) * np.cos(own) * np.cos(east - other)
    off_km = 6371.0 * float(np.arccos(np.clip(cosine[fixed].max(initial=-1.0), -1.0, 1.0)))
    if fixed.any() and off_km > 100.0:  # over it the field turns by 1° of dip
        raise AgonicError(
            f"the log's own positions are {off_km:.0f} km from --at {latitude_deg:g},"
            f"{longitude_deg:g}; leave out --at, and the field along them is taken"
        )


def choose_reference(
    samples: Samples,
    at: tuple[float, float, float] | None = None,
    date: str | None = None,
    magnitude: float | None = None,
    name: str | None = None,
) -> tuple[Reference | None, dict[str, Any]]:
    """The reference to calibrate a sensor by, and the settings of the fit that go with the place.
    From the magnitude (nT) or the place that was given, or else from the log's own place and date;
    `name` asks for one of `MODELS`."""
    if magnitude is not None:
        return Reference.constant(magnitude, source="given"), {}
    if at is not None:
        _refuse_elsewhere(samples, *at[:2])
    found = field_at(*at, date, samples, name) if at else field_along(samples, date, name)
    if found is None:
        return None, {}
    return found.reference, {"inclination_deg": found.inclination_deg}
