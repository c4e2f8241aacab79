"""Decision 0004: the error of the distance residual, plain and with the noise's effect taken out.

    python docs/decisions/experiments/noise_correction.py

Prints, for several coverages and numbers of readings, the rms error of the bias and of the
calibrated field (over the whole sphere), each over its Cramér–Rao bound. Both fits start at the
truth, without prior and without robust loss, so that nothing but the residual differs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.maths.equation.affine import magnitude_residual, model_basis, split
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.coverage import field_covariance, icosphere
from agonic.maths.equation.starting_values import nearest_parameters
from agonic.maths.estimation import leastsq
from agonic.simulation import Simulated, simulate

Array = NDArray[np.float64]

MAGNITUDE, NOISE = 50_000.0, 500.0
BASIS = model_basis("full")
COVERAGES = (
    ("whole sphere", "sphere", {}),
    ("tilts to 60°", "circle", {"tilt_deg": 60.0, "smooth": False}),
    ("tilts to 20°", "circle", {"tilt_deg": 20.0, "smooth": False}),
)
SIZES = ((300, 60), (3_000, 60), (30_000, 40), (300_000, 12))


def truth(made: Simulated) -> Array:
    """The nine parameters that the fit should find."""
    return nearest_parameters(made.truth.bias, made.truth.matrix, BASIS)


def fitted(made: Simulated, noise_sd: float) -> Array:
    """The nine parameters of a fit whose residual is corrected for `noise_sd`."""
    problem = Problem(np.array(made.samples.field), np.array([MAGNITUDE]), "full", None)
    blocks = pieces(problem, "magnitude", noise_sd)
    return leastsq.solve(blocks, truth(made), scale=NOISE, tolerance=1e-2).params


def bounds(made: Simulated) -> Array:
    """Cramér–Rao bounds on the mean square error (2,) of bias and of field, nT²."""
    bias, matrix = made.truth.bias, made.truth.matrix
    clean = made.field_b @ np.linalg.inv(matrix).T + bias
    jacobian = magnitude_residual(clean, bias, matrix, MAGNITUDE)[1] @ BASIS
    covariance = leastsq.inverse(jacobian.T @ jacobian) * NOISE**2
    spread = field_covariance(icosphere()[0], MAGNITUDE, bias, matrix, covariance, "symmetric")
    return np.array([np.trace(covariance[:3, :3]), np.trace(spread, axis1=1, axis2=2).mean()])


def squared_errors(made: Simulated, params: Array) -> Array:
    """Squared length of the error (2,) of the bias, and of the field averaged over the sphere."""
    bias, matrix = split(BASIS @ params)
    field = MAGNITUDE * icosphere()[0]
    raw = field @ np.linalg.inv(made.truth.matrix).T + made.truth.bias
    error = (raw - bias) @ matrix.T - field
    return np.array([((bias - made.truth.bias) ** 2).sum(), (error**2).sum(axis=1).mean()])


def ratios(kind: str, settings: dict[str, object], n: int, draws: int) -> Array:
    """rms error over bound: of bias (plain, corrected), then of field (plain, corrected)."""
    squares = np.zeros((2, 2))
    for seed in range(draws):
        made = simulate(kind, n=n, noise=NOISE, magnitude=MAGNITUDE, seed=seed, **settings)
        for k, noise_sd in enumerate((0.0, NOISE)):
            squares[:, k] += squared_errors(made, fitted(made, noise_sd)) / bounds(made)
    return np.sqrt(squares / draws).ravel()


def main() -> None:
    """Print the table of the decision."""
    print(f"field {MAGNITUDE:g} nT, noise {NOISE:g} nT on each axis; rms error / bound\n")
    print("| directions | n | draws | bias, plain | corrected | field, plain | corrected |")
    print("|---|---|---|---|---|---|---|")
    for label, kind, settings in COVERAGES:
        for n, draws in SIZES:
            found = ratios(kind, dict(settings), n, draws)
            cells = " | ".join(f"{ratio:.2f}" for ratio in found)
            print(f"| {label} | {n} | {draws} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
