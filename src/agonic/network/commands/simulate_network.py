"""`agonic simulate network|paper|paper-space|nonaffine`: a sensor and the field it was in."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from agonic.console.options import Folder, Json, Noise, Readings, Seed, Table

if TYPE_CHECKING:
    from agonic.network.simulate import SimulatedField


def network(out: Folder, noise: Noise = 2.0, seed: Seed = 0, as_json: Json = False) -> int:
    """The paper's sensor calibrated by networks, as published: figures and numbers on one page."""
    from agonic.console.finish import finish
    from agonic.files.calibration import save
    from agonic.network.paper import describe_paper, reproduce_paper

    found = reproduce_paper(noise=noise, seed=seed)
    out.mkdir(parents=True, exist_ok=True)
    files = [
        *_write(found.made, out / "flight.csv"),
        save(found.ground.calibration, out / "ground.json"),
        save(found.again.calibration, out / "retrained.json"),
    ]
    return finish(describe_paper(found), files=files, report=out / "network.html", as_json=as_json)


def paper(
    out: Table, n: Readings = 3000, noise: Noise = 2.0, seed: Seed = 0, as_json: Json = False
) -> int:
    """A published simulation (Wang, 2020): a sensor that changes, in a known field."""
    from agonic.network.simulate import simulate_paper

    return _finish("paper", simulate_paper(n / 100.0, noise=noise, seed=seed), out, as_json)


def paper_space(
    out: Table, n: Readings = 3000, noise: Noise = 2.0, seed: Seed = 0, as_json: Json = False
) -> int:
    """The paper's sensor in a field of all directions, not only along a plane."""
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
    from agonic.console.output import finish_made

    files = _write(made, out)
    n, known = len(made.samples), files[1]
    return finish_made(
        n,
        "readings",
        out,
        f"The known field: {known}",
        record={"kind": kind, "n": n, "files": files},
        as_json=as_json,
        next_step=f"agonic fit network {quote(str(out))} --reference {quote(str(known))} "
        "-o mag.json",
    )


def _write(made: SimulatedField, out: Path) -> list[Path]:
    """Readings and known field as tables."""
    from agonic.exports.csv import write_csv

    beside = ("temperature", "roll_deg", "pitch_deg", "heading_deg", "acceleration")
    none = dict.fromkeys((*beside, "rotation_rate"))
    known = made.samples.with_columns(field=made.field, name="reference", **none)
    return [write_csv(made.samples, out), write_csv(known, out.with_suffix(".reference.csv"))]
