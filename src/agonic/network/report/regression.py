"""The regression of a network: what it gives over what is known, axis by axis."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import select_columns
from agonic.network.fit import NetworkFit
from agonic.network.fit.solve import correlate
from agonic.network.report import figures
from agonic.report.markup import Markup
from agonic.report.strips import caption
from agonic.samples import Samples


def evaluate_fit(fit: NetworkFit, samples: Samples) -> tuple[Array, Array]:
    """The network's field and the known one, (n, o), nT, of the readings that took part."""
    network, used = fit.calibration, fit.weights > 0
    field, _ = network.evaluated(samples.field, select_columns(network, samples))
    if network.target == "magnitude":
        field = np.linalg.norm(field, axis=1, keepdims=True)
    return field[used], (field - fit.residuals)[used]


def correlate_axes(found: Array, known: Array) -> list[float]:
    """R of each axis, between the network's field and the known one, (n, o)."""
    return [correlate(a, b) for a, b in zip(found.T, known.T, strict=True)]


def draw_axes(found: Array, known: Array) -> list[Markup]:
    """The network's field over the known one, a figure an axis, as the paper draws it."""
    names = ("x", "y", "z") if known.shape[1] == 3 else ("the field",)
    together = zip(names, found.T, known.T, correlate_axes(found, known), strict=True)
    return [
        caption(f"Along {name}: R = {r:.5f}", figures.draw_regression(b, a, name))
        for name, a, b, r in together
    ]
