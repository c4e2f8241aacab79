"""Whether the stated uncertainty is true: error over standard error, and 95 % intervals.

python -m benchmarks.honesty [--draws 150] [--quick] [--full]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import agonic as ag
from agonic.maths.equation.symmetric import pack_symmetric
from benchmarks import tables
from benchmarks.scenarios import COVERAGES, MAGNITUDE, Case, Model, draw, over_cases

Array = NDArray[np.float64]

PRIORS = (None, 0.1)
UNKNOWNS: dict[Model, list[int]] = {
    "sphere": [0, 1, 2, 3],
    "diagonal": [0, 1, 2, 3, 4, 5],
    "full": [0, 1, 2, 3, 4, 5, 6, 7, 8],
}
"""Which of the nine parameters a model has for its own."""

INTERVAL = 1.959964  # standard deviations, 95 % of a Gaussian

INTRODUCTION = """# Honesty of the uncertainty

Errors of all parameters (bias, matrix) over their stated standard errors, in {draws} draws of the
default fit (robust, with evidence): their standard deviation should be 1, and 95 % of them should
be within ±1.96. The luck of the draws is kept out by comparing with the estimator linearised at the
truth, whose figures on the same readings are 1 and 95 % but for that luck. ± is the scatter of the
figure (bootstrap over draws). Field 50 000 nT dipping by 60°, bias 55 µT, W as in the table of the
estimators, of the model that is fitted. With outliers, 5 % of the readings are 10 to 50 µT away.
The prior is the default: soft iron within 0.1 of none."""

MOVED = """## What the prior changes under full coverage

Largest change of any parameter in any draw when the prior is switched on, in % of its standard
error."""


def score(case: Case, draws: int) -> Array:
    """Errors over standard errors, (draws, 3, parameters): at the bound, prior off, prior on."""
    own = UNKNOWNS[case.model]
    scores = np.empty((draws, 1 + len(PRIORS), len(own)))
    for seed in range(draws):
        drawn = draw(case, seed)
        scores[seed, 0] = drawn.efficient / np.sqrt(np.diag(drawn.bound))
        for k, prior in enumerate(PRIORS):
            fit = ag.fit_ellipsoid(
                drawn.samples,
                ag.Reference.constant(MAGNITUDE),
                model=case.model,
                soft_iron_sd=prior,
            )
            error = _numbers(fit.calibration) - _numbers(drawn.truth)
            scores[seed, 1 + k] = error[own] / fit.sd[own]
    return scores


def _numbers(calibration: ag.Affine) -> Array:
    return np.concatenate([calibration.bias, pack_symmetric(calibration.matrix)])


def spread(pairs: Array) -> float:
    """Standard deviation about zero of all parameters together; (draws, at the bound and found)."""
    best, found = np.sqrt(np.mean(pairs**2, axis=(0, 2)))
    return float(found / best)


def covered(pairs: Array) -> float:
    """Per cent within the 95 % interval, where at the bound there are 95."""
    best, found = np.mean(np.abs(pairs) < INTERVAL, axis=(0, 2))
    return float(95 + 100 * (found - best))


def row(case: Case, scores: Array) -> tuple[str, ...]:
    """One line: spread and cover, prior off and on."""
    figures = [
        f"{measure(scores[:, [0, k]]):.{digits}f} "
        f"±{tables.bootstrap(measure, scores[:, [0, k]]):.{digits}f}"
        for k in (1, 2)
        for measure, digits in ((spread, 2), (covered, 1))
    ]
    spoilt = "5 %" if case.outliers else "none"
    return (case.model, case.coverage, str(case.n), f"{case.noise:g}", spoilt, *figures)


def moved(case: Case, scores: Array) -> tuple[str, ...]:
    """How far the prior moved the result, in % of a standard error."""
    change = 100 * np.abs(scores[:, 2] - scores[:, 1]).max()
    return case.model, str(case.n), f"{case.noise:g}", f"{change:.2g} %"


def cases(quick: bool, full: bool) -> list[Case]:
    """All models and coverages, clean and with outliers."""
    sizes = (300,) if quick else (300, 3000, 30_000) if full else (1000,)
    levels = (50.0, 200.0, 500.0) if full else (200.0,)
    return [
        Case(coverage, n, noise, outliers, model)
        for model in UNKNOWNS
        for coverage in COVERAGES
        for n in sizes
        for noise in levels
        for outliers in (False, True)
    ]


def run(draws: int, quick: bool = False, full: bool = False) -> None:
    """Two tables: honesty, and what the prior moves under full coverage."""
    grid = cases(quick, full)
    scores = over_cases("honesty", score, grid, [draws] * len(grid))
    header = (
        "model",
        "directions",
        "n",
        "σ, nT",
        "outliers",
        "sd of error/σ",
        "in 95 %",
        "sd, with prior",
        "in 95 %, with prior",
    )
    honest = tables.markdown(header, map(row, grid, scores))
    even = [i for i, c in enumerate(grid) if c.coverage == "full sphere" and not c.outliers]
    prior = tables.markdown(
        ("model", "n", "σ, nT", "largest change"), [moved(grid[i], scores[i]) for i in even]
    )
    print("\n\n".join([INTRODUCTION.format(draws=draws), honest, MOVED, prior]))


def main() -> None:
    """Run all cases, print the tables."""
    asked = tables.arguments("honesty of the uncertainty", draws=100)
    run(asked.draws if not asked.quick else min(asked.draws, 10), asked.quick, asked.full)


if __name__ == "__main__":
    main()
