"""`agonic simulate rover -o FILE`: a vehicle that stays level, with raw sensors and no attitude."""

from __future__ import annotations

from shlex import quote
from typing import Annotated

import typer

from agonic.console.options import Json
from agonic.console.simulation_options import Noise, Readings, Seed, Table

LATITUDE_DEG, LONGITUDE_DEG = 52.1, 5.2


def rover(
    out: Table,
    n: Readings = 6000,
    noise: Noise = 200.0,
    tilt: Annotated[float, typer.Option(help="Largest tilt, degrees.", min=0)] = 5.0,
    accelerometer_bias: Annotated[
        float, typer.Option(help="Of each axis of the accelerometer, sd, m/s².", min=0)
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
    from agonic.simulation.resolution import round_as_logged

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
