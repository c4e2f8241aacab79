"""`agonic simulate north|coil -o DIR`: sessions with a gyrotheodolite and with a coil."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Any

import typer

from agonic.console.options import Json
from agonic.console.simulation_options import Folder, Noise, Seed


def add_to(kinds: typer.Typer) -> None:
    """Register the kinds."""
    kinds.command("north")(north)
    kinds.command("coil")(coil)


def north(out: Folder, noise: Noise = 0.5, seed: Seed = 0, as_json: Json = False) -> int:
    """A session with a gyrotheodolite: north.toml, its tables, and the truth in its own folder."""
    from agonic.alignment.files.write_north import write_north
    from agonic.alignment.simulation.north import simulate_north

    made = simulate_north(noise=noise, seed=seed)
    truth = {
        "north_deg": made.north_deg,
        "mark_azimuth_deg": made.mark_azimuth_deg,
        "matrix_mb": made.rot_mb,
    }
    return _finish("north", out, write_north(made.session, out), truth, as_json)


def coil(out: Folder, noise: Noise = 0.5, seed: Seed = 0, as_json: Json = False) -> int:
    """A session with a coil: coil.toml, its table, and the truth in its own folder."""
    from agonic.alignment.files.write_coil import write_coil
    from agonic.alignment.simulation.coil import simulate_coil

    made = simulate_coil(noise=noise, seed=seed)
    truth = {
        "vector_nT_A": made.vector,
        "axis_n": made.axis_n,
        "geometric_deg": made.geometric_deg,
    }
    return _finish("coil", out, write_coil(made.session, out), truth, as_json)


def _finish(kind: str, out: Path, files: list[Path], truth: dict[str, Any], as_json: bool) -> int:
    """Write the truth beside the session, and say where both are."""
    import json

    from agonic.atomic import make_folder, write_atomically
    from agonic.console.output import plain, print_json, say

    text = json.dumps(plain({"schema": f"agonic/{kind}-truth@1", **truth}), indent=1)
    written = write_atomically(make_folder(out / "truth") / "truth.json", text + "\n")
    if as_json:
        print_json(
            f"agonic/simulate-{kind}@1",
            {"files": [str(file) for file in (*files, written)], **truth},
        )
    else:
        say(f"A session: {out}\nThe truth: {written}")
        say(f"\nNext      agonic fit {kind} {quote(str(out))} --report {kind}.html")
    return 0
