"""All benchmarks in one go, or those that are named: python -m benchmarks.run [NAME …] [--full].

Those whose figures are times run one after the other; the rest share the processors. What each
prints becomes results/NAME.md, with the command, the day, the versions and the machine below it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from benchmarks import facts, tables


class Part(NamedTuple):
    """One table: its scripts with their options, the packages beside which it measures, the options
    of the larger study, whether other parts may run meanwhile (no figure is a time), and whether it
    runs in the environment of those packages that want an older NumPy."""

    name: str
    scripts: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    full: str = ""
    shares: bool = False
    apart: bool = False

    def commands(self, full: bool, quick: bool) -> list[str]:
        """What is typed after `python -m`."""
        more = self.full if full else "--quick" if quick else ""
        return [
            f"benchmarks.{script} {more}".strip() if more else f"benchmarks.{script}"
            for script in self.scripts or (self.name,)
        ]


LIBRARIES = ("magyc", "magcal")
PEERS = Path(__file__).parents[1] / ".venv-peers" / "bin" / "python"
"""The environment with these libraries; without it their columns say that they are not there."""
PARTS = (
    Part("speed", rivals=LIBRARIES, apart=True),
    Part("ratios", rivals=("pyarrow", "pymavlink", "pyulog", "h5py", "scipy")),
    Part("growth", full="--full"),
    Part("readers", rivals=("pyarrow", "h5py", "pymavlink", "pyulog")),
    Part("field", rivals=("chaosmagpy", "ppigrf", "wmm-calculator", "pygeomag")),
    Part("heading"),
    Part("tracking", rivals=("numba",)),
    Part("network", rivals=("jax", "optax")),
    Part("inflight", full="--draws 10"),
    Part("fleet_dataset", rivals=("duckdb",)),
    Part("fleet_logs", rivals=("dask",), full="--logs 10000"),
    Part("fleet_recording", rivals=("pyarrow",), full="--full"),
    Part("fleet_workers", rivals=("dask",)),  # quotes the two before
    Part("torture", ("torture", "torture_wings", "torture_recorded"), full="--draws 20"),
    Part("honesty", full="--full"),
    Part("estimators", rivals=LIBRARIES, full="--full", apart=True),
    Part("thermal", full="--draws 20", shares=True),
    Part("retraining", full="--draws 2", shares=True),
    Part("smoothing", rivals=("vqf",), full="--draws 20", shares=True),
    Part("inertial", rivals=("vqf",), full="--draws 20", shares=True),
    Part("axes", full="--draws 3", shares=True),
    Part("real", rivals=LIBRARIES, shares=True, apart=True),
    Part("fleet_faults", full="--draws 2000", shares=True),
    Part("disturbers", full="--draws 40", shares=True),
    Part("controller", shares=True),
    Part("records", full="--draws 100", shares=True),
)


class Done(NamedTuple):
    """What became of a part: seconds on the clock, and whether its table is new."""

    name: str
    seconds: float
    fresh: bool


def run_part(part: Part, *, full: bool, quick: bool) -> Done:
    """Run the scripts of a part and keep what they print; nothing is kept of a quick run."""
    begun, load = time.monotonic(), os.getloadavg()[0]
    commands = part.commands(full, quick)
    python = str(PEERS) if part.apart and PEERS.exists() else sys.executable
    printed = []
    for command in commands:
        done = subprocess.run([python, "-m", *command.split()], stdout=subprocess.PIPE, text=True)
        printed.append(done.stdout.strip())
        if done.returncode and not _found_fault(done.stdout):
            tables.progress(f"{part.name}: {command} ended with status {done.returncode}")
            return Done(part.name, time.monotonic() - begun, False)
    seconds = time.monotonic() - begun
    title = [] if printed[0].startswith("# ") else [f"# {part.name.replace('_', ' ').capitalize()}"]
    asked = [python, "-m", "benchmarks.facts", *part.rivals]
    software = subprocess.run(asked, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()
    made = facts.describe(commands, seconds, load, software)
    tables.publish(part.name, [*title, *printed, made], keep=not quick)
    return Done(part.name, seconds, True)


def _found_fault(printed: str) -> bool:
    """Whether a script with a status of its own ended: its table says what was wrong."""
    return "Confidently wrong:" in printed


def run_parts(parts: Sequence[Part], *, full: bool, quick: bool) -> list[Done]:
    """The parts that are times one by one, then the others, one on each processor."""
    done = []
    for part in (part for part in parts if not part.shares):
        tables.progress(f"{part.name}: running")
        done.append(run_part(part, full=full, quick=quick))
        tables.progress(f"{part.name}: {done[-1].seconds:.0f} s")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        together = [part for part in parts if part.shares]
        tables.progress(f"together: {', '.join(part.name for part in together) or 'none'}")
        done += pool.map(lambda part: run_part(part, full=full, quick=quick), together)
    return done


def summarise(done: Sequence[Done], seconds: float) -> str:
    """The parts and their seconds, and one line for all."""
    lines = [
        f"{one.name:<18}{one.seconds:>7.0f} s{'' if one.fresh else '  FAILED'}" for one in done
    ]
    failed = [one.name for one in done if not one.fresh]
    outcome = f"not remade: {', '.join(failed)}" if failed else "all tables are new"
    whole = f"{len(done)} parts in {seconds / 60:.1f} minutes, {outcome}; {facts.software()}; "
    return "\n".join([*lines, whole + facts.machine()])


def main() -> int:
    """Run what is asked for; status 1 where a part failed."""
    parser = argparse.ArgumentParser(description="all benchmarks, or those that are named")
    parser.add_argument("names", nargs="*", help=", ".join(part.name for part in PARTS))
    parser.add_argument("--full", action="store_true", help="the larger studies")
    parser.add_argument("--quick", action="store_true", help="small cases; keeps nothing")
    asked = parser.parse_args()
    unknown = set(asked.names) - {part.name for part in PARTS}
    if unknown:
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    chosen = [part for part in PARTS if part.name in asked.names or not asked.names]
    begun = time.monotonic()
    done = run_parts(chosen, full=asked.full, quick=asked.quick)
    tables.progress(summarise(done, time.monotonic() - begun))
    return 0 if all(one.fresh for one in done) else 1


if __name__ == "__main__":
    sys.exit(main())
