"""`agonic simulate tumble|hand|…|vehicle|rover -o FILE`: sensors that are moved in many ways."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from agonic.console.options import Json, Noise, Readings, Seed, Step, Table

if TYPE_CHECKING:
    from agonic.calibration.affine import Affine
    from agonic.calibration.network import Network
    from agonic.inflight.simulation.orbit import SimulatedOrbit
    from agonic.samples import Samples
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

Outliers = Annotated[float, typer.Option(help="Share of gross outliers.", min=0, max=1)]
Clip = Annotated[float, typer.Option(help="Full scale, nT; 0 for none.", min=0)]
Truths = Annotated[
    list[Path] | None,
    typer.Option("--truth", metavar="CAL", help="The sensor's calibration; default: random."),
]


def motion(
    context: typer.Context,
    out: Table,
    n: Readings = 3000,
    noise: Noise = 200.0,
    field: float = 50_000.0,
    outliers: Outliers = 0.0,
    step: Step = 0.0,
    clip: Clip = 0.0,
    tilt: float | None = None,
    truth: Truths = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """Write the readings of one sensor, and beside them its true calibration.

    Options
    -------
    field : Magnitude of the field, nT.
    tilt : Largest tilt of belt or circle, degrees.
    """
    from agonic.errors import AgonicError
    from agonic.simulation import simulate

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
    known = f" --field {field:g}"
    return _finish(kind, made.samples, made.truth, out, as_json, known)


def _finish(
    kind: str, samples: Samples, truth: Affine, out: Path, as_json: bool, known: str = ""
) -> int:
    """Write the readings of one sensor and its calibration, and say where both are."""
    from agonic.console.output import finish_made
    from agonic.exports.csv import write_csv
    from agonic.files.calibration import save
    from agonic.simulation.defects import round_as_logged

    n, file = len(samples), save(truth, out.with_suffix(".truth.json"))
    write_csv(round_as_logged(samples), out)
    record = {"kind": kind, "n": n, "files": [out, file], "bias_nT": truth.bias}
    return finish_made(
        n,
        "readings",
        out,
        f"The truth: {file}",
        record=record | {"matrix": truth.matrix},
        as_json=as_json,
        next_step=f"agonic calibrate {quote(str(out))}{known}",
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


def vehicle(
    out: Table,
    n: Readings = 3000,
    noise: Noise = 200.0,
    outliers: Outliers = 0.0,
    step: Step = 0.0,
    clip: Clip = 0.0,
    bank: float = 27.0,
    latency: float = 0.0,
    opposite: bool = False,
    motors: int = 0,
    truth: Truths = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """A flight with two magnetometers in one table, or those of one --truth or two.

    Options
    -------
    bank : Steepest bank of the turns, degrees.
    latency MS : How late the readings are, ms.
    opposite --opposite : Disturb the second sensor with the opposite sign.
    motors ≥0 ≤12 : Motors with a duty and a field of their own.
    """
    from agonic.console.output import finish_made
    from agonic.exports.csv import write_sensors
    from agonic.files.calibration import save
    from agonic.simulation import simulate_vehicle
    from agonic.simulation.defects import round_as_logged
    from agonic.simulation.draws import draw_motors

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


PLACE = {"latitude_deg": 52.1, "longitude_deg": 5.2, "altitude_m": 0.0}


def rover(
    out: Table,
    n: Readings = 6000,
    noise: Noise = 200.0,
    tilt: float = 5.0,
    accelerometer_bias: float = 0.05,
    vibration: float = 0.0,
    late: float = 0.0,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """Turns over a ramp, as a raw magnetometer, accelerometer and gyro record them.

    Options
    -------
    tilt ≥0 : Largest tilt, degrees.
    accelerometer_bias ≥0 : Noise of each axis of the accelerometer, sd, m/s².
    vibration ≥0 : What the motors add to each acceleration, sd, m/s².
    late MS : How late accelerometer and gyro are, ms.
    """
    from datetime import UTC, datetime

    import numpy as np

    from agonic.field.place import choose_model
    from agonic.simulation import simulate, with_inertial_unit

    epoch = datetime(2026, 5, 1, 10, 0, tzinfo=UTC)
    latitude, longitude, altitude = PLACE.values()
    place = choose_model(epoch.year + 0.33).at(latitude, longitude, altitude, epoch)
    made = simulate(
        "circle",
        n=n,
        noise=noise,
        tilt_deg=tilt,
        magnitude=float(place.magnitude),
        inclination_deg=float(place.inclination_deg),
        declination_deg=float(place.declination_deg),
        seed=seed,
    )
    unit = with_inertial_unit(
        accelerometer_bias=accelerometer_bias,
        vibration=vibration,
        late_s=late / 1000,
        seed=seed,
    )
    where = {name: np.full(n, value) for name, value in PLACE.items()}
    samples = unit(made.samples).with_columns(**where, epoch=epoch)
    return _finish("rover", samples, made.truth, out, as_json)


NODES = 6
"""Of the network that is trained on the ground."""


class Mission(NamedTuple):
    """What is simulated, as for `simulate_orbit`.

    Options
    -------
    rate_Hz --rate HZ ≥0.001 : Readings a second.
    moved NT : Change of the bias since the ground calibration.
    drift NT : Drift of the bias.
    jump NT : Step of the bias half-way.
    external NT : Standard deviation of the ring current's field.
    torquer NT : Field of the torquers.
    torquer_settling_s --settling S : Record the commands of the torquers; time constant of their
        field.
    scalar_sd --scalar SD : Noise of a scalar sensor beside it, nT.
    pointing : nadir or tumble.
    """

    n: Annotated[int, typer.Option("-n", help="Readings; 86400 are a day.", min=1)] = 86_400
    rate_Hz: float = 1.0
    noise: Noise = 100.0
    step: Step = 0.0
    moved: float = 0.0
    drift: float = 0.0
    jump: float = 0.0
    external: float = 20.0
    torquer: float = 0.0
    torquer_settling_s: float | None = None
    scalar_sd: float | None = None
    pointing: str = "nadir"


def orbit(
    out: Table,
    mission: Mission,
    network: bool = False,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """A satellite: readings, the calibration from the ground, and what was true in each row.

    Options
    -------
    network --network : Train a network on the ground too, for agonic retrain.
    """
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
    import numpy as np

    from agonic.exports.csv import write_table

    groups = {"bias": made.bias, "field": made.field_n, "external": made.external_n}
    compass = ("north", "east", "down")
    axes = {"bias": "xyz", "field": compass, "external": compass}
    header = ["time_s", *(f"{name}_{a}_nT" for name in groups for a in axes[name]), "eclipse"]
    assert made.samples.time is not None, "simulate_orbit sets it"
    table = np.column_stack([made.samples.time, *groups.values(), made.eclipse])
    rows = ([float(f"{value:.10g}") for value in column] for column in table.T)
    return write_table(dict(zip(header, rows, strict=True)), path)
