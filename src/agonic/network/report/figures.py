"""Strips about a network: its training, its errors beside those of its base, its domain; and charts
as SVG files that stand alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO

import numpy as np

from agonic.arrays import Array
from agonic.calibration.retraining import Retraining
from agonic.errors import MissingExtraError
from agonic.network.fit import Comparison, Method, NetworkChoice, NetworkFit
from agonic.network.fit.methods import GOAL
from agonic.network.fit.solve import correlate
from agonic.report.axes import Axis, Columns, about_zero, along_rows, along_time, over_rows
from agonic.report.figure import Figure, figure, robust_limit
from agonic.report.marks import (
    Mark,
    curve,
    dots,
    foot,
    level,
    line,
    mean,
    residuals,
    spread,
    upright,
)

METHODS = ("training", "descent", "adaptive")
"""Classes of the curves, in the order of `compare_methods`."""
POINTS = 600
"""Epochs of a training that are drawn."""


def draw_training(fit: NetworkFit) -> Figure:
    """The rms error in nT after every epoch, of equal ratios equally high, and without a network.

    Without a base the level is what the paper reaches.
    """
    trained = compute_rms(fit, [epoch.mean_square for epoch in fit.epochs])
    held = compute_rms(fit, [epoch.held_out for epoch in fit.epochs])
    limit = compute_rms(fit, [GOAL])[0] if fit.base is None else fit.calibration.misfit
    of = "without the network" if fit.base else "mean square 0.001 (scaled), as published"
    x = Axis("epoch", 1.0, float(max(len(fit.epochs), 2)))
    return figure(
        "Error after each epoch",
        x,
        _decade(np.concatenate([trained, held, [limit or np.nan]]), "rms error, nT"),
        level("limit", limit or np.nan, words=of),
        _curve(x, trained, "training", "trained on"),
        _curve(x, held, "held", "held out"),
        note="From the most promising of several random starts: first on some of the readings, "
        "then on all, then without outliers and without the noise of the inputs.",
    )


def draw_methods(fit: NetworkFit, methods: Sequence[Method], title: str, note: str) -> Figure:
    """The rms error in nT after every epoch by each method; epochs and errors logarithmic."""
    curves = [compute_rms(fit, method.mean_square) for method in methods]
    x = Axis("epoch", 1.0, float(max(2, *map(len, curves))), logarithmic=True)
    y = _decade(np.concatenate(curves), "rms error, nT")
    each = zip(curves, METHODS, methods, strict=True)
    marks = (_curve(x, values, name, method.name) for values, name, method in each)
    return figure(title, x, y, *marks, note=note)


def compute_rms(fit: NetworkFit, mean_square: Sequence[float] | Array) -> Array:
    """Rms errors on an axis, nT, of mean square errors as a training has them, scaled."""
    return np.asarray(fit.calibration.output_half * np.sqrt(mean_square), dtype=np.float64)


def _decade(values: Array, label: str) -> Axis:
    """A logarithmic axis for positive values, one power of ten at least: what is flat looks so."""
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (1.0, 1.0)
    room = max(1.15, np.sqrt(10.0 * low / high))
    return Axis(label, low / room, high * room, logarithmic=True)


def _curve(x: Axis, values: Array, name: str, words: str) -> Mark:
    """Values after the first, the second … epoch; of very many some."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) > POINTS:
        even = np.geomspace if x.logarithmic else np.linspace
        known = known[np.unique(even(1, len(known), POINTS).astype(int)) - 1]
    return curve(name, known + 1.0, values[known], words=words)


def draw_regression(known: Array, found: Array, axis: str) -> Figure:
    """What the network gives (n,) over what is known (n,), nT, of one axis; the line is y = x."""
    rows = np.unique(np.linspace(0, len(known) - 1, 400).astype(int))
    low, high = float(known.min()), float(known.max())
    x = Axis(f"known field along {axis}, nT", low, high if high > low else low + 1.0)
    y, ends = Axis("by the network, nT", x.low, x.high), (x.low, x.high)
    shown = dots("dots", known[rows], found[rows])
    title = f"Along {axis}: R = {correlate(found, known):.5f}"
    return figure(title, x, y, curve("zero", ends, ends), shown)


