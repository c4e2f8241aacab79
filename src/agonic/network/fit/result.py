"""`NetworkFit`: a trained network with its evidence, and `Comparison` with what it stands on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.network import Network
from agonic.calibration.thermal import Thermal
from agonic.fit import Estimated
from agonic.health import Finding, figure
from agonic.network.maths.levenberg_marquardt import Epoch
from agonic.readable import Shown

WORTH = 0.95
"""A network is worth it when it brings the rms error of unseen readings below this share."""
CERTAIN = 3.0
"""And when the difference over the blocks is so many of its standard errors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Errors:
    """Errors of unseen readings, nT: of the components (n, 3), or of the magnitude (n, 1)."""

    values: Array

    @property
    def rms(self) -> float:
        """Root mean square, nT on an axis."""
        return float(np.sqrt(np.mean(self.values**2)))

    @property
    def maximum(self) -> float:
        """The largest, nT."""
        return float(np.abs(self.values).max())


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Base and network on readings that neither had seen, in blocks of time held out in turn.

    `base` and `network` are the errors, in the order of `rows` (n,) of the samples; `block`
    (n,) numbers the blocks and `cell` (n,) the 80 directions of the field; `regression` is R
    between the network's unseen outputs and the targets.
    """

    base: Errors | None
    network: Errors
    rows: Index
    block: Index
    cell: Index
    regression: float

    @property
    def ratio(self) -> float:
        """Rms error of the network over that of the base, unseen; NaN without a base."""
        return float("nan") if self.base is None else self.network.rms / max(self.base.rms, 1e-300)

    @property
    def certainty(self) -> float:
        """By how many standard errors, over the blocks, the network is better."""
        if self.base is None:
            return float("nan")
        better = (self.base.values**2 - self.network.values**2).mean(axis=1)
        gained = [float(better[self.block == number].mean()) for number in np.unique(self.block)]
        spread = float(np.std(gained, ddof=1)) / np.sqrt(len(gained)) if len(gained) > 1 else np.inf
        return float(np.mean(gained)) / max(spread, 1e-300)

    @property
    def winner(self) -> str:
        """The network where it is clearly better, else the base: "network" or "base"."""
        clear = self.base is None or (self.ratio < WORTH and self.certainty > CERTAIN)
        return "network" if clear else "base"

    @property
    def directions(self) -> Array:
        """Rms errors of base and network, and how many readings, by direction (k, 3), nT."""
        if self.base is None:
            return np.empty((0, 3))
        rows = []
        for cell in np.unique(self.cell):
            own = self.cell == cell
            both = (np.sqrt(np.mean(e.values[own] ** 2)) for e in (self.base, self.network))
            rows.append([*both, float(own.sum())])
        return np.array(rows)

    @property
    def sentence(self) -> str:
        """Which won, and by how much."""
        if self.base is None:
            return f"the error of unseen readings is {figure(self.network.rms)} nT (rms)"
        both = f"{figure(self.network.rms)} nT with the network, {figure(self.base.rms)} without"
        if self.winner == "network":
            return f"the error of unseen readings is {both} (rms): the network is better"
        word = "is no better" if self.ratio < 1 / WORTH else "is worse"
        if self.ratio < WORTH:
            word = f"gains {figure(self.certainty)} standard errors, {figure(CERTAIN)} are needed"
        return f"unseen error {both} (rms): the network {word}, so the base is kept"


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkFit(Estimated):
    """A trained network and what it rests on.

    Parameters
    ----------
    calibration : the `Network`, trained on all readings.
    comparison : network and base on unseen readings; None where it was not asked for, or there is
        no base.
    residuals : (n, 3), or (n, 1) of the magnitude: field by the network less the known one, nT.
    weights : (n,) what the robust loss left of each reading.
    noise : standard deviation of a residual on an axis, nT. `correlation` : how many count as one.
    epochs : mean square errors (scaled), μ and γ after each step of the training.
    effective : γ, how many of the weights the readings determine.
    covariance : (m, m) of all weights, in the order of `Network.weights`.
    regression : R between the scaled outputs and targets, of the readings it was trained on.
    """

    calibration: Network
    n: Annotated[int, Shown()]
    residuals: Array
    weights: Array
    noise: Annotated[float, Shown(key="noise_nT")]
    correlation: float
    epochs: tuple[Epoch, ...]
    effective: float
    converged: bool
    regression: Annotated[float, Shown()]
    comparison: Comparison | None = None
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = field(default_factory=tuple)

    @property
    def base(self) -> Affine | Thermal | None:
        """The calibration under the network."""
        return self.calibration.base

    @property
    def chosen(self) -> Network | Affine | Thermal:
        """The network where it is clearly better on unseen readings, else its base."""
        base = self.base
        if base is None or self.comparison is None or self.comparison.winner == "network":
            return self.calibration
        return base

    @property
    def iterations(self) -> Annotated[int, Shown(key="epochs")]:
        """How many epochs the training took."""
        return len(self.epochs)

    @property
    def mean_square(self) -> Annotated[float, Shown()]:
        """Mean square error of the scaled outputs at the end of the training."""
        return self.epochs[-1].mean_square if self.epochs else float("nan")

    @property
    def maximum(self) -> Annotated[float, Shown(key="residual_max_nT")]:
        """The largest error of a component among the readings that took part, nT."""
        return float(np.abs(self.residuals[self.weights > 0]).max())

    @property
    def rms(self) -> Annotated[float, Shown(key="residual_rms_nT")]:
        """Root mean square error on an axis of the readings that took part, nT."""
        return float(np.sqrt(np.mean(self.residuals[self.weights > 0] ** 2)))
