"""What is said and shown of the direction of the field."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from agonic.alignment.direction.result import FieldDirection
from agonic.arrays import Array
from agonic.provenance import Input
from agonic.report.axes import Axis, Columns, along_time
from agonic.report.digits import group_digits, quantity, significant
from agonic.report.document import Document
from agonic.report.markup import Markup
from agonic.report.section import Section, list_inputs
from agonic.report.strips import band, caption, line, plot

ANGLES = {
    "declination_deg": ("Magnetic declination", "declination_sd_deg"),
    "inclination_deg": ("Inclination", "inclination_sd_deg"),
    "ra_deg": ("Right ascension of the field", "sd_arcsec"),
    "dec_deg": ("Declination of the field among the stars", "sd_arcsec"),
}
"""What is drawn over time: its name, and where its standard error stands."""


def describe_direction(found: FieldDirection, inputs: Sequence[Input | None] = ()) -> Document:
    """The directions of a log as a whole: where the field points, and how surely.

    `inputs` are the files that they rest on.

    >>> import agonic as ag
    >>> night = ag.alignment.simulate_session(seed=1).session
    >>> turn = ag.fit_alignment(night).calibration
    >>> found = ag.alignment.field_direction(turn, night.magnetometer, night.star, night.site)
    >>> made = describe_direction(found)
    >>> [line for line in made.to_text().splitlines() if "Readings" in line]
    ['  Readings     456 of magnetometer with an attitude, 24 without']
    """
    return Document(
        schema="agonic/direction@1",
        kind="Direction of the field",
        name=found.sensor,
        entries=_describe(found),
        remarks=found.notes,
        sections=(Section("Over time", [lambda: _draw_all(found)]), list_inputs(*inputs)),
        styles=("inflight.css",),
        values=_summarise(found),
    )


def _describe(found: FieldDirection) -> dict[str, str]:
    sd, random = (float(np.median(v)) for v in (found.sd_arcsec, found.random_sd_arcsec))
    without = f", {found.left_out} without" if found.left_out else ""
    entries = {
        "Readings": f"{len(found)} of {found.sensor} with an attitude{without}",
        "Field": quantity(float(np.median(found.magnitude)), "nT"),
    }
    for name in ("declination", "inclination"):
        angle, spread = getattr(found, f"{name}_deg"), getattr(found, f"{name}_sd_deg")
        if angle is not None:
            entries[name.capitalize()] = (
                f"{group_digits(float(np.median(angle)), 4)}° ± "
                f"{significant(float(np.median(spread)), 2)}° in one reading"
            )
    entries["Stars"] = (
        f"right ascension {found.ra_deg[0]:.4f}°, declination {found.dec_deg[0]:.4f}° at the first"
    )
    entries["Error"] = (
        f"{significant(sd, 2)}″ across the field, of which {significant(random, 2)}″ is new in "
        "every reading"
    )
    return entries


def _summarise(found: FieldDirection) -> dict[str, Any]:
    medians = {
        f"{name}_median": float(np.median(values))
        for name, values in found.columns().items()
        if name.endswith(("declination_deg", "inclination_deg", "sd_deg", "arcsec"))
    }
    return {
        "sensor": found.sensor,
        "n": len(found),
        "left_out": found.left_out,
        "first_unix_s": float(found.time[0]),
        "last_unix_s": float(found.time[-1]),
        "field_nT_median": float(np.median(found.magnitude)),
        **medians,
    }


def _draw_all(found: FieldDirection) -> list[Markup]:
    """A strip of each angle: the readings and a band of one standard error."""
    columns, keys = found.columns(), {"bias": "mean of the readings"}
    keys["band"] = "one standard error of a reading"
    drawn = []
    for name, (title, sd) in ANGLES.items():
        if name in columns:
            spread = columns[sd] / (3600 if sd.endswith("arcsec") else 1)
            drawn.append(caption(title, _draw(found.time, columns[name], spread, title), keys))
    return drawn


def _draw(time: Array, angle: Array, sd: Array, title: str) -> Markup:
    angle = np.degrees(np.unwrap(np.radians(angle)))
    x, along = along_time(time, float(time[0]), float(time[-1]))
    columns = Columns(x, along)
    middle, spread = columns.mean(angle), columns.mean(sd)
    y = Axis("degrees", float((middle - spread).min()), float((middle + spread).max()))
    layers = [
        band(columns, y, middle - spread, middle + spread, "band"),
        line(columns, y, middle, "bias"),
    ]
    return plot(x, y, layers, f"{title} over time")
