"""What is said of disturbers before a recording, and of a recording about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from agonic.attitude.disturbers.plan import JudgedDisturber
from agonic.calibration.sources import name_sources
from agonic.report.digits import quantity
from agonic.report.document import Document
from agonic.report.labels import per_label
from agonic.report.section import Section, Table

STEP_S = 10
"""Seconds at each level: twice what leads and current sensors need to settle."""
LEVELS = ("a third", "two thirds", "full")


def describe_steps(motors: int, others: Sequence[str]) -> Document:
    """What to do with the vehicle while recording.

    >>> describe_steps(4, ["heater_A"]).values["seconds"]
    180
    """
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
    rows = [
        [
            one.source,
            f"{one.low:.3g} … {one.high:.3g}",
            f"{one.share:.0%}",
            f"{one.attitude:.0%}",
            f"{quantity(one.sd, 'nT', 2)} {per_label(one.source)}",
        ]
        for one in judged
    ]
    head = ("Source", "Range", "Of its own", "Goes with attitude", "Standard error to expect")
    return Document(
        schema="agonic/plan-disturbers@1",
        kind="Disturbers of a recording",
        name=sensor,
        status=(
            "Each disturber can be told from the others and from the iron: agonic calibrate LOG."
            if not lacking
            else f"{len(lacking)} of {len(judged)} cannot be told from the rest. "
            + " ".join(_list_moves(lacking))
        ),
        sections=[Section("Disturbers", [Table(head, rows, style="numbers")], printed=True)],
        values={"disturbers": [asdict(one) for one in judged]},
    )


def _list_moves(lacking: Sequence[JudgedDisturber]) -> list[str]:
    """What to add, a sentence each; those that move together in one."""
    together = {frozenset((one.source, *one.along)) for one in lacking if one.along}
    alone = [f"{one.source}: {one.move}." for one in lacking if not one.along]
    sets = sorted(sorted(group) for group in together)
    return [
        f"{name_sources(group)} move together: switch each by itself." for group in sets
    ] + alone
