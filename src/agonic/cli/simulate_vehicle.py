"""`agonic simulate vehicle -o FILE`: a flight seen by the magnetometers of a vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from agonic.calibration.affine import Affine
    from agonic.simulation import Defect


def vehicle(
    out: Path, defects: list[Defect], whose: list[Affine], as_json: bool, **settings: Any
) -> int:
    """The sensors of a vehicle in one table, two or those of `whose`, and what undoes each."""
    from agonic.console.output import print_json, say
    from agonic.exports.csv import write_sensors
    from agonic.files.calibration import save
    from agonic.simulation import simulate_vehicle

    if whose:
        settings |= {"sensors": len(whose), "calibrations": whose}
    made = simulate_vehicle(**settings)
    sensors = list(made.samples)
    for defect in defects:
        sensors = [defect(samples) for samples in sensors]
    write_sensors(sensors, out)
    truths = [save(t, out.with_suffix(f".{t.sensor}.truth.json")) for t in made.truths]
    if as_json:
        print_json(
            "agonic/simulate@1",
            {
                "kind": "vehicle",
                "n": len(made.heading_deg),
                "files": [str(out), *map(str, truths)],
                "bias_nT": [t.bias for t in made.truths],
                "matrix": [t.matrix for t in made.truths],
                "stray_nT_A": [t.matrix @ t.coefficients[:, 0] for t in made.truths],
                "latency_ms": 1000 * made.latency_s,
            },
        )
    else:
        count = "one sensor" if len(made.samples) == 1 else "two sensors"
        say(f"{len(made.heading_deg)} readings of {count}: {out}")
        say(f"The truths: {', '.join(map(str, truths))}")
    return 0