def draw_unseen_error(comparison: Comparison, time: Array | None) -> Figure:
    """The rms error of unseen readings over time, by the base and by the network."""
    x, along = along_rows(time, comparison.rows)
    columns = Columns(x, along, min(120, max(len(along) // 10, 1)))
    alone = comparison.base is None
    named = {
        ("by-base", "base alone"): comparison.base,
        ("by-network", "the network" if alone else "with the network"): comparison.network,
    }
    curves = {
        name: np.sqrt(columns.mean((errors.values**2).mean(axis=1)))
        for name, errors in named.items()
        if errors is not None
    }
    high = 1.1 * max(float(values.max()) for values in curves.values())
    return figure(
        "Error over time",
        x,
        Axis("rms error, nT", 0.0, high or 1.0),
        *(line(columns, values, *name) for name, values in curves.items()),
        note="Each of four blocks of time is judged by a network trained on the other three.",
    )


def draw_errors(
    title: str, limit: Mark, curves: Mapping[tuple[str, str], tuple[Array, Array]]
) -> Figure:
    """The largest error in each stretch of time: times (k,) s and errors (k,), nT, by class and
    words, and the `limit`."""
    begin = min(float(time[0]) for time, _ in curves.values())
    end = max(float(time[-1]) for time, _ in curves.values())
    highest = max(float(values.max()) for _, values in curves.values())
    marks = [limit]
    for name, (time, values) in curves.items():
        columns = Columns(*along_time(time, begin, end))
        marks.append(line(columns, columns.largest(values), *name))
    y = Axis("largest component of the error, nT", 0.0, 1.1 * max(highest, *limit.at[0]))
    return figure(title, columns.x, y, *marks)


def draw_guard(inside: Array, time: Array | None) -> Figure:
    """The share g of the correction that is applied, over time: 1 near the training, 0 far away."""
    columns = over_rows(time, len(inside))
    marks = spread(columns, inside), mean(columns, inside)
    outside = foot(columns, inside < 0.5, "guarded", "mostly outside")
    title, y = "Where it was trained: 1, far away: 0", Axis("share g", 0.0, 1.05)
    return figure(title, columns.x, y, *marks, outside, kind="short")


def draw_residual(residual: Array, time: Array, retrainings: Sequence[Retraining]) -> Figure:
    """The residual (n, o) over time, each reading before it was learned, with the retrainings."""
    known, ends = np.isfinite(residual[:, 0]), (float(time[0]), float(time[-1]))
    values, at = residual[known].ravel(), np.repeat(time[known], residual.shape[1])
    columns = Columns(*along_time(at, *ends))
    limit = max(robust_limit(values, 1e-9), 1.05 * float(np.percentile(np.abs(values), 99.9)))
    events = {
        ("accepted", "retraining accepted"): [r.time for r in retrainings if r.accepted],
        ("rejected", "rejected"): [r.time for r in retrainings if not r.accepted],
        ("onset", "a change began"): [r.onset for r in retrainings if r.onset is not None],
    }
    return figure(
        "Residual",
        columns.x,
        about_zero("residual, nT", limit),
        *residuals(columns, values),
        *(
            upright(name, along_time(np.array(times), *ends)[1], words=words)
            for (name, words), times in events.items()
        ),
        note="Field as corrected less the known one, by what was running when each reading came.",
    )


def draw_chart(fit: NetworkFit, choice: NetworkChoice | None = None) -> bytes:
    """The mean square error (scaled) after each epoch of the training, or of a choice the rms and
    largest error of unseen readings by hidden nodes and those of the base, as SVG.

    Raises `MissingExtraError` without Matplotlib.
    """
    try:
        from matplotlib import pyplot  # type: ignore[import-not-found,unused-ignore]
    except ImportError:
        raise MissingExtraError("a chart", "plot") from None
    with pyplot.rc_context({"svg.fonttype": "none"}):
        figure, axes = pyplot.subplots(figsize=(7.5, 3.75), layout="constrained")
        if choice is None:
            epochs = np.arange(1, len(fit.epochs) + 1)
            axes.plot(epochs, [epoch.mean_square for epoch in fit.epochs], label="trained on")
            if np.isfinite([epoch.held_out for epoch in fit.epochs]).any():
                axes.plot(epochs, [epoch.held_out for epoch in fit.epochs], label="held out")
            axes.axhline(GOAL, color="grey", linestyle="--", label=f"{GOAL:g}")
            axes.set(title="Training", xlabel="epoch", ylabel="mean square error, scaled")
        else:
            nodes = [f"{row.hidden}" for row in choice.table]
            for name, label in (("rms", "rms of unseen readings"), ("maximum", "largest")):
                errors = [getattr(row, f"unseen_{name}") for row in choice.table]
                (curve,) = axes.plot(nodes, errors, "o-", label=label)
                base = getattr(choice, f"base_{name}")
                if base is not None:
                    axes.axhline(base, color=curve.get_color(), linestyle="--", label="base")
            axes.set(title="Hidden nodes", xlabel="hidden nodes", ylabel="error, nT")
        axes.set_yscale("log")
        axes.legend()
        written = BytesIO()
        figure.savefig(written, format="svg", metadata={"Date": None})
        pyplot.close(figure)
    return written.getvalue()
