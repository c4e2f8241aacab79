"""`FieldDirection`: where the field points, in every system of axes, and how surely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.provenance import Input
from agonic.readable import Readable
from agonic.report.axes import Axis, over_time
from agonic.report.digits import group_digits, quantity, significant
from agonic.report.document import Document
from agonic.report.figure import Figure, figure
from agonic.report.marks import band, line
from agonic.report.section import Section, list_inputs


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldDirection(Readable):
    """The field at each moment, nT, a row a reading that has an attitude.

    Parameters
    ----------
    rows : (n,) which readings; the others have no attitude. time : (n,) UTC seconds since 1970.
    field_c : (n, 3) in the axes of the star sensor, or of the platform. field_i : celestial
        (GCRS, J2000 to 0.02″). field_e : Earth-fixed (ITRS). field_n : north-east-down, or `None`
        where no place is known.
    covariance_i : (n, 3, 3) nT², celestial axes: alignment, calibration, attitude and noise.
    covariance_n : the same in north-east-down axes. random_covariance_i : attitude and noise alone,
        new in every row; the rest is common to all and does not average out.
    left_out : how many readings have no attitude. notes : sentences on what was taken for granted.
    """

    rows: Index
    time: Array
    field_c: Array
    field_i: Array
    field_e: Array
    covariance_i: Array
    random_covariance_i: Array
    field_n: Array | None = None
    covariance_n: Array | None = None
    left_out: int = 0
    sensor: str = "mag"
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    @property
    def magnitude(self) -> Array:
        """|B| (n,), nT."""
        return np.asarray(np.linalg.norm(self.field_i, axis=1))

    @property
    def ra_deg(self) -> Array:
        """Right ascension (n,) of where the field points among the stars, 0…360°."""
        return np.asarray(np.degrees(np.arctan2(self.field_i[:, 1], self.field_i[:, 0])) % 360)

    @property
    def dec_deg(self) -> Array:
        """Celestial declination (n,) of where the field points."""
        return np.asarray(np.degrees(np.arcsin(self.field_i[:, 2] / self.magnitude)))

    @property
    def sd_arcsec(self) -> Array:
        """Standard error (n,) of the direction, across it where it is known least."""
        return _compute_across_sd(self.field_i, self.covariance_i)

    @property
    def random_sd_arcsec(self) -> Array:
        """The part (n,) of `sd_arcsec` that is new in every row."""
        return _compute_across_sd(self.field_i, self.random_covariance_i)

    @property
    def declination_deg(self) -> Array | None:
        """Magnetic declination D = atan2(E, N) (n,), east positive."""
        if self.field_n is None:
            return None
        return np.asarray(np.degrees(np.arctan2(self.field_n[:, 1], self.field_n[:, 0])))

    @property
    def inclination_deg(self) -> Array | None:
        """Inclination I = atan2(Z, H) (n,), down positive."""
        if self.field_n is None:
            return None
        level = np.hypot(self.field_n[:, 0], self.field_n[:, 1])
        return np.asarray(np.degrees(np.arctan2(self.field_n[:, 2], level)))

    @property
    def declination_sd_deg(self) -> Array | None:
        """Standard error (n,) of the declination: ∂D = (−E, N, 0)/H²."""
        if self.field_n is None or self.covariance_n is None:
            return None
        north, east, _ = self.field_n.T
        slope = np.stack([-east, north, np.zeros_like(north)], axis=1)
        return _compute_sd_deg(slope / (north**2 + east**2)[:, None], self.covariance_n)

    @property
    def inclination_sd_deg(self) -> Array | None:
        """Standard error (n,) of the inclination: ∂I = (−NZ/H, −EZ/H, H)/F²."""
        if self.field_n is None or self.covariance_n is None:
            return None
        north, east, down = self.field_n.T
        level = np.hypot(north, east)
        slope = np.stack([-north * down / level, -east * down / level, level], axis=1)
        return _compute_sd_deg(slope / self.magnitude[:, None] ** 2, self.covariance_n)

    @property
    def magnitude_sd(self) -> Array:
        """Standard error (n,) of |B|, nT: along the field."""
        unit = self.field_i / self.magnitude[:, None]
        square = np.einsum("ni,nij,nj->n", unit, self.covariance_i, unit)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))

    def records(self) -> Iterator[dict[str, Any]]:
        """Each reading by itself: vectors of three numbers in every system of axes, and angles."""
        vectors = {f"field_{letter}_nT": field for letter, field in self._fields().items()}
        numbers = {n: v for n, v in self.columns().items() if not n.startswith("field_")}
        numbers |= {"magnitude_nT": self.magnitude, "magnitude_sd_nT": self.magnitude_sd}
        columns = {"unix_s": numbers.pop("unix_s"), **vectors, **numbers}
        for row in zip(*(values.tolist() for values in columns.values()), strict=True):
            yield {"schema": "agonic/live-direction@1", **dict(zip(columns, row, strict=True))}

    def columns(self) -> dict[str, Array]:
        """The columns of numbers that are there, by name, in writing order."""
        named = {"unix_s": self.time}
        for letter, field in self._fields().items():
            named |= {f"field_{letter}{axis}_nT": field[:, k] for k, axis in enumerate("xyz")}
        level = [
            f"{name}_{of}" for of in ("deg", "sd_deg") for name in ("declination", "inclination")
        ]
        names = ("ra_deg", "dec_deg", *level, "sd_arcsec", "random_sd_arcsec")
        return named | {name: c for name in names if (c := getattr(self, name)) is not None}

    def _fields(self) -> dict[str, Array]:
        """The field in every system of axes that is known, by its letter."""
        found = {letter: getattr(self, f"field_{letter}") for letter in "cien"}
        return {letter: field for letter, field in found.items() if field is not None}


def _compute_across_sd(field: Array, covariance: Array) -> Array:
    """The larger standard error across a vector, arcseconds, (n,). P C P, P = 1 − u uᵀ, has the
    eigenvalues t/2 ± √(t²/4 − m) and 0, of trace t and the sum m of its principal minors."""
    size = np.linalg.norm(field, axis=1)
    unit = field / size[:, None]
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    spread = across @ covariance @ across
    trace = np.trace(spread, axis1=1, axis2=2)
    minors = (trace**2 - np.einsum("nij,nji->n", spread, spread)) / 2
    largest = trace / 2 + np.sqrt(np.maximum(trace**2 / 4 - minors, 0.0))
    return np.asarray(np.sqrt(largest) / size / ARCSEC_RAD)


def _compute_sd_deg(slope: Array, covariance: Array) -> Array:
    """The standard error (n,), degrees, of an angle whose derivative by the field is `slope`."""
    return np.asarray(np.degrees(np.sqrt(np.einsum("ni,nij,nj->n", slope, covariance, slope))))


ANGLES = {
    "declination_deg": ("Magnetic declination", "declination_sd_deg"),
    "inclination_deg": ("Inclination", "inclination_sd_deg"),
    "ra_deg": ("Right ascension of the field", "sd_arcsec"),
    "dec_deg": ("Declination of the field among the stars", "sd_arcsec"),
}
"""What is drawn over time: its name, and where its standard error stands."""


def describe_direction(found: FieldDirection, inputs: Sequence[Input | None] = ()) -> Document:
    """The directions of a log as a whole: where the field points, and how surely. `inputs` are the
    files that they rest on."""
    without = f", {found.left_out} without" if found.left_out else ""
    field = float(np.median(found.magnitude))
    entries = {
        "Readings": f"{len(found)} of {found.sensor} with an attitude{without}",
        "Field": quantity(field, "nT"),
    }
    medians = {
        name: float(np.median(values))
        for name, values in found.columns().items()
        if name.endswith(("declination_deg", "inclination_deg", "sd_deg", "arcsec"))
    }
    for name in ("declination", "inclination"):
        if f"{name}_deg" in medians:
            entries[name.capitalize()] = (
                f"{group_digits(medians[f'{name}_deg'], 4)}° ± "
                f"{significant(medians[f'{name}_sd_deg'], 2)}° in one reading"
            )
    entries["Stars"] = (
        f"right ascension {found.ra_deg[0]:.4f}°, declination {found.dec_deg[0]:.4f}° at the first"
    )
    random = significant(medians["random_sd_arcsec"], 2)
    entries["Error"] = (
        f"{significant(medians['sd_arcsec'], 2)}″ across the field, of which {random}″ is new in "
        "every reading"
    )
    return Document(
        schema="agonic/direction@1",
        kind="Direction of the field",
        name=found.sensor,
        entries=entries,
        remarks=found.notes,
        sections=(Section("Over time", [lambda: _draw(found)]), list_inputs(*inputs)),
        styles=("inflight.css",),
        values={
            "sensor": found.sensor,
            "n": len(found),
            "left_out": found.left_out,
            "first_unix_s": float(found.time[0]),
            "last_unix_s": float(found.time[-1]),
            "field_nT_median": field,
            **{f"{name}_median": value for name, value in medians.items()},
        },
    )


def _draw(found: FieldDirection) -> list[Figure]:
    """A strip of each angle: the readings and a band of one standard error."""
    columns, drawn = found.columns(), []
    means = over_time(found.time)
    for name, (title, sd) in ANGLES.items():
        if name in columns:
            angle = np.degrees(np.unwrap(np.radians(columns[name])))
            per = 3600 if sd.endswith("arcsec") else 1
            middle, spread = means.mean(angle), means.mean(columns[sd] / per)
            low, high = middle - spread, middle + spread
            y = Axis("degrees", float(low.min()), float(high.max()))
            error = band(means, low, high, words="one standard error of a reading")
            shown = line(means, middle, "bias", "mean of the readings")
            drawn.append(figure(title, means.x, y, error, shown))
    return drawn
