"""Simulated readings with a known calibration, and how well they determine it at best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from agonic.calibration.affine import Affine
from agonic.maths.equation.affine import magnitude_residual, model_basis
from agonic.maths.estimation.leastsq import inverse
from agonic.samples import Samples
from agonic.simulation import random_calibration, simulate, with_outliers
from benchmarks.tables import progress

Array = NDArray[np.float64]
Model = Literal["sphere", "diagonal", "full"]
Result = TypeVar("Result")

MAGNITUDE = 50_000.0
COVERAGES: dict[str, tuple[str, dict[str, float | bool]]] = {
    "full sphere": ("sphere", {}),
    "belt ±30°": ("belt", {"tilt_deg": 30.0}),
    "tilt 60°": ("circle", {"tilt_deg": 60.0, "smooth": False}),
    "tilt 20°": ("circle", {"tilt_deg": 20.0, "smooth": False}),
}
"""Motions of `agonic.simulate`; the tilts have all headings, in a field that dips by 60°."""


class Case(NamedTuple):
    """What is simulated: n readings with `noise` nT on each axis; 5 % gross outliers or none."""

    coverage: str
    n: int
    noise: float
    outliers: bool = False
    model: Model = "full"


class Drawn(NamedTuple):
    """One draw of a case and the best that can be made of it.

    `bound` (m, m) is the Cramér–Rao bound, the least covariance of the model's parameters, and
    `efficient` (m,) the error on these very readings of the estimator that attains it.
    """

    samples: Samples
    truth: Affine
    bound: Array
    efficient: Array


def draw(case: Case, seed: int) -> Drawn:
    """Readings of a random calibration: W within 10 % of identity, bias of 55 µT."""
    kind, settings = COVERAGES[case.coverage]
    truth = random_calibration(np.random.default_rng((seed, 1)), model=case.model)
    simulated = simulate(
        kind,
        n=case.n,
        noise=case.noise,
        magnitude=MAGNITUDE,
        inclination_deg=60.0,
        calibration=truth,
        defects=[with_outliers(0.05, seed=seed)] if case.outliers else [],
        seed=seed,
        **settings,
    )
    exact = simulated.field_b @ np.linalg.inv(truth.matrix).T + truth.bias
    added = simulated.samples.field - exact
    clean = np.linalg.norm(added, axis=1) < 4_000.0 + 10 * case.noise  # strays: 10 to 50 µT away
    bound, efficient = best(exact[clean], added[clean], truth, case.noise)
    return Drawn(simulated.samples, truth, bound, efficient)


def best(exact: Array, added: Array, truth: Affine, noise: float) -> tuple[Array, Array]:
    """The Cramér–Rao bound σ² (Σ JᵀJ)⁻¹ and the error −(Σ JᵀJ)⁻¹ Σ Jᵀ(n·ε) that attains it.

    J is the exact Jacobian of the distance residual at the truth and the noiseless readings
    `exact` (n, 3), n the normals there and ε the noise `added` (n, 3).
    """
    _, jacobian = magnitude_residual(exact, truth.bias, truth.matrix, MAGNITUDE)
    distance = -np.einsum("ij,ij->i", jacobian[:, :3], added)
    reduced = jacobian @ model_basis(truth.model)
    covariance = inverse(reduced.T @ reduced)
    return noise**2 * covariance, -covariance @ (distance @ reduced)


def over_cases(
    what: str, score: Callable[[Case, int], Result], cases: Sequence[Case], draws: Sequence[int]
) -> list[Result]:
    """`score(case, draws)` of each case, on two cores."""
    results = []
    with ProcessPoolExecutor(max_workers=2) as pool:
        for case, result in zip(cases, pool.map(score, cases, draws), strict=True):
            progress(f"{what}: {label(case)}")
            results.append(result)
    return results


def label(case: Case) -> str:
    """A case in words."""
    spoilt = ", 5 % outliers" if case.outliers else ""
    return f"{case.model}, {case.coverage}, n {case.n}, σ {case.noise:g} nT{spoilt}"
