"""`agonic simulate orbit -o FILE`: a satellite's magnetometer with known truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from agonic.inflight.simulation.orbit import SimulatedOrbit


def orbit(out: Path, as_json: bool, **settings: Any) -> int:
    """Write the readings, the calibration from the ground, and what was true in each row."""
    from agonic.console.output import print_json, say
    from agonic.exports.csv import write_csv
    from agonic.files.calibration import save
    from agonic.inflight.simulation.orbit import simulate_orbit

    made = simulate_orbit(**settings)
    write_csv(made.samples, out)
    ground = save(made.ground, out.with_suffix(".ground.json"))
    truth = save(made.truth, out.with_suffix(".truth.json"))
    rows = write_truth(made, out.with_suffix(".truth.csv"))
    if as_json:
        print_json(
            "agonic/simulate@1",
            {
                "kind": "orbit",
                "n": len(made.samples),
                "files": [str(file) for file in (out, ground, truth, rows)],
                "bias_nT": made.bias.mean(axis=0),
                "eclipse": float(made.eclipse.mean()),
            },
        )
    else:
        say(f"{len(made.samples)} readings: {out}\nThe calibration from the ground: {ground}")
        say(f"The truth: {truth}, and row by row: {rows}")
    return 0


def write_truth(made: SimulatedOrbit, path: Path) -> Path:
    """The bias, the field met, the part outside the Earth and the eclipse, a row a sample."""
    from io import StringIO

    import numpy as np

    from agonic.atomic import write_atomically

    groups = {"bias": made.bias, "field": made.field_n, "external": made.external_n}
    compass = ("north", "east", "down")
    axes = {"bias": "xyz", "field": compass, "external": compass}
    header = ["time_s", *(f"{name}_{a}_nT" for name in groups for a in axes[name]), "eclipse"]
    assert made.samples.time is not None, "simulate_orbit sets it"
    table = np.column_stack([made.samples.time, *groups.values(), made.eclipse])
    stream = StringIO()
    np.savetxt(stream, table, fmt="%.10g", delimiter=",", header=",".join(header), comments="")
    return write_atomically(path, stream.getvalue())
