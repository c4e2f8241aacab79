"""`agonic simulate alignment -o DIR`: a session with a star sensor, and its truth."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Json
from agonic.console.simulation_options import Folder, Noise, Seed

if TYPE_CHECKING:
    from agonic.alignment.simulation.session import SimulatedSession


def add_to(kinds: typer.Typer) -> None:
    """Register the kind."""
    kinds.command("alignment")(alignment)


def alignment(
    out: Folder,
    orientations: Annotated[int, typer.Option(help="How many.", min=1)] = 24,
    readings: Annotated[int, typer.Option("-n", help="Readings in each.", min=1)] = 20,
    noise: Noise = 0.5,
    remanence: Annotated[
        float | None, typer.Option(metavar="NT", help="The platform's own field.", min=0)
    ] = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """A session with a star sensor: session.toml, its tables, and the truth in its own folder."""
    from agonic.alignment.files.write_session import write_session
    from agonic.alignment.simulation.session import simulate_session
    from agonic.console.output import print_json, say_made

    made = simulate_session(
        orientations=orientations, readings=readings, noise=noise, remanence=remanence, seed=seed
    )
    files = write_session(made.session, out)
    truth = write_truth(made, out / "truth")
    if as_json:
        print_json(
            "agonic/simulate-alignment@1",
            {
                "orientations": len(made.session.orientations),
                "n": len(made.session.magnetometer),
                "files": [str(file) for file in (*files, truth)],
                "angles_323_deg": _angles(made),
                "matrix_mc": made.rot_mc,
            },
        )
        return 0
    what = f"readings in {len(made.session.orientations)} orientations"
    following = f"agonic fit alignment {quote(str(out))} -o cal.json --report alignment.html"
    say_made(len(made.session.magnetometer), what, out, f"The truth: {truth}", next_step=following)
    return 0


def _angles(made: SimulatedSession) -> Any:
    from agonic.maths.rotations.frames import angles_323_deg

    return angles_323_deg(made.rot_mc)


def write_truth(made: SimulatedSession, folder: Path) -> Path:
    """The rotations, the pier difference, bias and matrix, as JSON."""
    import json

    from agonic.atomic import make_folder, write_atomically
    from agonic.console.output import plain
    from agonic.maths.rotations.frames import ARCSEC_RAD

    facts = {
        "schema": "agonic/alignment-truth@1",
        "angles_323_deg": _angles(made),
        "matrix_mc": made.rot_mc,
        "reference_turn_arcsec": made.reference_turn / ARCSEC_RAD,
        "pier_nT": made.offset,
        "bias_nT": made.bias,
        "matrix": made.matrix,
    }
    home = make_folder(folder)
    text = json.dumps(plain(facts), indent=1, ensure_ascii=False)
    return write_atomically(home / "truth.json", text + "\n")
