"""`agonic simulate tumble|hand|… -o FILE`: one sensor, moved in one of many ways."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Json
from agonic.console.simulation_options import Noise, Readings, Seed, Step, Table

if TYPE_CHECKING:
    from agonic.calibration.affine import Affine
    from agonic.simulation import Defect

HELP = {
    "tumble": "Smooth random rotation, evenly over all attitudes.",
    "sphere": "Independent attitudes, uniform over all rotations.",
    "belt": "The field near a plane in sensor axes.",
    "hand": "Figure eights by hand while turning round.",
    "circle": "All headings, tilted a little.",
    "flight": "Legs and banked turns, with the field of the motor current.",
    "boat": "Legs and turns in waves.",
    "car": "Streets and flat turns, speeding up and braking.",
    "static": "One attitude.",
}
"""Each motion, and what it is."""
TILTED = ("belt", "circle")
"""Motions with a tilt to choose."""

Field = Annotated[float, typer.Option(help="Magnitude of the field, nT.")]
Outliers = Annotated[float, typer.Option(help="Share of gross outliers.", min=0, max=1)]
Clip = Annotated[float, typer.Option(help="Full scale, nT; 0 for none.", min=0)]
Tilt = Annotated[float | None, typer.Option(help="Largest tilt of belt or circle, degrees.")]
Truths = Annotated[
    list[Path] | None,
    typer.Option("--truth", metavar="CAL", help="Whose readings; default: drawn by the seed."),
]


def motion(
    context: typer.Context,
    out: Table,
    n: Readings = 3000,
    noise: Noise = 200.0,
    field: Field = 50_000.0,
    outliers: Outliers = 0.0,
    step: Step = 0.0,
    clip: Clip = 0.0,
    tilt: Annotated[
        float | None, typer.Option(help="Largest tilt of belt or circle, degrees.")
    ] = None,
    truth: Truths = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """Write the readings of one sensor, and beside them the calibration that would undo it."""
    from agonic.console.output import finish_made
    from agonic.errors import AgonicError
    from agonic.exports.csv import write_csv
    from agonic.files.calibration import save
    from agonic.simulation import simulate
    from agonic.simulation.resolution import round_as_logged

    kind = str(context.info_name)
    if tilt is not None and kind not in TILTED:
        raise AgonicError(f"the kind {kind!r} has no tilt to choose; {' and '.join(TILTED)} have")
    if truth is not None and len(truth) > 1:
        raise AgonicError(f"the kind {kind!r} has one sensor; give --truth once")
    settings: dict[str, Any] = {} if tilt is None else {"tilt_deg": tilt}
    made = simulate(
        kind,
        n=n,
        noise=noise,
        magnitude=field,
        calibration=load_truth(truth[0]) if truth else None,
        defects=choose_defects(outliers, step, clip, seed),
        seed=seed,
        **settings,
    )
    write_csv(round_as_logged(made.samples), out)
    file = save(made.truth, out.with_suffix(".truth.json"))
    record = {"kind": kind, "n": n, "files": [out, file], "bias_nT": made.truth.bias}
    return finish_made(
        n,
        "readings",
        out,
        f"The truth: {file}",
        record={**record, "matrix": made.truth.matrix},
        as_json=as_json,
        next_step=f"agonic calibrate {quote(str(out))} --field {field:g}",
    )


def choose_defects(outliers: float, step: float, clip: float, seed: int) -> list[Defect]:
    """The defects that were asked for."""
    from agonic.simulation import clipped, quantised, with_outliers

    return [
        *([with_outliers(outliers, seed=seed)] if outliers else []),
        *([quantised(step)] if step else []),
        *([clipped(clip)] if clip else []),
    ]


def load_truth(path: Path) -> Affine:
    """A calibration whose readings are to be made."""
    from agonic.calibration.affine import Affine
    from agonic.errors import AgonicError
    from agonic.files.calibration import load

    found = load(path)
    if not isinstance(found, Affine):
        raise AgonicError(f"{path} is a {found.kind}; the truth must be an affine one")
    return found
