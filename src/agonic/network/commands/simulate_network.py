"""`agonic simulate paper|paper-space|nonaffine -o FILE`: a sensor and the field it was in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agonic.network.simulate import SimulatedField

KINDS = ("paper", "paper-space", "nonaffine")


def network(kind: str, out: Path, as_json: bool, *, n: int, noise: float | None, seed: int) -> int:
    """The readings as one table, and the known field as another, FILE.reference.csv."""
    from agonic.console.output import print_json, say
    from agonic.exports.csv import write_csv

    made = _simulated(kind, n, noise, seed)
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


def _simulated(kind: str, n: int, noise: float | None, seed: int) -> SimulatedField:
    from agonic.network.simulate import simulate_nonaffine, simulate_paper

    if kind == "nonaffine":
        return simulate_nonaffine(n=n, noise=20.0 if noise is None else noise, seed=seed)
    return simulate_paper(
        n / 100.0,
        directions="space" if kind == "paper-space" else "planar",
        noise=2.0 if noise is None else noise,
        seed=seed,
    )
