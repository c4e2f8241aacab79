"""`agonic simulate paper|paper-space|nonaffine -o FILE`: a sensor and the field it was in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from agonic.console.options import Json
from agonic.console.simulation_options import Noise, Readings, Seed, Table

if TYPE_CHECKING:
    from agonic.network.simulate import SimulatedField


def add_to(kinds: typer.Typer) -> None:
    """Register the kinds."""
    kinds.command("paper")(paper)
    kinds.command("paper-space")(paper_space)
    kinds.command("nonaffine")(nonaffine)


def paper(
    out: Table, n: Readings = 3000, noise: Noise = 2.0, seed: Seed = 0, as_json: Json = False
) -> int:
    """A published simulation (Wang, 2020): a sensor that changes, in a known field."""
    from agonic.network.simulate import simulate_paper

    return _finish("paper", simulate_paper(n / 100.0, noise=noise, seed=seed), out, as_json)


def paper_space(
    out: Table, n: Readings = 3000, noise: Noise = 2.0, seed: Seed = 0, as_json: Json = False
) -> int:
    """The same with a field that points in all directions, not only along a plane."""
    from agonic.network.simulate import simulate_paper

    made = simulate_paper(n / 100.0, directions="space", noise=noise, seed=seed)
    return _finish("paper-space", made, out, as_json)


def nonaffine(
    out: Table, n: Readings = 3000, noise: Noise = 20.0, seed: Seed = 0, as_json: Json = False
) -> int:
    """A sensor that no affine calibration fits, and the known field."""
    from agonic.network.simulate import simulate_nonaffine

    made = simulate_nonaffine(n=n, noise=noise, seed=seed)
    return _finish("nonaffine", made, out, as_json)


def _finish(kind: str, made: SimulatedField, out: Path, as_json: bool) -> int:
    """The readings as one table, and the known field as another, FILE.reference.csv."""
    from agonic.console.output import print_json, say
    from agonic.exports.csv import write_csv

    write_csv(made.samples, out)
    known = out.with_suffix(".reference.csv")
    write_csv(
        made.samples.with_columns(
            field=made.field,
            temperature=None,
            roll_deg=None,
            pitch_deg=None,
            heading_deg=None,
            acceleration=None,
            rotation_rate=None,
            name="reference",
        ),
        known,
    )
    if as_json:
        print_json(
            "agonic/simulate@1",
            {
                "kind": kind,
                "n": len(made.samples),
                "files": [str(out), str(known)],
            },
        )
    else:
        say(f"{len(made.samples)} readings: {out}\nThe known field: {known}")
    return 0
