"""Training of networks beside SciPy and JAX: python -m benchmarks.network [--draws 3].

All train the same network on the same scaled inputs and targets from the same random start, and are
judged on other readings of the same sensor. Time is that of the processor, on one core.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.maths.equation import network
from agonic.network.fit import fit_network
from agonic.network.maths import levenberg_marquardt
from agonic.network.simulate import SimulatedField, simulate_nonaffine, simulate_paper
from benchmarks import network_rivals, tables
from benchmarks.network_rivals import Trainer, describe_jax, residuals

Array = NDArray[np.float64]

INTRODUCTION = """Median over {draws} draws. `rms` is the error on an axis of other readings of the
same sensor, whose noise is {paper} nT in the first task and {bent} nT in the second; `worst` is the
largest rms of the draws: a start may end in a poor minimum. All take the same start, and the first
four the same Jacobian. {jax}"""


class Task(NamedTuple):
    """What is to be learned, the same on unseen readings, and how to get back to nT."""

    name: str
    problem: levenberg_marquardt.Problem
    unseen: levenberg_marquardt.Problem
    half: float


def scaled(
    made: SimulatedField, other: SimulatedField, inputs: int, hidden: int, name: str
) -> Task:
    """What an affine calibration leaves, or the field itself for three inputs, scaled to −1…1."""
    base = None
    if inputs > 3:
        base = fit_network(made.samples, made.reference, compared=False).base
    middle = half = np.empty(0)
    parts = []
    for part in (made, other):
        x = part.samples.field
        if inputs > 3:
            x = np.column_stack([x, part.samples.temperature])
        y = part.field if base is None else part.field - base.correct(part.samples.field)
        if not parts:
            middle, half = (x.max(0) + x.min(0)) / 2, (x.max(0) - x.min(0)) / 2
            centre, size = (y.max(0) + y.min(0)) / 2, float(np.ptp(y, axis=0).max()) / 2
        parts.append(levenberg_marquardt.Problem((x - middle) / half, (y - centre) / size, hidden))
    return Task(name, parts[0], parts[1], size)


def tasks(seed: int, quick: bool) -> tuple[Task, ...]:
    """The paper's, and that of a tumbling sensor which no affine fits."""
    paper = [simulate_paper(15.0, directions="space", seed=seed + k) for k in (0, 1000)]
    n = 2000 if quick else 6000
    bent = simulate_nonaffine(n=2 * n, rate_Hz=n / 1000.0, hysteresis=100.0, seed=seed)
    halves = (bent.select(slice(0, None, 2)), bent.select(slice(1, None, 2)))
    return (
        scaled(paper[0], paper[1], 3, 3, "3 inputs, 3 nodes, 1500 readings"),
        scaled(*halves, 4, 8, f"4 inputs, 8 nodes, {n} readings"),
    )


def ours(stopping: Any) -> Trainer:
    return lambda problem, start: (
        levenberg_marquardt.train(problem, start, stopping=stopping).weights
    )


TRAINERS: dict[str, Trainer | None] = {
    "agonic, plain": ours("plain"),
    "agonic, bayesian": ours("bayesian"),
    **network_rivals.TRAINERS,
}


def compared(draws: int, quick: bool) -> list[tuple[str, ...]]:
    """Error and time of each trainer in each task."""
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for seed in range(draws):
        for task in tasks(seed, quick):
            start = network.draw_weights(np.random.default_rng(seed), task.problem.shape)
            for name, train in TRAINERS.items():
                tables.progress(f"network: {task.name}, {name}, draw {seed + 1}")
                if train is None:
                    found[task.name, name] = []
                    continue
                if seed == 0:
                    train(task.problem, start)  # what is compiled, once
                began = time.process_time()
                weights = train(task.problem, start)
                took = time.process_time() - began
                off = task.half * residuals(task.unseen, weights)
                found.setdefault((task.name, name), []).append(
                    (float(np.sqrt(np.mean(off**2))), took)
                )
    return [(f"{task}: {name}", *_figures(values)) for (task, name), values in found.items()]


def _figures(values: list[tuple[float, float]]) -> tuple[str, str, str]:
    if not values:
        return (tables.NOT_INSTALLED, "", "")
    rms, took = np.array(values).T
    return f"{np.median(rms):.2f}", f"{rms.max():.2f}", f"{np.median(took):.3g}"


def whole(quick: bool) -> list[tuple[str, str]]:
    """Seconds that `fit_network` takes: starts, training, and the comparison on unseen blocks."""
    paper = simulate_paper(15.0, directions="space", seed=0)
    n = 4000 if quick else 20_000
    bent = simulate_nonaffine(n=n, rate_Hz=n / 1000.0, seed=1)
    cases = {
        "3-3-3, 1500 readings": (paper, {}),
        f"4-8-3, {n} readings": (bent, {"hidden": 8, "inputs": ("field", "temperature")}),
    }
    said = []
    for name, (made, settings) in cases.items():
        for words, judged in (("training", False), ("training and comparison", True)):
            times = []
            for _ in range(3):
                began = time.process_time()
                fit_network(made.samples, made.reference, compared=judged, **settings)
                times.append(time.process_time() - began)
            said.append((f"{name}: {words}", f"{min(times):.2g}"))
    return said


def main() -> None:
    """Train everything and print the tables."""
    asked = tables.arguments("training of networks", draws=3)
    table = compared(asked.draws, asked.quick)
    print(INTRODUCTION.format(draws=asked.draws, paper=2, bent=20, jax=describe_jax()))
    print()
    print(tables.markdown(("trained by", "rms, nT", "worst, nT", "time, s"), table))
    print("\n`fit_network`, the best of three runs:\n")
    print(tables.markdown(("work", "time, s"), whole(asked.quick)))


if __name__ == "__main__":
    main()
