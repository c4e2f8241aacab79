"""Logs of boards whose calibration is known, and others that are no good."""

from pathlib import Path

import numpy as np

from agonic.calibration.affine import Affine
from agonic.exports.csv import write_csv
from agonic.fleet.engine import Here
from agonic.fleet.run import run_fleet
from agonic.fleet.settings import FleetRun
from agonic.simulation import simulate

ROWS = 300


def write_boards(folder: Path, n: int, *, first: int = 0) -> dict[str, Affine]:
    """`n` good logs and the truth of each, by sensor."""
    folder.mkdir(parents=True, exist_ok=True)
    truth = {}
    for seed in range(first, first + n):
        made = simulate("sphere", n=ROWS, seed=seed)
        write_csv(made.samples, folder / f"board{seed:03}.csv")
        truth[f"board{seed:03}"] = made.truth
    return truth


def write_bad(folder: Path) -> dict[str, str]:
    """Logs that cannot be calibrated, with a word of the reason that each should be given."""
    folder.mkdir(parents=True, exist_ok=True)
    whole = simulate("sphere", n=ROWS, seed=99)
    write_csv(whole.samples, folder / "short.csv")
    lines = (folder / "short.csv").read_text().splitlines(keepends=True)
    contents = {
        "empty.csv": (b"", "the file is empty"),
        "blank.csv": (b"\n\n", "no lines with values"),
        "noise.bin": (np.random.default_rng(0).bytes(3000), "binary data"),
        "cut.ulg": (b"ULog\x01\x12\x35\x01" + bytes(8), "holds no readings"),
        "footless.parquet": (b"PAR1" + bytes(100), "damaged"),
        "words.csv": (b"time_s,heading_deg\n0,1\n1,2\n", "no magnetometer"),
        "short.csv": ("".join(lines[:4]).encode(), "cannot determine"),
        "picture.csv": (b"\x89PNG\r\n\x1a\n" + bytes(50), "a PNG picture"),
    }
    for name, (content, _) in contents.items():
        (folder / name).write_bytes(content)
    return {name: reason for name, (_, reason) in contents.items()}


def run_here(*inputs: Path | str, out: Path, **settings: object) -> FleetRun:
    """A fleet in this process."""
    return run_fleet(inputs, out, engine=Here(), **settings)  # type: ignore[arg-type]
