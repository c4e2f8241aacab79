"""Wang et al. (2020) end to end: a network calibrates a magnetometer, and once more in orbit.

    python examples/network_paper.py

Writes training.svg, calibration-error.svg, error-after-the-change.svg and hidden-nodes.svg, and
prints the published figures beside those of this run.
"""

from pathlib import Path

import numpy as np

from agonic.network.fit import choose_network, fit_network
from agonic.network.report.chart import Curve, chart, table_chart, training_chart
from agonic.network.simulate import CHANGE_S, simulate_paper

PUBLISHED = {7: 0.9999, 6: 0.9999, 5: 0.9999, 4: 0.9999, 3: 0.9999, 2: 0.82121}
ALONE = {"base": None, "stopping": "plain", "compared": False}  # as in the paper


def largest(calibration, part):
    """The largest component of the error at each reading, nT."""
    field, _ = calibration.evaluated(part.samples.field, {})
    return np.abs(field - part.field).max(axis=1)


made = simulate_paper(30.0, seed=1)
late = made.samples.time >= CHANGE_S
ground, orbit = made.select(~late), made.select(late)

fit = fit_network(ground.samples, ground.reference, restarts=1, **ALONE)
below = next(k for k, epoch in enumerate(fit.epochs, 1) if epoch.mean_square < 1e-3)
before = largest(fit.calibration, ground)
changed = largest(fit.calibration, orbit)
again = fit_network(
    orbit.samples, orbit.reference, stopping="plain", start=fit.calibration, compared=False
)
after = largest(again.calibration, orbit)

print("                                         published    here")
print(f"epochs to a mean square error of 0.001          26    {below:4d}")
print(f"largest error, trained on the ground, nT      < 10    {before.max():4.1f}")
print(f"largest error after the change, nT              30    {changed.max():4.1f}")
print(f"largest error, trained again, nT              < 10    {after.max():4.1f}")

space = simulate_paper(15.0, directions="space", seed=1)
plane = simulate_paper(15.0, directions="planar", seed=1)
tables = {
    name: choose_network(part.samples, part.reference, base=None, stopping="plain")
    for name, part in (("space", space), ("plane", plane))
}
print("\nhidden nodes   R published   R, directions in space   R, the printed plane")
for ours, flat in zip(tables["space"].table, tables["plane"].table, strict=True):
    print(
        f"{ours.hidden:12d}   {PUBLISHED[ours.hidden]:11.5f}   {ours.regression:22.5f}   "
        f"{flat.regression:20.5f}"
    )

honest = fit_network(space.samples, space.reference)
print(f"\nOn top of an affine calibration: {honest.comparison.sentence}.")

figures = {
    "training": training_chart(fit),
    "calibration-error": chart(
        "Calibration error on the ground",
        "time, s",
        "largest component, nT",
        [Curve("trained on the ground", ground.samples.time, before)],
        limits=[(10.0, "10 nT")],
    ),
    "error-after-the-change": chart(
        "Error after the change at 15 s",
        "time, s",
        "largest component, nT",
        [
            Curve("trained on the ground", made.samples.time, np.r_[before, changed]),
            Curve("trained again", orbit.samples.time, after),
        ],
        limits=[(10.0, "10 nT"), (30.0, "30 nT")],
    ),
    "hidden-nodes": table_chart(tables["space"]),
}
for name, drawn in figures.items():
    Path(f"{name}.svg").write_text(drawn, encoding="utf-8")
