"""`agonic simulate alignment -o DIR`: a session with a star sensor, and its truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from agonic.alignment.simulation.session import SimulatedSession


def alignment(out: Path, *, as_json: bool, **settings: Any) -> int:
    """Write session.toml with its tables, and the truth in a folder of its own."""
    from agonic.alignment.files.write_session import write_session
    from agonic.alignment.simulation.session import simulate_session
    from agonic.console.output import print_json, say

    made = simulate_session(**settings)
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
    say(
        f"{len(made.session.orientations)} orientations, {len(made.session.magnetometer)} "
        f"readings: {out}\nThe truth: {truth}"
    )
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
