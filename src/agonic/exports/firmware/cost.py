"""What a heading costs a controller at most: stack and time, by target, as the header states."""

from __future__ import annotations

from typing import NamedTuple

from agonic.calibration.inputs import signals
from agonic.exports.firmware.plan import Plan


class Target(NamedTuple):
    """Bytes of stack for one compass and for several, instructions a compass with angles and else.

    Of the frames that GCC states, along the deepest calls, and of the longest call in an emulator
    over inputs that are none too; `tests/exports/test_cost.py` holds both for every kind of setup.
    """

    one: int
    several: int
    by_angles: int
    otherwise: int


TARGETS = {
    "Cortex-M0+": Target(160, 288, 200_000, 45_000),
    "Cortex-M4F": Target(136, 248, 12_000, 1400),
    "RISC-V": Target(192, 336, 190_000, 40_000),
    "AVR": Target(152, 216, 80_000, 50_000),
}
"""Sine and cosine of an angle that is no attitude (10⁹ degrees) take the longest."""


def list_costs(plan: Plan) -> list[str]:
    """A row for each target."""
    count, names = len(plan.calibrations), len(signals(plan.sources))
    held = names + (12 + 3 * names if plan.warm else 0)
    rows = []
    for name, target in TARGETS.items():
        stack = (target.one if count == 1 else target.several) + 4 * held
        each = target.by_angles if plan.tilt == "angles" else target.otherwise
        rows.append(f"{name:<12}{stack:>6}{count * each:>12}")
    return rows
