"""The theory of refusal: the smaller the spread of a level turn, the worse the bias.

    python docs/decisions/experiments/small_spread.py

Prints, for turns with little tilt, the spread of the calibrated magnitude and the error of the bias
along the axis that was not visited. The noise alone makes a spread of 0.4 %.
"""

from __future__ import annotations

import numpy as np

import agonic as ag

MAGNITUDE, NOISE = 50_000.0, 200.0
TURNS = (("circle", 1.0), ("circle", 2.0), ("circle", 5.0), ("circle", 60.0))
SEEDS = range(3)


def main() -> None:
    """Print the table of the page."""
    reference = ag.Reference.constant(MAGNITUDE)
    print("| tilts to | seed | spread | error of bias z, nT | its sd | verdict | findings |")
    print("|---|---|---|---|---|---|---|")
    for kind, tilt_deg in TURNS:
        for seed in SEEDS:
            made = ag.simulate(kind, tilt_deg=tilt_deg, noise=NOISE, seed=seed)
            fit = ag.fit_ellipsoid(made.samples, reference)
            size = np.linalg.norm(fit.calibration.correct(made.samples.field), axis=1)
            error = fit.calibration.bias[2] - made.truth.bias[2]
            names = ", ".join(finding.name for finding in fit.findings)
            print(
                f"| {tilt_deg:g}° | {seed} | {100 * size.std() / size.mean():.2f} % "
                f"| {error:.0f} | {fit.sd[2]:.0f} | {fit.verdict} | {names} |"
            )


if __name__ == "__main__":
    main()
