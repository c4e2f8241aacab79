"""Fit data that are never in memory at once: chunks are summed up, and the sums are added.

    python examples/merge_moments.py

Each chunk, worker or day keeps 35 numbers, 324 bytes. Merged in any order, they give the fit of all
readings together.
"""

import numpy as np

import agonic as ag
from agonic.simulation import random_calibration

truth = random_calibration(np.random.default_rng(0))
reference = ag.Reference.constant(50_000)

kept = []
for day in range(5):
    made = ag.simulate("tumble", n=20_000, noise=300.0, calibration=truth, seed=day)
    kept.append(ag.Moments.of(made.samples.field).to_bytes())

total, *others = (ag.Moments.from_bytes(data) for data in kept)
for moments in others:
    total = total + moments
fit = ag.fit_moments(total, reference)

print(fit.status)
print(f"{fit.n} readings from {sum(map(len, kept))} bytes")
print("bias, nT   ", fit.calibration.bias.round(1))
print("sd, nT     ", fit.sd[:3].round(1))
print("truth, nT  ", truth.bias.round(1))
