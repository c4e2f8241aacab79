"""`agonic simulate orbit -o FILE`: a satellite's magnetometer with known truth."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from agonic.console.options import Json, Noise, Seed, Step, Table

NODES = 6
"""Of the network that is trained on the ground."""

if TYPE_CHECKING:
    from agonic.calibration.network import Network
    from agonic.inflight.simulation.orbit import SimulatedOrbit


class Mission(NamedTuple):
    """What is simulated, as for `simulate_orbit`."""

    n: Annotated[int, typer.Option("-n", help="Readings; 86400 are a day.", min=1)] = 86_400
    rate_Hz: Annotated[
        float, typer.Option("--rate", metavar="HZ", help="Readings a second.", min=0.001)
    ] = 1.0
    noise: Noise = 100.0
    step: Step = 0.0
    moved: Annotated[
        float, typer.Option(metavar="NT", help="Change of the bias since the ground calibration.")
    ] = 0.0
    drift: Annotated[float, typer.Option(metavar="NT", help="Drift of the bias.")] = 0.0
    jump: Annotated[float, typer.Option(metavar="NT", help="Step of the bias half-way.")] = 0.0
    external: Annotated[
        float, typer.Option(metavar="NT", help="Standard deviation of the ring current's field.")
    ] = 20.0
    torquer: Annotated[float, typer.Option(metavar="NT", help="Field of the torquers.")] = 0.0
    torquer_settling_s: Annotated[
        float | None,
        typer.Option(
            "--settling",
            metavar="S",
            help="Record the commands of the torquers; time constant of their field.",
        ),
    ] = None
    scalar_sd: Annotated[
        float | None,
        typer.Option("--scalar", metavar="SD", help="Noise of a scalar sensor beside it, nT."),
    ] = None
    pointing: Annotated[str, typer.Option(help="nadir or tumble.")] = "nadir"


def orbit(
    out: Table,
    mission: Mission,
    network: Annotated[
        bool,
        typer.Option("--network", help="Train a network on the ground too, for agonic retrain."),
    ] = False,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """A satellite: readings, the calibration from the ground, and what was true in each row."""
    from agonic.console.output import finish_made
    from agonic.exports.csv import write_csv
    from agonic.files.calibration import save
    from agonic.inflight.simulation.orbit import simulate_orbit
    from agonic.simulation.defects import round_as_logged

    made = simulate_orbit(**mission._asdict(), seed=seed)
    write_csv(round_as_logged(made.samples), out)
    ground = save(made.ground, out.with_suffix(".ground.json"))
    truth = save(made.truth, out.with_suffix(".truth.json"))
    rows = write_truth(made, out.with_suffix(".truth.csv"))
    files = [out, ground, truth, rows]
    if network:
        files.append(
            save(train_on_ground(made, mission.noise, seed), out.with_suffix(".network.json"))
        )
    said = [
        f"The calibration from the ground: {ground}",
        f"The truth: {truth}, and row by row: {rows}",
    ]
    following = f"agonic fit inflight {quote(str(out))} --ground {quote(str(ground))} -o now.json"
    if network:
        said.append(f"The network from the ground: {files[-1]}")
        following = (
            f"agonic retrain {quote(str(out))} --ground {quote(str(files[-1]))} "
            "--window 90min -o now.json"
        )
    record = {"kind": "orbit", "n": mission.n, "files": files, "bias_nT": made.bias.mean(axis=0)}
    record["eclipse"] = float(made.eclipse.mean())
    return finish_made(
        mission.n, "readings", out, *said, record=record, as_json=as_json, next_step=following
    )


def train_on_ground(made: SimulatedOrbit, noise: float, seed: int) -> Network:
    """A network of the readings and their temperature on an affine base, from a coil, into body
    axes: where the attitude of the satellite and the world model meet it."""
    from agonic.inflight.simulation.orbit import simulate_ground
    from agonic.network.fit import fit_network
    from agonic.reference import Reference

    samples, field_b = simulate_ground(made, noise=noise, seed=seed)
    known = Reference.vector(field_b, frame="b", source="the coil")
    inputs = ("field", "temperature")
    fit = fit_network(samples, known, hidden=NODES, inputs=inputs, compared=False, seed=seed)
    return fit.calibration


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
