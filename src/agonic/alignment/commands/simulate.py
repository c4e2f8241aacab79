"""`agonic simulate alignment|north|coil -o DIR`: sessions, and their truth."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Folder, Json, Noise, Seed
from agonic.readable import make_record

if TYPE_CHECKING:
    from agonic.alignment.session.session import Recorded


def alignment(
    out: Folder,
    orientations: int = 24,
    readings: Annotated[int, typer.Option("-n", help="Readings in each.", min=1)] = 20,
    noise: Noise = 0.5,
    remanence: float | None = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """A session with a star sensor: session.toml, its tables, and the truth in its own folder.

    Options
    -------
    orientations ≥1 : How many.
    remanence NT ≥0 : The platform's own field.
    """
    from agonic.alignment.files.sessions import write_session
    from agonic.alignment.simulation.session import simulate_session
    from agonic.maths.rotations.frames import ARCSEC_RAD, angles_323_deg

    made = simulate_session(
        orientations=orientations, readings=readings, noise=noise, remanence=remanence, seed=seed
    )
    shown = {"angles_323_deg": angles_323_deg(made.rot_mc), "matrix_mc": made.rot_mc}
    truth = shown | make_record(made) | {"reference_turn_arcsec": made.reference_turn / ARCSEC_RAD}
    stood, files = len(made.session.orientations), write_session(made.session, out)
    facts = {"orientations": stood, "n": len(made.session.magnetometer), **shown}
    return _finish("alignment", made.session, out, files, truth, as_json, facts)


def north(
    out: Folder,
    noise: Noise = 0.5,
    constant_sd: float = 1.0,
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """A session with a gyrotheodolite: north.toml, its tables, and the truth in its own folder.

    Options
    -------
    constant_sd ARCSEC ≥0.0 : How well the gyro's constant is known.
    """
    from agonic.alignment.files.sessions import write_north
    from agonic.alignment.simulation.laboratory import simulate_north

    made = simulate_north(noise=noise, constant_sd_arcsec=constant_sd, seed=seed)
    files = write_north(made.session, out)
    return _finish("north", made.session, out, files, make_record(made), as_json)


def coil(out: Folder, noise: Noise = 0.5, seed: Seed = 0, as_json: Json = False) -> int:
    """A session with a coil: coil.toml, its table, and the truth in its own folder."""
    from agonic.alignment.files.sessions import write_coil
    from agonic.alignment.simulation.laboratory import simulate_coil

    made = simulate_coil(noise=noise, seed=seed)
    files = write_coil(made.session, out)
    return _finish("coil", made.session, out, files, make_record(made), as_json)


def _finish(
    kind: str,
    session: Recorded,
    out: Path,
    files: list[Path],
    truth: dict[str, Any],
    as_json: bool,
    facts: dict[str, Any] | None = None,
) -> int:
    """Write the truth beside the session, and say where both are; `facts` are for programs."""
    from agonic.console.output import finish_made, write_truth

    written = write_truth(kind, truth, out / "truth")
    saved = "-o cal.json " if kind == "alignment" else ""
    of = f"in {facts['orientations']} orientations" if facts else "of the magnetometer"
    return finish_made(
        len(session.corrected),
        f"readings {of}",
        out,
        f"The truth: {written}",
        record={"files": [*files, written], **(facts or truth)},
        as_json=as_json,
        next_step=f"agonic fit {kind} {quote(str(out))} {saved}--report {kind}.html",
        schema=f"agonic/simulate-{kind}@1",
    )
