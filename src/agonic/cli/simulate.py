"""`agonic simulate KIND -o FILE`: readings with known truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.cli.options import Json


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("simulate")(simulate)


def simulate(
    kind: Annotated[
        str, typer.Argument(help="tumble, sphere, belt, hand, circle, flight or static.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="CSV file to write.")],
    n: Annotated[int, typer.Option("-n", help="Readings.", min=1)] = 3000,
    noise: Annotated[float, typer.Option(help="Noise per axis, nT.", min=0)] = 200.0,
    field: Annotated[float, typer.Option(help="Magnitude of the field, nT.")] = 50_000.0,
    outliers: Annotated[float, typer.Option(help="Share of gross outliers.", min=0, max=1)] = 0.0,
    step: Annotated[float, typer.Option(help="Quantisation, nT; 0 for none.", min=0)] = 0.0,
    clip: Annotated[float, typer.Option(help="Full scale, nT; 0 for none.", min=0)] = 0.0,
    tilt: Annotated[
        float | None, typer.Option(help="Largest tilt of belt and circle, degrees.")
    ] = None,
    sensor: Annotated[
        Path | None,
        typer.Option("--truth", metavar="CAL", help="Whose readings; default: drawn by the seed."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    as_json: Json = False,
) -> int:
    """Write readings of a simulated sensor, and beside them the calibration that would undo it."""
    from agonic import simulation
    from agonic.calibration.affine import Affine
    from agonic.cli.output import print_json, say
    from agonic.errors import AgonicError
    from agonic.io.calfile import load, save
    from agonic.io.write_csv import write_csv

    defects = [
        *([simulation.with_outliers(outliers, seed=seed)] if outliers else []),
        *([simulation.quantised(step)] if step else []),
        *([simulation.clipped(clip)] if clip else []),
    ]
    calibration = None if sensor is None else load(sensor)
    if not (calibration is None or isinstance(calibration, Affine)):
        raise AgonicError(f"{sensor} is a {calibration.kind}; the truth must be an affine one")
    made = simulation.simulate(
        kind, n=n, noise=noise, magnitude=field, seed=seed, defects=defects,
        calibration=calibration,
        **({} if tilt is None else {"tilt_deg": tilt}),
    )  # fmt: skip
    write_csv(made.samples, out)
    truth = save(made.truth, out.with_suffix(".truth.json"))
    if as_json:
        print_json("agonic/simulate@1", {
            "kind": kind, "n": len(made.samples), "files": [str(out), str(truth)],
            "bias_nT": made.truth.bias, "matrix": made.truth.matrix,
        })  # fmt: skip
    else:
        say(f"{len(made.samples)} readings: {out}\nThe truth: {truth}")
    return 0
