"""What is said of plans: of a calibration, and of disturbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict

from agonic.attitude.disturbers.choice import JudgedDisturber
from agonic.calibration.sources import name_sources
from agonic.ellipsoid.plan import PlannedSets
from agonic.readable import make_record
from agonic.report.digits import degrees, group_digits, quantity, significant
from agonic.report.document import Document
from agonic.report.labels import per_label
from agonic.report.section import Section, Table, tabulate

_UNKNOWN = 1e5
"""nT, above any field of the Earth: nothing is known of such a bias."""
ERRORS: dict[str, Callable[[PlannedSets], str]] = {
    "Step": lambda one: f"{one.step_deg:g}°",
    "Positions": lambda one: str(one.positions),
    "Readings": lambda one: str(one.positions * one.readings),
    "Bias x, y, z": lambda one: f"{', '.join(map(_write_bias_sd, one.bias_sd))} nT",
    "Heading": lambda one: degrees(one.heading_sd_deg) if one.determined else "not determined",
}


def _write_bias_sd(sd: float) -> str:
    return group_digits(float(sd)) if sd < _UNKNOWN else "?"


def describe_plan(sets: Sequence[PlannedSets], *, wanted_deg: float | None = None) -> Document:
    """What each step of rotation tells, and the coarsest that is enough."""
    chosen = choose_sets(sets, wanted_deg)
    status = (
        "No step is enough: turned like this, the heading follows from the assumed prior on soft "
        "iron. Tilt further, or record roll and pitch (--attitude-sd)."
    )
    if chosen is not None:
        each = f"{chosen.readings} reading{'s' if chosen.readings > 1 else ''} at each"
        status = (
            f"Turn in steps of {chosen.step_deg:g}°: {chosen.positions} positions, {each}, "
            f"{significant(chosen.heading_sd_deg, 2)}° of heading."
        )
    return Document(
        schema="agonic/plan-calibration@1",
        kind="Plan of a calibration",
        name="Three sets about three axes",
        status=status,
        sections=[
            Section("Errors to expect", [tabulate(sets, ERRORS, scrolls=True)], printed=True)
        ],
        values={
            "sets": [make_record(one) for one in sets],
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


STEP_S = 10
"""Seconds at each level: twice what leads and current sensors need to settle."""
LEVELS = ("a third", "two thirds", "full")


def describe_steps(motors: int, others: Sequence[str]) -> Document:
    """What to do with the vehicle while recording."""
    rows = [["Everything off", f"{STEP_S} s"]]
    for k in range(1, motors + 1):
        rows += [[f"Motor {k} alone at {level}", f"{STEP_S} s"] for level in LEVELS]
    rows += [[f"{name} on, then off, twice", f"{4 * STEP_S} s"] for name in others]
    rows.append(["Everything off", f"{STEP_S} s"])
    seconds = (2 + 3 * motors + 4 * len(others)) * STEP_S
    return Document(
        schema="agonic/plan-disturbers@1",
        kind="Plan of a recording",
        name="What disturbs on board",
        status=(
            "Strap the vehicle down, propellers off or reversed, away from steel, and log compass, "
            f"outputs and currents: {seconds} s. Then turn it through all headings, tilting it, "
            "with everything as in service; or fly instead: hover at four headings, climb, descend "
            "and turn at each."
        ),
        sections=[Section("Steps", [Table(("Step", "For"), rows)], printed=True)],
        values={"steps": [step for step, _ in rows], "seconds": seconds},
    )


def describe_judged(sensor: str, judged: Sequence[JudgedDisturber]) -> Document:
    """What a recording tells of each disturber, and what to add."""
    lacking = [one for one in judged if one.move]
    together = {tuple(sorted({one.source, *one.along})) for one in lacking if one.along}
    moves = [f"{name_sources(n)} move together: switch each by itself." for n in sorted(together)]
    moves += [f"{one.source}: {one.move}." for one in lacking if not one.along]
    columns: dict[str, Callable[[JudgedDisturber], str]] = {
        "Source": lambda one: one.source,
        "Range": lambda one: f"{one.low:.3g} … {one.high:.3g}",
        "Of its own": lambda one: f"{one.share:.0%}",
        "Goes with attitude": lambda one: f"{one.attitude:.0%}",
        "Standard error to expect": lambda one: (
            f"{quantity(one.sd, 'nT', 2)} {per_label(one.source)}"
        ),
    }
    return Document(
        schema="agonic/plan-disturbers@1",
        kind="Disturbers of a recording",
        name=sensor,
        status=(
            "Each disturber can be separated from the others and the iron: agonic calibrate LOG."
            if not lacking
            else f"{len(lacking)} of {len(judged)} cannot be separated from the rest. "
            + " ".join(moves)
        ),
        sections=[Section("Disturbers", [tabulate(judged, columns)], printed=True)],
        values={"disturbers": [asdict(one) for one in judged]},
    )
