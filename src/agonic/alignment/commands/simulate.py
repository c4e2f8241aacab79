"""`agonic simulate alignment|north|coil -o DIR`: sessions, and their truth."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated, Any, NamedTuple

import typer

from agonic.console.options import Folder, Json, Noise, Seed


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
    from agonic.alignment.files.write import write_session
    from agonic.alignment.simulation.session import simulate_session
    from agonic.maths.rotations.frames import ARCSEC_RAD, angles_323_deg

    made = simulate_session(
        orientations=orientations, readings=readings, noise=noise, remanence=remanence, seed=seed
    )
    shown = {"angles_323_deg": angles_323_deg(made.rot_mc), "matrix_mc": made.rot_mc}
    truth = shown | {
        "reference_turn_arcsec": made.reference_turn / ARCSEC_RAD,
        "pier_nT": made.offset,
        "bias_nT": made.bias,
        "matrix": made.matrix,
    }
    counts = {"orientations": len(made.session.orientations), "n": len(made.session.magnetometer)}
    what = f"readings in {counts['orientations']} orientations"
    files = write_session(made.session, out)
    following = f"agonic fit alignment {quote(str(out))} -o cal.json --report alignment.html"
    said = _Said(counts["n"], what, following, counts | shown)
    return _finish("alignment", out, files, truth, said, as_json)


def north(out: Folder, noise: Noise = 0.5, seed: Seed = 0, as_json: Json = False) -> int:
    """A session with a gyrotheodolite: north.toml, its tables, and the truth in its own folder."""
    from agonic.alignment.files.write import write_north
    from agonic.alignment.simulation.north import simulate_north

    made = simulate_north(noise=noise, seed=seed)
    truth = {
        "north_deg": made.north_deg,
        "mark_azimuth_deg": made.mark_azimuth_deg,
        "matrix_mb": made.rot_mb,
    }
    following = f"agonic fit north {quote(str(out))} --report north.html"
    said = _Said(len(made.session.corrected), "readings of the magnetometer", following, truth)
    return _finish("north", out, write_north(made.session, out), truth, said, as_json)


def coil(out: Folder, noise: Noise = 0.5, seed: Seed = 0, as_json: Json = False) -> int:
    """A session with a coil: coil.toml, its table, and the truth in its own folder."""
    from agonic.alignment.files.write import write_coil
    from agonic.alignment.simulation.coil import simulate_coil

    made = simulate_coil(noise=noise, seed=seed)
    truth = {
        "vector_nT_A": made.vector,
        "axis_n": made.axis_n,
        "geometric_deg": made.geometric_deg,
    }
    following = f"agonic fit coil {quote(str(out))} --report coil.html"
    said = _Said(len(made.session.corrected), "readings of the magnetometer", following, truth)
    return _finish("coil", out, write_coil(made.session, out), truth, said, as_json)


class _Said(NamedTuple):
    """What is said of a session: how many of what, the next command, and the facts in JSON."""

    n: int
    what: str
    following: str
    facts: dict[str, Any]


def _finish(
    kind: str, out: Path, files: list[Path], truth: dict[str, Any], said: _Said, as_json: bool
) -> int:
    """Write the truth beside the session, and say where both are."""
    import json

    from agonic.atomic import make_folder, write_atomically
    from agonic.console.output import finish_made, plain

    facts = plain({"schema": f"agonic/{kind}-truth@1", **truth})
    text = json.dumps(facts, indent=1, ensure_ascii=False)
    written = write_atomically(make_folder(out / "truth") / "truth.json", text + "\n")
    return finish_made(
        said.n,
        said.what,
        out,
        f"The truth: {written}",
        record={"files": [*files, written], **said.facts},
        as_json=as_json,
        next_step=said.following,
        schema=f"agonic/simulate-{kind}@1",
    )
