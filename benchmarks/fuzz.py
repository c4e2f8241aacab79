"""Damage and extreme values against readers, documents and commands: `make fuzz MINUTES=2`.

Each try has a seed of its own, printed with what broke; `--seed N` repeats it alone. Nothing but
exit status 0, 1 or 2 with at most one line of complaint is right: an error that was not foreseen,
a traceback, or a try that takes longer than the limit counts as broken.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fuzz_bytes import change_bytes
from benchmarks.fuzz_files import make_damaged

SECONDS = 30
"""How long one try may take."""
MOST_BYTES = 2_500_000_000
"""How much memory a reader may take, libraries included."""
READERS = 0.75
"""Share of tries that are readers alone: they are many times faster."""
EXTREMES = (
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-308",
    "1e15",
    "-1",
    "0",
    "",
    "x",
    "9" * 400,
)
COLUMNS = (
    "temperature_C",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "current_A",
    "latitude_deg",
    "longitude_deg",
    "altitude_m",
    "epoch_unix_s",
    "acc_x_m_s2",
    "acc_y_m_s2",
    "acc_z_m_s2",
    "scalar_nT",
    "throttle",
)
COMMANDS = (
    "info LOG",
    "calibrate LOG -o out",
    "calibrate LOG --at 50,10 --date 2024-05-01 -o out",
    "calibrate LOG --field 50000 --method levelled -o out",
    "fit ellipsoid LOG -o made.json --json",
    "fit latency LOG",
    "apply CAL LOG -o made.csv",
    "verify CAL LOG --field 50000 --json",
    "report CAL LOG -o made.html",
    "report CAL -o made.html --json",
    "export CAL --to ros -o made.yaml",
    "export CAL --to c -o made.h",
    "heading CAL LOG -o made.csv",
    "fit deviation SWING",
    "fleet LOG -o fleet --workers 0 --reports",
)


def make_inputs(rng: np.random.Generator) -> None:
    """A log, a calibration and a swing in the folder one works in, each as it should be."""
    import agonic as ag
    from agonic.exports.csv import write_csv

    samples = ag.simulate(str(rng.choice(["tumble", "hand"])), n=400, seed=1).samples
    write_csv(samples, "LOG")
    fit = ag.fit_ellipsoid(samples, ag.Reference.constant(50_000))
    ag.save(fit.calibration, "CAL")
    Path("SWING").write_text("compass,deviation\nN,10.5E\n45,3 E\n90,1\n135,1.2 W\n180,2\n270,1\n")


def change_words(text: str, rng: np.random.Generator) -> str:
    """The text with some of its numbers and words extreme."""
    parts = text.replace("\n", ",\n").split(",")
    for at in rng.integers(0, len(parts), int(rng.integers(1, 12))):
        parts[at] = ("\n" if parts[at].startswith("\n") else "") + str(rng.choice(EXTREMES))
    return ",".join(parts).replace(",\n", "\n")


def change_columns(text: str, rng: np.random.Generator) -> str:
    """A table with columns more, of extreme or standing values, or with columns held still."""
    header, *rows = text.strip().split("\n")
    rows = rows[: int(rng.choice([1, 2, 11, 40, len(rows)]))]
    cells = [row.split(",") for row in rows]
    for at in range(1, 4):
        if rng.random() < 0.3:
            factor = float(rng.choice([0.0, 1e-300, 1e12, 1e30, 1e304]))
            for row in cells:
                row[at] = repr(float(row[at]) * factor)
    names = list(rng.choice(COLUMNS, int(rng.integers(0, 6)), replace=False))
    for _ in names:
        scale = 10.0 ** float(rng.choice([-300, -3, 0, 1, 2, 9, 200]))
        for row in cells:
            row.append(repr(float(scale * rng.normal())))
    return "\n".join([",".join([header, *names]), *(",".join(row) for row in cells)])


def attempt(seed: int) -> str:
    """What one try with this seed broke, or ""."""
    rng = np.random.default_rng(seed)
    return attempt_reader(rng) if rng.random() < READERS else attempt_command(rng)


def attempt_reader(rng: np.random.Generator) -> str:
    """What a reader does with a damaged file that it should not, or ""."""
    from agonic.errors import AgonicError
    from agonic.logs.read import open_log

    path = Path("recording")
    what = make_damaged(path, rng)
    began = time.monotonic()
    try:
        for samples in open_log(path).sensors:
            if not all(np.isfinite(column).all() for column in samples.columns().values()):
                return f"{what}: values that are no numbers"
    except AgonicError as error:
        if "\n" in str(error) or isinstance(error.__cause__, MemoryError):
            return f"{what}: {error}"
        if unforeseen := find_unforeseen(error):
            return f"{what}: not foreseen\n{''.join(traceback.format_exception(unforeseen))}"
    except BaseException:
        return f"{what} after {time.monotonic() - began:.1f} s\n{traceback.format_exc()}"
    return ""


def find_unforeseen(error: BaseException) -> BaseException | None:
    """The error that a reader did not foresee, of which `open_log` made one line.

    What a reader foresees it tells in its own words: damage that it looks for, or an error that its
    library has for damaged files. All else, an index out of range, is a fault of the reader.
    """
    from agonic.errors import AgonicError
    from agonic.logs.read import UNFORESEEN

    while error.__cause__ is not None:
        if UNFORESEEN in str(error) and not isinstance(error.__cause__, AgonicError | OSError):
            return error.__cause__
        error = error.__cause__
    return None


def attempt_command(rng: np.random.Generator) -> str:
    """What a command with a damaged log or document broke, or ""."""
    from agonic.cli import run

    make_inputs(rng)
    command = str(rng.choice(COMMANDS)).split()
    victim = Path(str(rng.choice([word for word in command if word.isupper()])))
    kind = int(rng.integers(3))
    if kind == 0:
        victim.write_bytes(change_bytes(victim.read_bytes(), rng))
    elif kind == 1 or victim.name != "LOG":
        victim.write_text(change_words(victim.read_text(), rng))
    else:
        victim.write_text(change_columns(victim.read_text(), rng))
    said, complained = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
            status = run(command)
    except BaseException:
        return f"{' '.join(command)} with {victim}\n{traceback.format_exc()}"
    lines = [line for line in complained.getvalue().splitlines() if "warning:" not in line]
    if status not in (0, 1, 2) or len(lines) > 1 or "Traceback" in complained.getvalue():
        return f"{' '.join(command)} with {victim}: status {status}\n" + "\n".join(lines)
    return ""


def try_seed(seed: int) -> str:
    """As `attempt`, in a process and a folder of its own, no longer and no larger than it may."""
    with tempfile.TemporaryDirectory() as folder:
        said = Path(folder, ".said")
        child = os.fork()
        if not child:
            os.chdir(folder)
            signal.signal(signal.SIGALRM, stop)
            signal.alarm(SECONDS)
            resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
            said.write_text(attempt(seed))
            os._exit(0)
        _, status = os.waitpid(child, 0)
        if not said.is_file():
            return f"the process ended with status {status}"
        return said.read_text()


def preload() -> None:
    """Import once what every try needs: each is a process that begins as a copy of this one."""
    import h5py  # noqa: F401
    import pyarrow.parquet  # noqa: F401
    import scipy.io  # noqa: F401

    import agonic as ag
    from agonic.logs.formats import FORMATS

    for kind in FORMATS:
        _ = kind.reader
    _ = ag.simulate, ag.fit_ellipsoid


def stop(*_: Any) -> None:
    """End a try that takes too long."""
    raise TimeoutError(f"longer than {SECONDS} s")


def main() -> int:
    """Try seeds until their number or the time is over; returns 1 where something broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--tries", type=int, help="so many instead: the same on every machine")
    parser.add_argument("--seed", type=int, help="repeat this one alone")
    parser.add_argument("--first", type=int, help="seeds from here on; default: by the clock")
    given = parser.parse_args()
    os.environ["AGONIC_DEBUG"] = "1"
    most = 1 if given.seed is not None else given.tries
    first = next(n for n in (given.seed, given.first, int(time.time()) * 1000) if n is not None)
    preload()
    end = time.monotonic() + 60 * given.minutes
    print(f"seeds from {first}", flush=True)
    tried = broken = 0
    while tried < most if most else time.monotonic() < end:
        if trouble := try_seed(first + tried):
            broken += 1
            print(f"\nseed {first + tried}: {trouble}", flush=True)
        tried += 1
    print(f"{tried} tries, {broken} broken")
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
