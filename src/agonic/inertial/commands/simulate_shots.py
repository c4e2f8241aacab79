"""`agonic simulate shots -o FILE`: an instrument held still in many attitudes."""

from __future__ import annotations

from shlex import quote
from typing import Annotated, NamedTuple

import typer

from agonic.console.options import Json, Seed, Table


class Survey(NamedTuple):
    """What is simulated, as for `simulate_shots`."""

    attitudes: Annotated[int, typer.Option(help="Shots without a target.", min=0)] = 8
    targets: Annotated[int, typer.Option(help="Targets that the sight is kept on.", min=0)] = 2
    rolls: Annotated[int, typer.Option(help="Shots at each, rolled about the sight.", min=1)] = 8
    noise: Annotated[float, typer.Option(help="Of the magnetometer, sd, nT.", min=0)] = 150.0
    pointing_deg: Annotated[
        float, typer.Option("--pointing", help="Of the sight, sd, degrees.", min=0)
    ] = 0.1
    bad: Annotated[int, typer.Option(help="Shots beside a lump of iron.", min=0)] = 0
    survey: Annotated[
        int, typer.Option(help="Another number: other shots by the same instrument.", min=0)
    ] = 0
    seed: Seed = 0


def shots(out: Table, survey: Survey, as_json: Json = False) -> int:
    """Shots of an instrument with an accelerometer and a magnetometer, all errors in."""
    from agonic.console.output import finish_made
    from agonic.exports.csv import write_csv
    from agonic.files.setup import save_setup
    from agonic.inertial.pair.simulate import simulate_shots

    made = simulate_shots(**survey._asdict())
    write_csv(made.samples, out)
    file = save_setup(made.make_setup(), out.with_suffix(".truth.toml"))
    record = {
        "kind": "shots",
        "n": len(made.samples),
        "files": [out, file],
        "bias_nT": made.magnetometer.bias,
        "matrix": made.magnetometer.matrix,
        "accelerometer_bias_m_s2": made.accelerometer.bias,
        "accelerometer_matrix": made.accelerometer.matrix,
        "sight": made.sight,
        "bad": made.bad + 1,
    }
    following = f"agonic fit pair {quote(str(out))} -o setup.toml"
    said = f"The truth: {file}"
    return finish_made(
        len(made.samples), "shots", out, said, record=record, as_json=as_json, next_step=following
    )
