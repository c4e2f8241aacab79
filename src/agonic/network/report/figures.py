"""Strips about a network: its training, its errors beside those of its base, its domain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agonic.arrays import Array
from agonic.calibration.retraining import Retraining
from agonic.network.fit import Comparison, NetworkFit
from agonic.report.markup import Markup
from agonic.report.strips import (
    BINS,
    Axis,
    Columns,
    arrows,
    band,
    down,
    level,
    line,
    mark_rows,
    path,
    plot,
    points,
    right,
    robust_limit,
    spread,
)
from agonic.report.time_axis import along_rows, along_time

PUBLISHED = -3.0
"""log₁₀ of the mean square error that the paper reaches, of a network without a base."""
BLOCKS = 120
"""Stretches of time whose rms error is drawn."""
DOTS = 400
"""Readings of a regression that are drawn."""
MIDDLE = 5.0
"""Readings in a column from which on its middle two thirds mean something."""


def draw_training(fit: NetworkFit) -> Markup:
    """The mean square error (scaled) after every epoch, in powers of ten."""
    shown = [
        np.array([e.mean_square for e in fit.epochs]),
        np.array([e.held_out for e in fit.epochs]),
    ]
    logs = [np.log10(np.maximum(values, 1e-300)) for values in shown]
    seen = np.concatenate(logs)
    seen = seen[np.isfinite(seen)]
    judged = [PUBLISHED] if fit.base is None else []
    low, high = min(*judged, *seen.tolist()), max(*judged, *seen.tolist())
    room = 0.08 * (high - low) or 0.5
    x = Axis("epoch", 1.0, float(max(len(fit.epochs), 2)))
    y = Axis("log₁₀ of the mean square error (scaled)", low - room, high + room)
    layers = [level(y, at, "limit") for at in judged]
    epochs = np.arange(1.0, len(fit.epochs) + 1)
    for values, name in zip(logs, ("training", "held"), strict=True):
        known = np.isfinite(values)
        if known.sum() > 1:
            layers.append(path(f"M{points(right(x, epochs[known]), down(y, values[known]))}", name))
    return plot(x, y, layers, "Mean square error after every epoch of the training")


def draw_regression(known: Array, found: Array, axis: str) -> Markup:
    """What the network gives (n,) over what is known (n,), nT, of one axis; the line is y = x."""
    rows = np.unique(np.linspace(0, len(known) - 1, DOTS).astype(int))
    low, high = float(known.min()), float(known.max())
    x = Axis(f"known field along {axis}, nT", low, high if high > low else low + 1.0)
    y = Axis("by the network, nT", x.low, x.high)
    places = zip(right(x, known[rows]), down(y, found[rows]), strict=True)
    dots = "".join(f"M{across:.1f} {below:.1f}h0" for across, below in places)
    layers = [path("M0 1000L1000 0", "zero"), path(dots, "dots")]
    return plot(x, y, layers, f"The network's field over the known one along {axis}")


def draw_unseen_error(comparison: Comparison, time: Array | None) -> Markup:
    """The rms error of unseen readings over time, by the base and by the network."""
    x, along = along_rows(time, comparison.rows)
    columns = Columns(x, along, min(BLOCKS, max(len(along) // 10, 1)))
    named = {"by-base": comparison.base, "by-network": comparison.network}
    curves = {
        name: np.sqrt(columns.mean((errors.values**2).mean(axis=1)))
        for name, errors in named.items()
        if errors is not None
    }
    high = 1.1 * max(float(values.max()) for values in curves.values())
    y = Axis("rms error, nT", 0.0, high or 1.0)
    layers = [line(columns, y, values, name) for name, values in curves.items()]
    return plot(x, y, layers, "Rms error of unseen readings over time, base and network")


def draw_guard(inside: Array, time: Array | None) -> Markup:
    """The share g of the correction that is applied, over time: 1 near the training, 0 far away."""
    x, along = along_rows(time, np.arange(len(inside)))
    columns = Columns(x, along, BINS)
    y = Axis("share g", 0.0, 1.05)
    layers = [
        spread(columns, y, inside, "range"),
        line(columns, y, columns.mean(inside), "mean"),
        mark_rows(columns, inside < 0.5, "guarded"),
    ]
    return plot(x, y, layers, "How near the readings are to the training, over time", kind="short")


def draw_residual(residual: Array, time: Array, retrainings: Sequence[Retraining]) -> Markup:
    """The residual (n, o) over time, each reading before it was learned, with the retrainings."""
    known = np.isfinite(residual[:, 0])
    values, at = residual[known].ravel(), np.repeat(time[known], residual.shape[1])
    x, along = along_time(at, float(time[0]), float(time[-1]))
    limit = max(robust_limit(values, 1e-9), 1.05 * float(np.percentile(np.abs(values), 99.9)))
    y = Axis("residual, nT", -limit, limit)
    columns = Columns(x, along, BINS)
    low, middle, high = columns.percentiles(values, (16.0, 50.0, 84.0))
    layers = [spread(columns, y, values, "range")]
    if has_middle(residual):
        layers.append(band(columns, y, low, high, "middle"))
    layers += [level(y, 0.0, "zero"), line(columns, y, middle, "mean")]
    _, places = along_time(
        np.array([one.time for one in retrainings]), float(time[0]), float(time[-1])
    )
    for one, place in zip(retrainings, right(x, places), strict=True):
        layers.append(path(f"M{place:.1f} 0V1000", "accepted" if one.accepted else "rejected"))
    onsets = np.array([one.onset for one in retrainings if one.onset is not None])
    if len(onsets):
        _, begun = along_time(onsets, float(time[0]), float(time[-1]))
        layers += [path(f"M{place:.1f} 0V1000", "onset") for place in right(x, begun)]
    signs = arrows(columns, y, values)
    return plot(x, y, layers, "Residual over time with the retrainings", signs)


def has_middle(residual: Array) -> bool:
    """Whether the middle two thirds of residuals (n, o) mean something in each column."""
    return int(np.isfinite(residual).sum()) > MIDDLE * BINS
