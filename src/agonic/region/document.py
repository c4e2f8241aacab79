"""What is said and shown of the map of a region."""

from __future__ import annotations

import numpy as np

from agonic.provenance import Input
from agonic.readable import make_record
from agonic.region.figures import draw_region
from agonic.region.fit import CITATIONS
from agonic.region.result import FieldMap
from agonic.report.digits import group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.fields import write_field
from agonic.report.section import Section, Table, list_inputs


def describe_map(found: FieldMap, turned: bool = False, source: Input | None = None) -> Document:
    """Field and gradient in the middle of a region, how well they are known, where to measure
    next."""
    here = found.at((found.low + found.high) / 2)
    at_readings = found.at(found.readings.position)
    sd = np.linalg.norm(at_readings.sd, axis=1)
    then = np.linalg.norm(found.at(found.next_places).sd, axis=1)
    rows = [
        [f"{k}", *(f"{v:.2f}" for v in place), quantity(one, "nT", 2)]
        for k, (place, one) in enumerate(
            zip(found.next_places, then.tolist(), strict=True), start=1
        )
    ]
    middle = zip(here.field[0].tolist(), here.sd[0].tolist(), strict=True)
    return Document(
        schema="agonic/map@1",
        kind="Map of a region",
        name=found.name,
        verdict=found.verdict,
        status=found.status,
        findings=found.findings,
        method=f"{len(found.left_out)} readings",
        entries={
            "Axes": "x to heading 0, y to the right, z down: readings were turned by their attitude"
            if turned
            else "those of the readings, as they are",
            "Region": " × ".join(f"{side:.2f}" for side in found.high - found.low) + " m",
            "Middle": ", ".join(with_sd(f, s) for f, s in middle)
            + f" nT, strength {with_sd(float(here.magnitude[0]), float(here.magnitude_sd[0]))} nT, "
            f"direction to {significant(float(here.direction_sd_deg[0]), 2)}°",
            "Strength": f"{group_digits(float(at_readings.magnitude.min()))} to "
            f"{group_digits(float(at_readings.magnitude.max()))} nT at the readings, the vector "
            f"there to {quantity(float(np.median(sd)), 'nT', 2)} in the median",
            "Gradient": f"up to {quantity(float(np.abs(at_readings.gradient).max()), 'nT/m', 2)}",
            "Noise": write_field(found, "noise"),
        },
        sections=[
            Section("From above", [lambda: draw_region(found)]),
            Section(
                "Measure next",
                [Table(("Place", "x, m", "y, m", "z, m", "Standard error now"), rows)],
                printed=True,
            ),
            list_inputs(source, method=CITATIONS, equation="f(x) = u + Σⱼ T(x − sⱼ) wⱼ"),
        ],
        styles=["contours.css"],
        values=make_record(found)
        | {
            "n": len(found.left_out),
            "left_out": np.flatnonzero(found.left_out),
            "middle_nT": here.field[0],
            "middle_sd_nT": here.sd[0],
            "gradient_nT_m": here.gradient[0],
            "gradient_sd_nT_m": here.gradient_sd[0],
            "next_sd_nT": then,
        },
    )
