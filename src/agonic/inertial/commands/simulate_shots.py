"""`agonic simulate shots -o FILE`: an instrument held still in many attitudes."""

from __future__ import annotations

from shlex import quote
from typing import NamedTuple

from agonic.console.options import Json, Seed, Table


class Survey(NamedTuple):
    """What is simulated, as for `simulate_shots`.

    Options
    -------
    attitudes ≥0 : Shots without a target.
    targets ≥0 : Targets that the sight is kept on.
    rolls ≥1 : Shots at each, rolled about the sight.
    noise ≥0 : Of the magnetometer, sd, nT.
    pointing_deg --pointing ≥0 : Of the sight, sd, degrees.
    bad ≥0 : Shots beside a lump of iron.
    survey ≥0 : Another number: other shots by the same instrument.
    """

    attitudes: int = 8
    targets: int = 2
    rolls: int = 8
    noise: float = 150.0
    pointing_deg: float = 0.1
    bad: int = 0
    survey: int = 0
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
