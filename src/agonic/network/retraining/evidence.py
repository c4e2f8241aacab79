"""What a network that is kept up to date has to say of itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import stdtrit

from agonic.calibration.retraining import RetrainerState
from agonic.health import Finding, figure
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.network.fit.problem import compute_errors
from agonic.network.retraining.candidates import correct

BATCHES, FEWEST = 10, 10
"""Batches of the window, and the fewest readings of one."""


def list_findings(state: RetrainerState) -> Iterator[Finding]:
    """What the user should know about a state."""
    if state.running is None:
        yield Finding(
            "not trained yet",
            "refuse",
            f"{state.n} readings were seen and no training was accepted yet",
            "pass on more readings, or give a calibration to start from",
        )
    if state.onset is not None:
        yield Finding(
            "change not learned yet",
            "check",
            f"the residual changed {state.n - state.onset} readings ago, and {state.wait} "
            "readings are needed to learn it",
            "pass on more readings",
        )
    yield from _judge_drift(state)
    last, changes = state.retrainings[-1:], state.changes
    if last and last[0].poisoned:
        yield Finding(
            "retraining rejected",
            "check",
            f"the last retraining, at {last[0].time:.1f} s, was rejected: {last[0].reason}",
            "look at sensor and reference; the network before it stays in use",
        )
    if changes:
        times = ", ".join(f"{one.onset:.1f} s" for one in changes[-3:])
        shown = f" (the last {len(changes[-3:])} of {len(changes)})" if len(changes) > 3 else ""
        yield Finding(
            "sensor changed",
            "note",
            f"the residual changed at {times}{shown}, and the change was learned",
            "look for what was switched or deployed then",
        )


def _judge_drift(state: RetrainerState) -> Iterator[Finding]:
    """A residual that moves steadily through the window, by means of batches of it."""
    rows = state.window
    if state.running is None or state.onset is not None or len(rows) < FEWEST * BATCHES:
        return
    left = compute_errors(correct(state.running, rows), rows.wanted)
    parts = np.array_split(left, BATCHES)
    means = np.array([np.median(part, axis=0) for part in parts])
    pace = np.linspace(-0.5, 0.5, BATCHES)
    slope = pace @ means / (pace @ pace)
    rest = means - means.mean(axis=0) - np.outer(pace, slope)
    sd = np.sqrt((rest**2).sum(axis=0) / (BATCHES - 2) / (pace @ pace))
    limit = float(stdtrit(BATCHES - 2, 1.0 - 1e-5 / 2))  # seldom by chance
    moved = float(np.abs(slope).max())
    scatter = robust_scale((left - np.repeat(means, list(map(len, parts)), axis=0)).ravel())
    if not (np.abs(slope) > limit * sd).any() or moved < 2.0 * scatter:  # of a reading
        return
    yield Finding(
        "residual drifts",
        "check",
        "the error of the running network grows steadily: its residual moved by "
        f"{figure(moved)} nT on an axis through the window",
        "train on a shorter window, because a drift is learned as its mean; look for parts "
        "that warm up",
    )
