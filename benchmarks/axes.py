"""Axes of an accelerometer given other names, on simulated vehicles: python -m benchmarks.axes.

What `calibrate` and `heading` are told of it before any fit: [--draws 1] [--quick].
"""

from __future__ import annotations

from typing import Any

import numpy as np

from agonic.health.finding import find_first
from agonic.health.turning import GRAVITY_TURNING
from agonic.maths.rotations.right_angles import describe_renaming, right_angles
from agonic.samples import Samples
from agonic.simulation import simulate, with_inertial_unit
from benchmarks import tables

SECONDS, RATE_HZ = 100.0, 25.0
CLEAN_DRAWS = 30
STILL = {"stray_nT_A": (0.0, 0.0, 0.0)}
VEHICLES: dict[str, tuple[str, dict[str, Any]]] = {
    "car": ("car", {}),
    "boat": ("boat", {}),
    "plane": ("flight", STILL),
    "copter": ("flight", {"vehicle": "copter", **STILL}),
    "rover, 5°": ("circle", {"tilt_deg": 5.0}),
    "circles, 20°": ("circle", {}),
    "hand": ("hand", {}),
    "tumble": ("tumble", {"pace_s": 3.0}),
}
HEADER = ("vehicle", "named right", "named otherwise", "not named", "clean ones blamed")
INTRODUCTION = """{seconds:g} s at {rate:g} Hz, dip 65°; gyro off by 0.5°/s and 1 %, accelerometer
by 0.05 m/s². Of the 23 ways to exchange and reverse its axes (all of them reversed beside that turn
alike) how many are named right, by another naming, and not at all, {draws} draws of each vehicle;
and how many of {clean} clean draws are blamed."""


def drive(vehicle: str, seed: int) -> Samples:
    """What magnetometer, accelerometer and gyro log."""
    kind, settings = VEHICLES[vehicle]
    n = round(SECONDS * RATE_HZ)
    made = simulate(kind, n=n, rate_Hz=RATE_HZ, seed=seed, inclination_deg=65.0, **settings)
    return with_inertial_unit(seed=seed)(made.samples)


def name_axes(logged: Samples, turn: np.ndarray) -> str:
    """What is said where the axes are those of a turn (3, 3): "right", "otherwise" or "not"."""
    assert logged.acceleration is not None
    found = find_first(
        [GRAVITY_TURNING], logged.with_columns(acceleration=logged.acceleration @ turn.T)
    )
    if found is None:
        return "not"
    told = describe_renaming(turn.T) in found.what
    return "right" if told else "otherwise"


def judge(vehicle: str, draws: int, clean: int) -> list[str]:
    """A row of the table."""
    said = []
    for seed in range(draws):
        logged = drive(vehicle, seed)
        said += [name_axes(logged, turn) for turn in right_angles()[1:]]
    blamed = sum(
        find_first([GRAVITY_TURNING], drive(vehicle, seed)) is not None for seed in range(clean)
    )
    return [
        vehicle,
        *(f"{said.count(what)}" for what in ("right", "otherwise", "not")),
        f"{blamed}",
    ]


def main() -> None:
    """Every vehicle."""
    asked = tables.arguments("axes of an accelerometer", draws=1)
    clean = 3 if asked.quick else CLEAN_DRAWS
    rows = []
    for vehicle in ("boat",) if asked.quick else VEHICLES:
        tables.progress(f"axes: {vehicle}")
        rows.append(judge(vehicle, asked.draws, clean))
    told = INTRODUCTION.format(seconds=SECONDS, rate=RATE_HZ, draws=asked.draws, clean=clean)
    print(f"# Axes\n\n{told}\n\n{tables.markdown(HEADER, rows)}")


if __name__ == "__main__":
    main()
