"""A vehicle's list of parts: what is magnetic on board, and where magnetometers may sit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta, Struct

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.files.toml_sections import read_toml
from agonic.maths.magnetostatics import list_circle

EXAMPLE = Path(__file__).with_name("example.toml")
"""A list of parts with every key that there is, explained."""

Three = tuple[float, float, float]
NotNegative = Annotated[float, Meta(ge=0)]
Positive = Annotated[float, Meta(gt=0)]


class _Strict(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A section of the list, whose keys are those of its class."""


class Field(_Strict, frozen=True):
    """Where the vehicle is used."""

    magnitude_nT: Positive = 48_000.0
    inclination_deg: float = 65.0


class Service(_Strict, frozen=True):
    """How it is used: roll and pitch lie within ± `tilt_deg`."""

    tilt_deg: NotNegative = 15.0


class Sensor(_Strict, frozen=True):
    """Of both magnetometers: noise of a reading on an axis, and how they may be mounted."""

    noise_nT: Positive = 20.0
    position_sd_m: NotNegative = 0.002
    separation_m: NotNegative = 0.05
    clearance_m: NotNegative = 0.05


class Region(_Strict, frozen=True):
    """Places at corner + edgesᵀ u with u in 0…1: a box, a plate, a line."""

    name: str
    corner_m: Three
    edges_m: Annotated[list[Three], Meta(min_length=1, max_length=3)]


class Part(_Strict, frozen=True):
    """A dipole, hard (`moment`) and soft (`induced`, along the axes of the vehicle); standard
    deviations are of each component."""

    name: str
    position_m: Three
    position_sd_m: NotNegative = 0.0
    moment_A_m2: Three = (0.0, 0.0, 0.0)
    moment_sd_A_m2: NotNegative = 0.0
    induced_m3: float | Three = 0.0
    induced_sd_m3: NotNegative = 0.0


class _Conductor(_Strict, frozen=True, kw_only=True):
    """A current, least and most; `position_sd_m` is of the conductor as a whole."""

    name: str
    current_A: tuple[float, float]
    turns: float = 1.0
    position_sd_m: NotNegative = 0.0


class Wire(_Conductor, frozen=True, kw_only=True):
    """A current from corner to corner."""

    points_m: Annotated[list[Three], Meta(min_length=2)]

    def __post_init__(self) -> None:
        if self.current_A[0] > self.current_A[1]:
            raise ValueError("current_A is [least, most]")


class Loop(_Conductor, frozen=True, kw_only=True):
    """A circular current, clockwise as seen along its axis."""

    position_m: Three
    axis: Three
    radius_m: Positive

    def __post_init__(self) -> None:
        if not any(self.axis):
            raise ValueError("axis has no direction")

    def as_wire(self) -> Wire:
        """The same as a polygon."""
        corners = list_circle(np.array(self.position_m), np.array(self.axis), self.radius_m)
        shared = {name: getattr(self, name) for name in _Conductor.__struct_fields__}
        return Wire(**shared, points_m=[(x, y, z) for x, y, z in corners.tolist()])


class Layout(_Strict, frozen=True):
    """What a vehicle is made of, and what is asked of its magnetometers."""

    regions: Annotated[list[Region], Meta(min_length=1)] = msgspec.field(name="region")
    name: str = "vehicle"
    field: Field = Field()
    service: Service = Service()
    sensor: Sensor = Sensor()
    parts: list[Part] = msgspec.field(name="part", default_factory=list)
    wires: list[Wire] = msgspec.field(name="wire", default_factory=list)
    loops: list[Loop] = msgspec.field(name="loop", default_factory=list)

    @property
    def field_n(self) -> Array:
        """The field along magnetic north, east and down (3,), nT."""
        dip = np.radians(self.field.inclination_deg)
        return np.asarray(self.field.magnitude_nT * np.array([np.cos(dip), 0.0, np.sin(dip)]))

    @property
    def horizontal(self) -> float:
        """The level part of the field, nT."""
        return float(np.hypot(*self.field_n[:2]))

    @property
    def currents(self) -> dict[str, tuple[float, float]]:
        """Least and most of every current, A, by its name; wires of one name carry one current."""
        return {wire.name: wire.current_A for wire in self.wires}

    @property
    def current_limits(self) -> tuple[Array, Array]:
        """The same as two arrays (c,)."""
        low, high = np.reshape(list(self.currents.values()), (-1, 2)).T
        return low, high


def read_layout(path: Path) -> Layout:
    """The list of parts in a TOML file; `EXAMPLE` has every key. Loops become wires."""
    told = read_toml(path, "a list of parts in TOML")
    try:
        made = msgspec.convert({"name": path.stem, **told}, Layout)
        wires = [*made.wires, *(loop.as_wire() for loop in made.loops)]
    except ValueError as error:
        raise LogError(f"{error}; agonic plan placement shows every key", path=path) from None
    names = [part.name for part in made.parts]
    wrong = [f"two [[part]] are called {name}" for name in {*names} if names.count(name) > 1]
    for wire in wires:
        if wire.current_A != next(one.current_A for one in wires if one.name == wire.name):
            wrong.append(f"wires called {wire.name} carry one current: give them one current_A")
    if not made.parts + wires:
        wrong.append("a [[part]], [[wire]] or [[loop]] is needed: what disturbs")
    if wrong:
        raise LogError("; ".join(wrong), path=path)
    return msgspec.structs.replace(made, wires=wires, loops=[])
