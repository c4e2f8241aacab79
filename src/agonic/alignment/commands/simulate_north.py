"""`agonic simulate north|coil -o DIR`: sessions with a gyrotheodolite and with a coil."""

from __future__ import annotations

from pathlib import Path
from typing import Any

KINDS = ("north", "coil")


def session(kind: str, out: Path, *, as_json: bool, seed: int, noise: float | None) -> int:
    """Write the session's description with its tables, and the truth in a folder of its own."""
    from agonic.console.output import print_json, say

    settings = {"seed": seed} | ({} if noise is None else {"noise": noise})
    files, truth = (_north if kind == "north" else _coil)(out, settings)
    written = _truth(out, kind, truth)
    if as_json:
        print_json(
            f"agonic/simulate-{kind}@1",
            {"files": [str(file) for file in (*files, written)], **truth},
        )
    else:
        say(f"A session: {out}\nThe truth: {written}")
    return 0


def _north(out: Path, settings: dict[str, Any]) -> tuple[list[Path], dict[str, Any]]:
    from agonic.alignment.files.write_north import write_north
    from agonic.alignment.simulation.north import simulate_north

    made = simulate_north(**settings)
    return write_north(made.session, out), {
        "north_deg": made.north_deg,
        "mark_azimuth_deg": made.mark_azimuth_deg,
        "matrix_mb": made.rot_mb,
    }


def _coil(out: Path, settings: dict[str, Any]) -> tuple[list[Path], dict[str, Any]]:
    from agonic.alignment.files.write_coil import write_coil
    from agonic.alignment.simulation.coil import simulate_coil

    made = simulate_coil(**settings)
    return write_coil(made.session, out), {
        "vector_nT_A": made.vector,
        "axis_n": made.axis_n,
        "geometric_deg": made.geometric_deg,
    }


def _truth(out: Path, kind: str, facts: dict[str, Any]) -> Path:
    import json

    from agonic.atomic import make_folder, write_atomically
    from agonic.console.output import plain

    home = make_folder(out / "truth")
    text = json.dumps(plain({"schema": f"agonic/{kind}-truth@1", **facts}), indent=1)
    return write_atomically(home / "truth.json", text + "\n")
