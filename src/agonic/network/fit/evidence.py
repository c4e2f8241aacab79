"""What a trained network is worth: findings, refusals first, and remarks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.calibration.base import select_columns
from agonic.health import Finding, figure, inspect, sort_findings
from agonic.network.fit.result import WORTH, NetworkFit
from agonic.samples import Samples

OUTLIERS_DOUBTFUL = 0.1
FEW_PER_WEIGHT = 5.0
LARGE = 0.03
"""Residual over the field from which the reference is doubted: no sensor scatters by so much."""
SOME = 500


def examine(fit: NetworkFit, samples: Samples) -> NetworkFit:
    """The fit with findings and remarks."""
    found = [
        *(f for f in inspect(samples) if f.name not in ("gaps", "repeated readings")),
        *_compare_with_base(fit),
        *_targets(fit, samples),
        *_outliers(fit),
        *_few(fit),
        *_check_convergence(fit),
    ]
    return replace(fit, findings=sort_findings(found), remarks=_remarks(fit))


def _compare_with_base(fit: NetworkFit) -> list[Finding]:
    """The base is as good, or better."""
    comparison = fit.comparison
    if comparison is None or comparison.base is None or comparison.winner == "network":
        return []
    return [
        Finding(
            "network not needed",
            "check" if comparison.ratio > 1 / WORTH else "note",
            f"{comparison.sentence}",
            "use the base; give the network what else changes (temperature, current), or none",
        )
    ]


def _targets(fit: NetworkFit, samples: Samples) -> list[Finding]:
    """Targets that have little to do with the readings."""
    rows = np.flatnonzero(np.isfinite(fit.residuals[:, 0]))
    rows = rows[:: max(len(rows) // SOME, 1)]
    part = samples.select(rows)
    seen, _ = fit.calibration.evaluated(part.field, select_columns(fit.calibration, part))
    field = float(np.median(np.linalg.norm(seen, axis=1)))
    if fit.noise < LARGE * field:
        return []
    return [
        Finding(
            "targets",
            "check",
            f"{figure(fit.noise)} nT are left on an axis, {figure(100 * fit.noise / field)} % of "
            "the field: the reference hardly goes with the readings",
            "check the times, axes, signs and unit of the reference, and of the attitude with it",
        )
    ]


def _outliers(fit: NetworkFit) -> list[Finding]:
    share = 1.0 - float((fit.weights[np.isfinite(fit.residuals[:, 0])] > 0).mean())
    if share == 0.0:
        return []
    return [
        Finding(
            "left out in training",
            "check" if share > OUTLIERS_DOUBTFUL else "note",
            f"{figure(100 * share)} % of the readings stood out and were left out",
            "look for wrong references, and for readings taken while something was switched",
        )
    ]


def _few(fit: NetworkFit) -> list[Finding]:
    """More weights than the readings can determine."""
    outputs = fit.residuals.shape[1]
    independent = fit.n * outputs / fit.correlation
    if independent >= FEW_PER_WEIGHT * fit.calibration.shape.size:
        return []
    return [
        Finding(
            "few for a network",
            "check",
            f"{fit.calibration.shape.size} weights rest on {figure(independent)} independent "
            "residuals",
            "record longer, or take fewer hidden nodes",
        )
    ]


def _check_convergence(fit: NetworkFit) -> list[Finding]:
    if fit.converged:
        return []
    return [
        Finding(
            "training unfinished",
            "note",
            f"training still gained after {fit.iterations} epochs",
            "raise most_epochs, or take fewer hidden nodes",
        )
    ]


def _remarks(fit: NetworkFit) -> tuple[str, ...]:
    """How good the result is, in words."""
    what = "magnitude" if fit.calibration.target == "magnitude" else "an axis"
    said = [
        f"trained in {fit.iterations} epochs to {figure(fit.rms)} nT rms of {what}, at most "
        f"{figure(fit.maximum)}; the readings determine {figure(fit.effective)} of "
        f"{fit.calibration.shape.size} weights"
    ]
    comparison = fit.comparison
    if comparison is not None and (comparison.base is None or comparison.winner == "network"):
        said.append(comparison.sentence)
    if fit.calibration.target == "magnitude":
        said.append(
            "a magnitude cannot show turns of the field that vary with direction, so only its "
            "length is corrected"
        )
    return tuple(said)
