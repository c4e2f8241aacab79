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
from agonic.report import strips
from agonic.report.axes import BINS, Axis, Columns, along_rows, along_time, down, right
from agonic.report.markup import Markup

METHODS = ("training", "descent", "adaptive")
"""Classes of the curves, in the order of `compare_methods`."""
POINTS = 600
"""Epochs of a training that are drawn."""


def draw_training(fit: NetworkFit) -> Markup:
    """The rms error in nT after every epoch, of equal ratios equally high, and without a network.

    Without a base the level is what the paper reaches.
    """
    curves = {
        "training": compute_rms(fit, [epoch.mean_square for epoch in fit.epochs]),
        "held": compute_rms(fit, [epoch.held_out for epoch in fit.epochs]),
    }
    limit = compute_rms(fit, [GOAL])[0] if fit.base is None else fit.calibration.misfit
    seen = np.concatenate([*curves.values(), [limit or np.nan]])
    x = Axis("epoch", 1.0, float(max(len(fit.epochs), 2)))
    y = _decade(seen, "rms error, nT")
    layers = [strips.level(y, limit, "limit")] if limit else []
    layers += [_curve(x, y, values, name) for name, values in curves.items()]
    return strips.plot(x, y, layers, "Rms error after every epoch of the training")


def draw_methods(fit: NetworkFit, methods: Sequence[Method]) -> Markup:
    """The rms error in nT after every epoch by each method; epochs and errors logarithmic."""
    curves = [compute_rms(fit, method.mean_square) for method in methods]
    x = Axis("epoch", 1.0, float(max(2, *map(len, curves))), logarithmic=True)
    y = _decade(np.concatenate(curves), "rms error, nT")
    layers = [_curve(x, y, values, name) for values, name in zip(curves, METHODS, strict=True)]
    return strips.plot(x, y, layers, "Rms error after every epoch, by method of training")


def compute_rms(fit: NetworkFit, mean_square: Sequence[float] | Array) -> Array:
    """Rms errors on an axis, nT, of mean square errors as a training has them, scaled."""
    return np.asarray(fit.calibration.output_half * np.sqrt(mean_square), dtype=np.float64)


def _decade(values: Array, label: str) -> Axis:
    """A logarithmic axis for positive values, one power of ten at least: what is flat looks so."""
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (1.0, 1.0)
    room = max(1.15, np.sqrt(10.0 * low / high))
    return Axis(label, low / room, high * room, logarithmic=True)


def _curve(x: Axis, y: Axis, values: Array, name: str) -> Markup:
    """Values after the first, the second … epoch; of very many some."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) > POINTS:
        even = np.geomspace if x.logarithmic else np.linspace
        known = known[np.unique(even(1, len(known), POINTS).astype(int)) - 1]
    if len(known) < 2:
        return strips.path("", name)
    return strips.curve(x, y, known + np.ones(len(known)), values[known], name)


def draw_regression(known: Array, found: Array, axis: str) -> Markup:
    """What the network gives (n,) over what is known (n,), nT, of one axis; the line is y = x."""
    rows = np.unique(np.linspace(0, len(known) - 1, 400).astype(int))
    low, high = float(known.min()), float(known.max())
    x = Axis(f"known field along {axis}, nT", low, high if high > low else low + 1.0)
    y = Axis("by the network, nT", x.low, x.high)
    places = zip(right(x, known[rows]), down(y, found[rows]), strict=True)
    dots = "".join(f"M{across:.1f} {below:.1f}h0" for across, below in places)
    layers = [strips.path("M0 1000L1000 0", "zero"), strips.path(dots, "dots")]
    return strips.plot(x, y, layers, f"The network's field over the known one along {axis}")


def draw_unseen_error(comparison: Comparison, time: Array | None) -> Markup:
    """The rms error of unseen readings over time, by the base and by the network."""
    x, along = along_rows(time, comparison.rows)
    columns = Columns(x, along, min(120, max(len(along) // 10, 1)))
    named = {"by-base": comparison.base, "by-network": comparison.network}
    curves = {
        name: np.sqrt(columns.mean((errors.values**2).mean(axis=1)))
        for name, errors in named.items()
        if errors is not None
    }
    high = 1.1 * max(float(values.max()) for values in curves.values())
    y = Axis("rms error, nT", 0.0, high or 1.0)
    layers = [strips.line(columns, y, values, name) for name, values in curves.items()]
    return strips.plot(x, y, layers, "Rms error of unseen readings over time, base and network")


def draw_errors(curves: Mapping[str, tuple[Array, Array]], levels: Sequence[float]) -> Markup:
    """The largest error in each stretch of time: times (k,) s and errors (k,), nT, by class."""
    begin = min(float(time[0]) for time, _ in curves.values())
    end = max(float(time[-1]) for time, _ in curves.values())
    highest = max(float(values.max()) for _, values in curves.values())
    y = Axis("largest component of the error, nT", 0.0, 1.1 * max(highest, *levels))
    layers = [strips.level(y, at, "limit") for at in levels]
    for name, (time, values) in curves.items():
        x, along = along_time(time, begin, end)
        columns = Columns(x, along)
        layers.append(strips.line(columns, y, columns.largest(values), name))
    return strips.plot(x, y, layers, "Largest component of the error over time")


def draw_guard(inside: Array, time: Array | None) -> Markup:
    """The share g of the correction that is applied, over time: 1 near the training, 0 far away."""
    x, along = along_rows(time, np.arange(len(inside)))
    columns = Columns(x, along, BINS)
    y = Axis("share g", 0.0, 1.05)
    layers = [
        strips.spread(columns, y, inside, "range"),
        strips.line(columns, y, columns.mean(inside), "mean"),
        strips.mark_rows(columns, inside < 0.5, "guarded"),
    ]
    return strips.plot(
        x, y, layers, "How near the readings are to the training, over time", kind="short"
    )


def draw_residual(residual: Array, time: Array, retrainings: Sequence[Retraining]) -> Markup:
    """The residual (n, o) over time, each reading before it was learned, with the retrainings."""
    known = np.isfinite(residual[:, 0])
    values, at = residual[known].ravel(), np.repeat(time[known], residual.shape[1])
    x, along = along_time(at, float(time[0]), float(time[-1]))
    limit = max(
        strips.robust_limit(values, 1e-9), 1.05 * float(np.percentile(np.abs(values), 99.9))
    )
    y = Axis("residual, nT", -limit, limit)
    columns = Columns(x, along, BINS)
    layers = strips.residuals(columns, y, values)
    marks = [(one.time, "accepted" if one.accepted else "rejected") for one in retrainings]
    marks += [(one.onset, "onset") for one in retrainings if one.onset is not None]
    _, at = along_time(np.array([when for when, _ in marks]), float(time[0]), float(time[-1]))
    for (_, name), place in zip(marks, right(x, at), strict=True):
        layers.append(strips.path(f"M{place:.1f} 0V1000", name))
    signs = strips.arrows(columns, y, values)
    return strips.plot(x, y, layers, "Residual over time with the retrainings", signs)


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
