"""Accuracy over the Cramér–Rao bound, of our estimators, the textbooks' and those of peers.

python -m benchmarks.estimators [--draws 100] [--quick] [--full]
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agonic.maths.equation.affine import correct, correction_jacobian, model_basis
from agonic.simulation.draws import draw_directions
from benchmarks import tables
from benchmarks.peers import ESTIMATORS
from benchmarks.scenarios import COVERAGES, MAGNITUDE, Case, Drawn, draw, over_cases

Array = NDArray[np.float64]

BEST = "bound"  # the estimator that attains the bound, on the same draws

INTRODUCTION = """# Accuracy over the Cramér–Rao bound

Root mean square error over {draws} draws (a tenth of that for 300 000 readings), over the
Cramér–Rao bound: 1 is the best that an unbiased estimator can do. The luck of the draws is kept out
by dividing by the error, on the same readings, of the estimator linearised at the truth, which
attains the bound exactly. ± is the scatter of the ratio (bootstrap over draws).

A number in brackets counts draws without a result; "fails": more than half have none, or the error
is over 1000 times the bound. Field 50 000 nT dipping by 60°; W within 10 % of identity with
off-diagonals within 5 %; bias 55 µT; no prior. The tilts have all headings. With outliers, 5 % of
the readings are 10 to 50 µT away, and the bound is that of the others alone."""


class Yardstick:
    """Squared errors of one draw in units of the bound: of the bias, and of the calibrated vector.

    The vector's is the mean over field directions all over the sphere, visited or not.
    """

    def __init__(self, drawn: Drawn) -> None:
        truth = drawn.truth
        self.drawn = drawn
        self.field = MAGNITUDE * draw_directions(np.random.default_rng(0), 300)
        self.raw = self.field @ np.linalg.inv(truth.matrix).T + truth.bias
        jacobian = correction_jacobian(self.raw, truth.bias, truth.matrix)
        self.jacobian = jacobian @ model_basis(truth.model)
        vector = np.einsum("nim,mk,nik->", self.jacobian, drawn.bound, self.jacobian)
        self.unit = np.array([np.trace(drawn.bound[:3, :3]), vector])

    def of(self, bias: Array, matrix: Array) -> Array:
        """Squared errors (2,) of an estimate."""
        vector = correct(self.raw, bias, matrix) - self.field
        return self._squares(bias - self.drawn.truth.bias, vector)

    def of_best(self) -> Array:
        """Squared errors (2,) of the estimator that attains the bound."""
        error = self.drawn.efficient
        return self._squares(error[:3], self.jacobian @ error)

    def _squares(self, bias: Array, vector: Array) -> Array:
        return np.asarray([bias @ bias, np.sum(vector**2)] / self.unit)


def score(case: Case, draws: int) -> dict[str, Array]:
    """Squared errors (draws, 2) of each estimator, NaN where there is no result."""
    warnings.simplefilter("ignore")
    scores = {name: np.full((draws, 2), np.nan) for name in (BEST, *ESTIMATORS)}
    for seed in range(draws):
        drawn = draw(case, seed)
        yardstick = Yardstick(drawn)
        scores[BEST][seed] = yardstick.of_best()
        for name, estimate in ESTIMATORS.items():
            try:
                found = estimate(drawn.samples.field, MAGNITUDE, case.noise)
            except ImportError:
                scores[name] = np.empty((0, 2))
            except Exception:  # whatever a package raises, it gave no result
                continue
            else:
                scores[name][seed] = yardstick.of(*found)
    return scores


def figure(squares: Array, best: Array) -> str:
    """One cell: the ratio with its scatter, and how many draws had no result."""
    if not len(squares):
        return tables.NOT_INSTALLED
    good = np.isfinite(squares)
    pairs = np.stack([squares[good], best[good]], axis=1)
    if good.mean() < 0.5 or _ratio(pairs) > 1000:
        return "fails"
    missing = f" [{np.count_nonzero(~good)}]" if not good.all() else ""
    ratio, spread = _ratio(pairs), tables.bootstrap(_ratio, pairs)
    digits = 2 if ratio < 10 else 0
    return f"{ratio:.{digits}f} ±{spread:.{digits}f}{missing}"


def _ratio(pairs: Array) -> float:
    error, best = pairs.mean(axis=0)
    return float(np.sqrt(error / best))


def cases(quick: bool, full: bool) -> list[Case]:
    """All coverages, sizes and noise levels, then those with outliers."""
    sizes = (300,) if quick else (300, 3000, 300_000) if full else (300, 3000)
    levels = (200.0,) if quick else (50.0, 200.0, 500.0)
    clean = [Case(c, n, noise) for c in COVERAGES for n in sizes for noise in levels]
    spoilt = [case._replace(outliers=True) for case in clean if full or case.noise >= 200.0]
    return clean + spoilt


def table(grid: Sequence[Case], scores: Sequence[dict[str, Array]], which: int) -> str:
    """Cases down, estimators across."""
    header = ("directions", "n", "σ, nT", *ESTIMATORS)
    rows = [
        (
            case.coverage,
            str(case.n),
            f"{case.noise:g}",
            *(figure(by[name][:, which], by[BEST][:, which]) for name in ESTIMATORS),
        )
        for case, by in zip(grid, scores, strict=True)
    ]
    return tables.markdown(header, rows)


def main() -> None:
    """Run all cases, print the tables."""
    asked = tables.arguments("accuracy over the Cramér–Rao bound", draws=40)
    run(asked.draws if not asked.quick else min(asked.draws, 10), asked.quick, asked.full)


def run(draws: int, quick: bool = False, full: bool = False) -> None:
    """Four tables: bias and calibrated vector, clean and with outliers."""
    grid = cases(quick, full)
    counts = [draws if case.n <= 3000 else max(draws // 10, 3) for case in grid]
    scores = over_cases("estimators", score, grid, counts)
    parts = [INTRODUCTION.format(draws=draws)]
    for outliers, words in ((False, "clean readings"), (True, "5 % gross outliers")):
        rows = [i for i, case in enumerate(grid) if case.outliers == outliers]
        for which, quantity in enumerate(("Bias", "Calibrated vector")):
            picked = table([grid[i] for i in rows], [scores[i] for i in rows], which)
            parts += [f"## {quantity}, {words}", picked]
    print("\n\n".join(parts))


if __name__ == "__main__":
    main()
