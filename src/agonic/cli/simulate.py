"""`agonic simulate tumble|hand|…|vehicle|rover -o FILE`: sensors that are moved in many ways."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Json, Noise, Readings, Seed, Step, Table

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
    typer.Option("--truth", metavar="CAL", help="The sensor's calibration; default: random."),
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
    tilt: Tilt = None,
    truth: Truths = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """Write the readings of one sensor, and beside them its true calibration."""
    from agonic.console.output import finish_made
    from agonic.errors import AgonicError
    from agonic.exports.csv import write_csv
    from agonic.files.calibration import save
    from agonic.simulation import simulate
    from agonic.simulation.defects import round_as_logged

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
        bool, typer.Option("--opposite", help="Disturb the second sensor with the opposite sign.")
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


if TYPE_CHECKING:
    from agonic.calibration.affine import Affine
    from agonic.simulation import Defect


LATITUDE_DEG, LONGITUDE_DEG = 52.1, 5.2


def rover(
    out: Table,
    n: Readings = 6000,
    noise: Noise = 200.0,
    tilt: Annotated[float, typer.Option(help="Largest tilt, degrees.", min=0)] = 5.0,
    accelerometer_bias: Annotated[
        float, typer.Option(help="Noise of each axis of the accelerometer, sd, m/s².", min=0)
    ] = 0.05,
    vibration: Annotated[
        float, typer.Option(help="What the motors add to each acceleration, sd, m/s².", min=0)
    ] = 0.0,
    late: Annotated[
        float, typer.Option(metavar="MS", help="How late accelerometer and gyro are, ms.")
    ] = 0.0,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """Turns over a ramp, as a raw magnetometer, accelerometer and gyro record them."""
    from datetime import UTC, datetime

    import numpy as np

    from agonic.console.output import finish_made
    from agonic.exports.csv import write_csv
    from agonic.field.place import choose_model
    from agonic.files.calibration import save
    from agonic.simulation import simulate, with_inertial_unit
    from agonic.simulation.defects import round_as_logged

    epoch = datetime(2026, 5, 1, 10, 0, tzinfo=UTC)
    place = choose_model(epoch.year + 0.33).at(LATITUDE_DEG, LONGITUDE_DEG, 0.0, epoch)
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
    where = {
        "latitude_deg": np.full(n, LATITUDE_DEG),
        "longitude_deg": np.full(n, LONGITUDE_DEG),
        "altitude_m": np.zeros(n),
        "epoch": epoch,
    }
    write_csv(round_as_logged(unit(made.samples).with_columns(**where)), out)
    file = save(made.truth, out.with_suffix(".truth.json"))
    record = {"kind": "rover", "n": n, "files": [out, file], "bias_nT": made.truth.bias}
    return finish_made(
        n,
        "readings",
        out,
        f"The truth: {file}",
        record={**record, "matrix": made.truth.matrix},
        as_json=as_json,
        next_step=f"agonic calibrate {quote(str(out))}",
    )
