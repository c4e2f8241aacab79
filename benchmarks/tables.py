"""Tables in markdown, their scatter, and where they are kept."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.facts import NOT_INSTALLED as NOT_INSTALLED

Array = NDArray[np.float64]

RESULTS = Path(__file__).parent / "results"


def arguments(description: str, draws: int, *, compare: bool = False) -> argparse.Namespace:
    """--draws, --quick and --full, as every script here takes them; --compare where it is asked."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument(
        "--draws", type=int, default=draws, help="repetitions (default: %(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="few cases and draws; keeps nothing")
    parser.add_argument("--full", action="store_true", help="every case, up to 300 000 readings")
    if compare:
        parser.add_argument("--compare", action="store_true", help="with the kept table")
    return parser.parse_args()


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; the first column is text, the others are figures."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def publish(name: str, parts: Sequence[str], *, keep: bool) -> None:
    """Print a page, and keep it as results/<name>.md."""
    text = "\n\n".join(parts) + "\n"
    print(text, flush=True)
    if keep:
        RESULTS.mkdir(exist_ok=True)
        (RESULTS / f"{name}.md").write_text(text, encoding="utf-8")


def progress(text: str) -> None:
    """A line on standard error."""
    print(text, file=sys.stderr, flush=True)


def bootstrap(statistic: Callable[[Array], float], draws: Array, times: int = 200) -> float:
    """Standard deviation of a statistic when the draws (rows) are drawn again with replacement."""
    rng = np.random.default_rng(0)
    rows = rng.integers(0, len(draws), (times, len(draws)))
    return float(np.std([statistic(draws[chosen]) for chosen in rows]))
