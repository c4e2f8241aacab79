"""`WorldField`: the field that a world model predicts, and how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array

ELEMENTS = (
    "declination_deg",
    "inclination_deg",
    "horizontal",
    "north",
    "east",
    "down",
    "magnitude",
)
"""The seven elements D, I, H, X, Y, Z, F, in the order that the official calculators print."""
EXTERNAL_NT, EXTERNAL_S = 15.0, 7200.0
"""Currents outside the Earth on a quiet day, each Earth-fixed axis, and how long they keep."""


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """Published one-sigma errors of a model at the ground.

    They hold the model's own error and what it leaves out: crust, ionosphere, magnetosphere.
    `north`, `east`, `down`, `horizontal`, `magnitude` in nT; the declination's is
    √(constant² + (per_horizontal / H)²) with `declination_deg` = (constant, per_horizontal), in
    degrees and degrees · nT. `None` where nothing is published. `source` says who states it.
    """

    north: float
    east: float
    down: float
    declination_deg: tuple[float, float]
    inclination_deg: float | None = None
    horizontal: float | None = None
    magnitude: float | None = None
    source: str

    @property
    def component(self) -> float:
        """One number for a component: the root mean square of north, east and down, nT."""
        return float(np.sqrt((self.north**2 + self.east**2 + self.down**2) / 3.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class WorldField:
    """The geomagnetic field of `model` at places and times. `field_n` (…, 3) north, east, down, nT,
    and `secular_variation` (…, 3) its change, nT/year; the leading axes are those of the places and
    times asked for. Every property has their shape."""

    field_n: Array
    secular_variation: Array
    model: str
    uncertainty: Uncertainty

    @property
    def north(self) -> Array:
        """X, nT."""
        return self.field_n[..., 0]

    @property
    def east(self) -> Array:
        """Y, nT."""
        return self.field_n[..., 1]

    @property
    def down(self) -> Array:
        """Z, nT."""
        return self.field_n[..., 2]

    @property
    def horizontal(self) -> Array:
        """H = √(X² + Y²), nT."""
        return np.hypot(self.north, self.east)

    @property
    def magnitude(self) -> Array:
        """F = √(X² + Y² + Z²), nT."""
        return np.hypot(self.horizontal, self.down)

    @property
    def declination_deg(self) -> Array:
        """D = atan2(Y, X), degrees, east positive."""
        return np.degrees(np.arctan2(self.east, self.north))

    @property
    def inclination_deg(self) -> Array:
        """I = atan2(Z, H), degrees, down positive."""
        return np.degrees(np.arctan2(self.down, self.horizontal))

    @property
    def declination_sd_deg(self) -> Array:
        """One sigma of the declination, √(constant² + (per_horizontal / H)²), at most 180°."""
        constant, per_horizontal = self.uncertainty.declination_deg
        return np.minimum(np.hypot(constant, per_horizontal / self.horizontal), 180.0)

    def elements(self) -> dict[str, Array]:
        """The seven elements by name."""
        return {name: getattr(self, name) for name in ELEMENTS}

    def elements_per_year(self) -> dict[str, Array]:
        """The yearly change of the seven elements, by name, nT/year and degrees/year. Ḣ = (X Ẋ + Y
        Ẏ)/H, Ḟ = (H Ḣ + Z Ż)/F, Ḋ = (X Ẏ − Y Ẋ)/H², İ = (H Ż − Z Ḣ)/F²."""
        x, y, z = self.north, self.east, self.down
        dx, dy, dz = np.moveaxis(self.secular_variation, -1, 0)
        h, f = self.horizontal, self.magnitude
        dh = (x * dx + y * dy) / h
        changes = (
            np.degrees((x * dy - y * dx) / h**2),
            np.degrees((h * dz - z * dh) / f**2),
            dh,
            dx,
            dy,
            dz,
            (h * dh + z * dz) / f,
        )
        return dict(zip(ELEMENTS, changes, strict=True))
