"""`agonic demo`: the main job on a simulated log, truth beside estimate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Json


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("demo")(demo)


def demo(
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="Folder to write to.")
    ] = Path("agonic-demo"),
    seed: Annotated[int, typer.Option(help="Another seed, another sensor.")] = 1,
    as_json: Json = False,
) -> int:
    """Simulate a hand-turned sensor with outliers, calibrate it, and compare with the truth."""
    from agonic import simulation
    from agonic.atomic import make_folder
    from agonic.calibration.affine import PARAMETERS
    from agonic.console.output import print_json, say
    from agonic.exports.csv import write_csv
    from agonic.logs.read import open_log
    from agonic.maths.equation.symmetric import pack_symmetric
    from agonic.recording.calibrated import calibrate
    from agonic.recording.report.folder import write_folder
    from agonic.recording.report.record import record
    from agonic.recording.report.text import summary
    from agonic.reference import Reference

    made = simulation.simulate(
        "hand", noise=200.0, seed=seed, defects=[simulation.with_outliers(0.02, seed=seed)]
    )
    make_folder(out)
    log = open_log(write_csv(made.samples, out / "demo.csv"))
    result = calibrate(log.sensors[0], Reference.constant(50_000, source="the simulation"))
    written = write_folder([result], out, title=log.path.name)
    fit, truth = result.fit, [*made.truth.bias, *pack_symmetric(made.truth.matrix)]
    found = [*fit.calibration.bias, *pack_symmetric(fit.calibration.matrix)]
    if as_json:
        print_json(
            "agonic/demo@1",
            {
                "truth": dict(zip(PARAMETERS, truth, strict=True)),
                "sensors": [record(result, *written[result.samples.name])],
            },
        )
    else:
        say(summary([result]))
        say(f"\n  {'':<12}{'truth':>12}{'found':>12}{'sd':>10}{'error/sd':>10}")
        for name, true, value, sd in zip(PARAMETERS, truth, found, fit.sd, strict=True):
            error = "" if sd == 0 else f"{(value - true) / sd:10.2f}"
            digits = 1 if name.startswith("bias") else 6
            say(f"  {name:<12}{true:12.{digits}f}{value:12.{digits}f}{sd:10.2g}{error}")
        say(f"\nReport    {out / 'report.html'}")
    return 0 if result.verdict == "good" else 1
