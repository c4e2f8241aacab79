"""Decision 0001: what adding up scaled normal equations costs in accuracy, against QR.

    python docs/decisions/experiments/normal_equations.py

Prints, for coverages that are worse and worse conditioned, the condition number of the scaled
information matrix, and how far one Gauss–Newton step by chunked normal equations is from the same
step by QR of the whole Jacobian, in standard errors of the result.
"""

from __future__ import annotations

import numpy as np
from noise_correction import BASIS, MAGNITUDE, NOISE, truth
from numpy.typing import NDArray

from agonic.maths.equation.affine import magnitude_residual
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import squares
from agonic.simulation import Simulated, simulate

Array = NDArray[np.float64]

N = 30_000
TILTS_DEG = (90.0, 20.0, 5.0, 1.0, 0.1)


def steps(made: Simulated, chunk: int) -> tuple[Array, Array, Array]:
    """The first step by chunks, the same by QR, and the information matrix."""
    raw = made.samples.field
    r, twelve = magnitude_residual(raw, made.truth.bias, made.truth.matrix, MAGNITUDE)
    jacobian = twelve @ BASIS
    rows = [slice(i, i + chunk) for i in range(0, len(raw), chunk)]
    normal = leastsq.accumulate(
        lambda _: ((r[s], jacobian[s]) for s in rows), truth(made), squares(), NOISE
    )
    size = np.linalg.norm(jacobian, axis=0)
    q, upper = np.linalg.qr(jacobian / size)
    by_qr = np.linalg.solve(upper, -q.T @ r) / size
    by_chunks = -leastsq.inverse(normal.information) @ normal.gradient
    return by_chunks, by_qr, normal.information


def main() -> None:
    """Print the table of the decision."""
    print(f"{N} readings, all headings, noise {NOISE:g} nT\n")
    print("| tilts to | condition | 1 chunk | 100 chunks |")
    print("|---|---|---|---|")
    for tilt_deg in TILTS_DEG:
        made = simulate("circle", n=N, noise=NOISE, tilt_deg=tilt_deg, smooth=False)
        apart = []
        for chunk in (N, N // 100):
            by_chunks, by_qr, information = steps(made, chunk)
            difference = by_chunks - by_qr
            apart.append(np.sqrt(difference @ information @ difference))
        cells = " | ".join(f"{sd:.0e} sd" for sd in apart)
        print(f"| {tilt_deg:g}° | {leastsq.condition(information):.1e} | {cells} |")


if __name__ == "__main__":
    main()
