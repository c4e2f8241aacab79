"""What is said and shown of the plan of a session: orientations, and standard errors to expect."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agonic.alignment.maths.two_frames import GROUPS
from agonic.alignment.star_sensor.figures import draw_dome
from agonic.alignment.star_sensor.plan import AlignmentPlan
from agonic.maths.rotations.frames import ARCSEC_RAD, rot_cn
from agonic.readable import make_record
from agonic.report.digits import quantity, significant, write_minus
from agonic.report.document import Document
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table

HEAD = ("Orientation", "Azimuth", "Elevation", "Roll", "Worst axis so far", "Begun, remarks")
ROLL = (
    "Azimuth and elevation are where the star sensor looks, roll turns it about that; with roll 0 "
    "its x axis points to the horizon below."
)
UNITS = {"alignment": "″", "reference": "″", "pier": "nT", "bias": "nT", "matrix": ""}


def describe_plan(plan: AlignmentPlan) -> Document:
    """The orientations with their dome, a column to fill in, and the standard errors to expect.

    >>> from agonic.alignment.star_sensor import plan_alignment
    >>> made = describe_plan(plan_alignment([18_870, 1_390, 45_750], wanted_sd_arcsec=2.0))
    >>> made.to_text().splitlines()[0][:40], made.to_html().count("<svg")
    ('6 orientations of 20 readings each: the ', 1)
    """
    return Document(
        schema="agonic/plan-alignment@1",
        kind="Plan of a session",
        name="Alignment with a star sensor",
        status=f"{len(plan.orientations)} orientations of {plan.readings} readings each: the "
        f"alignment to ± {significant(plan.worst_sd_arcsec, 2)}″ about its worst axis",
        sections=[
            Section(
                "Orientations",
                [Table(HEAD, _rows(plan), "orientations", scrolls=True), lambda: _dome(plan)],
                printed=True,
                style="pair plan",
            ),
            Section("", [ROLL], printed=True),
            Section("Standard errors to expect", [_describe_expected(plan)], printed=True),
        ],
        values={
            "orientations": [
                {"azimuth_deg": azimuth, "elevation_deg": elevation, "roll_deg": roll}
                for azimuth, elevation, roll in plan.orientations
            ],
            **make_record(plan),
        },
        styles=["alignment.css"],
    )


def _rows(plan: AlignmentPlan) -> list[list[str]]:
    """Each orientation in its order, and how well the alignment is known after it."""
    return [
        [
            str(k),
            *(f"{angle:g}°" for angle in orientation),
            f"{significant(sd, 3)}″" if np.isfinite(sd) else "not determined",
            "",
        ]
        for k, (orientation, sd) in enumerate(
            zip(plan.orientations, plan.sd_arcsec, strict=True), start=1
        )
    ]


def _dome(plan: AlignmentPlan) -> Markup:
    boresight, count = rot_cn(*np.array(plan.orientations).T)[:, 2], len(plan.orientations)
    drawn = draw_dome(boresight, np.arange(1, count + 1), np.ones(count))
    return element("figure", drawn, element("figcaption", "North is up, east to the right."))


def _describe_expected(plan: AlignmentPlan) -> dict[str, str]:
    """Standard errors of every group that is solved for."""
    written: dict[str, Callable[[float], str]] = {
        "″": lambda value: f"{significant(value / ARCSEC_RAD, 2)}″",
        "nT": lambda value: quantity(value, "nT", 2),
        "": lambda value: write_minus(f"{value:.1e}"),
    }
    return {
        group: "  ".join(written[UNITS[group]](float(sd)) for sd in plan.sd[GROUPS[group]])
        for group in plan.solve
    }
