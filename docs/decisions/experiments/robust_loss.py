"""Decision 0005: what each robust loss costs on clean readings and saves on spoilt ones.

    python docs/decisions/experiments/robust_loss.py

Prints the rms error of the bias over the Cramér–Rao bound of the clean readings. Every fit starts
at the truth, without prior, with the noise level known, so that nothing but the loss differs.
"when one stands out" is the rule of `maths.estimation.noise.residuals.estimate_noise`.
"""

from __future__ import annotations

import numpy as np
from noise_correction import MAGNITUDE, NOISE, bounds, truth

from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import Loss, cauchy, squares, tukey
from agonic.maths.estimation.noise.residuals import estimate_noise
from agonic.simulation import Simulated, simulate, with_outliers

N, DRAWS, SHARES = 1_000, 300, (0.0, 0.001, 0.05)
LOSSES = {
    "least squares": squares(),
    "Cauchy, c = 2.385": cauchy(),
    "Tukey, c = 4.685": tukey(4.685),
    "Tukey, c = 6": tukey(),
    "Tukey when one stands out": None,
}


def squared_error(made: Simulated, loss: Loss | None) -> float:
    """Squared length of the bias error, nT², of a fit with this loss (None: chosen by the rule)."""
    problem = Problem(np.array(made.samples.field), np.array([MAGNITUDE]), "full", None)
    start = truth(made)
    blocks = pieces(problem, "magnitude", NOISE)
    if loss is None:
        residuals = np.concatenate([r for r, _ in blocks(start)])
        loss = estimate_noise(residuals, True, len(start)).loss
    solution = leastsq.solve(blocks, start, scale=NOISE, loss=loss, tolerance=1e-2)
    return float(((solution.params[:3] - made.truth.bias) ** 2).sum())


def main() -> None:
    """Print the table of the decision."""
    print(f"{N} readings over the whole sphere, noise {NOISE:g} nT, {DRAWS} draws\n")
    print("| loss | " + " | ".join(f"{100 * share:g} % outliers" for share in SHARES) + " |")
    print("|---" * (1 + len(SHARES)) + "|")
    errors = np.zeros((len(LOSSES), len(SHARES)))
    for seed in range(DRAWS):
        limit = bounds(simulate("sphere", n=N, noise=NOISE, seed=seed))[0]
        for j, share in enumerate(SHARES):
            spoilt = [with_outliers(share, seed=seed)] if share else []
            made = simulate("sphere", n=N, noise=NOISE, seed=seed, defects=spoilt)
            for i, loss in enumerate(LOSSES.values()):
                errors[i, j] += squared_error(made, loss) / limit / DRAWS
    for name, row in zip(LOSSES, np.sqrt(errors), strict=True):
        print(f"| {name} | " + " | ".join(f"{value:.3f}" for value in row) + " |")


if __name__ == "__main__":
    main()
