"""All benchmarks in one run: python -m benchmarks.run [--draws 100] [--quick] [--full]."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from benchmarks import estimators, honesty, speed, tables

# scripts that print a table of their own
ALONE = (
    "controller",
    "dataflash",
    "disturbers",
    "field",
    "heading",
    "inertial",
    "real",
    "thermal",
    "tracking",
    "inflight",
    "network",
    "retraining",
    "fleet_faults",
    "fleet_logs",
    "fleet_recording",
)


def main() -> None:
    """Speed first, on a quiet machine; then honesty and accuracy on two cores."""
    asked = tables.arguments("all benchmarks", draws=100)
    draws = min(asked.draws, 10) if asked.quick else asked.draws
    speed.run(3 if asked.quick else 7, asked.quick)
    for name in ALONE:
        if (Path(__file__).parent / f"{name}.py").exists():
            alone(name, keep=not asked.quick)
    honesty.run(3 * draws // 2, asked.quick, asked.full)
    estimators.run(draws, asked.quick, asked.full)


def alone(name: str, *, keep: bool) -> None:
    """Run a script by itself and keep what it prints."""
    tables.progress(f"{name}: running")
    done = subprocess.run(
        [sys.executable, "-m", f"benchmarks.{name}"], stdout=subprocess.PIPE, text=True
    )
    if done.returncode:
        tables.progress(f"{name}: ended with status {done.returncode}; its table is left as it was")
        return
    title = f"# {name.replace('_', ' ').capitalize()}"
    tables.publish(name, [title, done.stdout.strip()], keep=keep)


if __name__ == "__main__":
    main()
