"""Charts of a network as SVG files that stand alone: its training, and the table of nodes."""

from __future__ import annotations

from io import BytesIO

import numpy as np

from agonic.errors import MissingExtraError
from agonic.network.fit import NetworkChoice, NetworkFit
from agonic.network.fit.methods import GOAL

SIZE_IN = (7.5, 3.75)


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
        figure, axes = pyplot.subplots(figsize=SIZE_IN, layout="constrained")
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
