"""`agonic simulate vehicle -o FILE`: a flight seen by the magnetometers of a vehicle."""

from __future__ import annotations

from shlex import quote
from typing import Annotated, Any

import typer

from agonic.cli.simulate_motion import Clip, Outliers, Truths, choose_defects, load_truth
from agonic.console.options import Json
from agonic.console.simulation_options import Noise, Readings, Seed, Step, Table


def vehicle(
    out: Table,
    n: Readings = 3000,
    noise: Noise = 200.0,
    outliers: Outliers = 0.0,
    step: Step = 0.0,
    clip: Clip = 0.0,
    bank: Annotated[float, typer.Option(help="Steepest bank of the turns, degrees.")] = 27.0,
    latency: Annotated[
        float, typer.Option(metavar="MS", help="How late the readings are, ms.")
    ] = 0.0,
    opposite: Annotated[
        bool, typer.Option("--opposite", help="The second sensor is disturbed oppositely.")
    ] = False,
    motors: Annotated[
        int, typer.Option(help="Motors with a duty and a field of their own.", min=0, max=12)
    ] = 0,
    truth: Truths = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """A flight with two magnetometers in one table, or those of one --truth or two."""
    from agonic.console.output import finish_made
    from agonic.exports.csv import write_sensors
    from agonic.files.calibration import save
    from agonic.simulation import simulate_vehicle
    from agonic.simulation.draws import draw_motors
    from agonic.simulation.resolution import round_as_logged

    known = [load_truth(path) for path in truth or ()]
    settings: dict[str, Any] = {"sensors": len(known), "calibrations": known} if known else {}
    if motors:
        settings["motors_nT"] = draw_motors(motors, seed)
    made = simulate_vehicle(
        n=n,
        noise=noise,
        bank_deg=bank,
        latency_s=latency / 1000,
        placing="opposite" if opposite else "apart",
        seed=seed,
        **settings,
    )
    sensors = list(made.samples)
    for defect in choose_defects(outliers, step, clip, seed):
        sensors = [defect(samples) for samples in sensors]
    write_sensors([round_as_logged(samples) for samples in sensors], out)
    truths = [save(t, out.with_suffix(f".{t.sensor}.truth.json")) for t in made.truths]
    record = {
        "kind": "vehicle",
        "n": n,
        "files": [out, *truths],
        "bias_nT": [t.bias for t in made.truths],
        "matrix": [t.matrix for t in made.truths],
        "stray_nT_A": [t.matrix @ t.coefficients[:, 0] for t in made.truths],
        "latency_ms": 1000 * made.latency_s,
    }
    return finish_made(
        n,
        f"readings of {'one sensor' if len(made.samples) == 1 else 'two sensors'}",
        out,
        f"The truths: {', '.join(map(str, truths))}",
        record=record,
        as_json=as_json,
        next_step=f"agonic calibrate {quote(str(out))}",
    )
