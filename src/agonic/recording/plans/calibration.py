"""What is said of the plan of a calibration: steps of rotation, and errors to expect."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from agonic.ellipsoid.plan import PlannedSets
from agonic.report.digits import group_digits, significant
from agonic.report.document import Document
from agonic.report.section import Section, Table

_UNKNOWN = 1e5
"""nT, above any field of the Earth: nothing is known of such a bias."""
HEAD = ("Step", "Positions", "Readings", "Bias x, y, z", "Heading")


def describe_plan(sets: Sequence[PlannedSets], *, wanted_deg: float | None = None) -> Document:
    """What each step of rotation tells, and the coarsest that is enough.

    >>> from agonic.ellipsoid.plan import plan_calibration
    >>> made = describe_plan(plan_calibration(steps_deg=(30, 10), wanted_deg=0.5), wanted_deg=0.5)
    >>> made.status
    'Turn in steps of 30°: 36 positions, 2 readings at each, 0.49° of heading.'
    """
    chosen = choose_sets(sets, wanted_deg)
    return Document(
        schema="agonic/plan-calibration@1",
        kind="Plan of a calibration",
        name="Three sets about three axes",
        status=_advise(chosen),
        sections=[Section("Errors to expect", [Table(HEAD, _rows(sets))], printed=True)],
        values={
            "sets": [_record(one) for one in sets],
            "chosen_step_deg": None if chosen is None else chosen.step_deg,
            "attitudes_deg": None if chosen is None else chosen.attitudes_deg,
        },
    )


def choose_sets(sets: Sequence[PlannedSets], wanted_deg: float | None) -> PlannedSets | None:
    """The sets that need the fewest readings among those that the readings determine."""
    able = [
        one
        for one in sets
        if one.determined and (wanted_deg is None or one.heading_sd_deg <= wanted_deg)
    ]
    return min(able, key=lambda one: one.positions * one.readings, default=None)


def _advise(chosen: PlannedSets | None) -> str:
    if chosen is None:
        return (
            "No step is enough: turned like this, the readings leave the heading to the prior on "
            "soft iron. Tilt further, or record roll and pitch (--attitude-sd)."
        )
    each = f"{chosen.readings} reading{'s' if chosen.readings > 1 else ''} at each"
    return (
        f"Turn in steps of {chosen.step_deg:g}°: {chosen.positions} positions, {each}, "
        f"{significant(chosen.heading_sd_deg, 2)}° of heading."
    )


def _rows(sets: Sequence[PlannedSets]) -> list[list[str]]:
    return [
        [
            f"{one.step_deg:g}°",
            str(one.positions),
            str(one.positions * one.readings),
            ", ".join(group_digits(float(sd), 0) if sd < _UNKNOWN else "?" for sd in one.bias_sd)
            + " nT",
            f"{significant(one.heading_sd_deg, 2)}°" if one.determined else "not determined",
        ]
        for one in sets
    ]


def _record(one: PlannedSets) -> dict[str, Any]:
    return {
        "step_deg": one.step_deg,
        "positions": one.positions,
        "readings": one.readings,
        "bias_sd_nT": one.bias_sd,
        "matrix_sd": one.matrix_sd,
        "heading_sd_deg": one.heading_sd_deg,
        "determined": one.determined,
    }
