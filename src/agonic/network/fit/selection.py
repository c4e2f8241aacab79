"""`choose_network`: how many hidden nodes, and whether any at all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from agonic.calibration.affine import Affine
from agonic.calibration.network import Network
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.maths.equation.network import Nodes
from agonic.network.fit.fit import fit_network
from agonic.network.fit.result import NetworkFit
from agonic.reference import Reference
from agonic.samples import Samples

NODES = (7, 6, 5, 4, 3, 2)
"""The table of the paper."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A line of the table: R, largest and rms error on all readings, and on unseen ones (nT)."""

    hidden: Nodes
    regression: float
    maximum: float
    rms: float
    unseen_regression: float
    unseen_maximum: float
    unseen_rms: float


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkChoice:
    """The table over hidden nodes, the fit of the fewest that are as good as the best, and why.

    `base_rms` and `base_maximum` are the errors of the base on unseen readings, None without one.
    """

    table: tuple[Row, ...]
    fit: NetworkFit
    base_rms: float | None
    base_maximum: float | None

    @property
    def chosen(self) -> Network | Affine | Thermal:
        """The calibration to use: the network, or its base where that is as good."""
        return self.fit.chosen

    @property
    def sentence(self) -> str:
        """What was chosen, and why."""
        if self.chosen is not self.fit.calibration:
            return "no network is needed"
        return f"{self.fit.calibration.shape.said} are enough"


def choose_network(
    samples: Samples,
    reference: Reference,
    *,
    hidden: Sequence[Nodes] = NODES,
    progress: Callable[[Sequence[Nodes]], Iterable[Nodes]] = iter,
    **settings: Any,
) -> NetworkChoice:
    """The table of hidden nodes on unseen readings, and the network or base that it speaks for.

    The fewest nodes whose unseen rms error is within 5 % of the least are taken, and the base where
    the network is not clearly better than it (`Comparison.winner`). Where readings lie in a plane
    two nodes do for anything: make the table on readings that fill space.

    Parameters: `samples`, `reference` and settings as in `fit_network`; `hidden` the numbers to
    try; `progress` passes them on one by one.

    Returns a `NetworkChoice`. Raises as `fit_network`.

    Source: Wang, Sheng, He & Cheng (2020), table 1, doi:10.4236/jcc.2020.86004.

    Examples
    --------
    >>> from agonic.network.simulate import simulate_paper
    >>> made = simulate_paper(15.0, directions="space")
    >>> choice = choose_network(
    ...     made.samples, made.reference, hidden=(3, 2), base=None, stopping="plain"
    ... )
    >>> [round(row.unseen_regression, 2) for row in choice.table]
    [1.0, 0.82]
    """
    if not hidden:
        raise AgonicError("hidden is empty; give the numbers of nodes to try")
    if settings.get("start") is not None or settings.get("compared") is False:
        raise AgonicError("a choice compares fresh networks; leave start and compared out")
    fits = [fit_network(samples, reference, hidden=h, **settings) for h in progress(hidden)]
    table = []
    for fit in fits:
        assert fit.comparison is not None
        row = Row(
            hidden=fit.calibration.shape.hidden,
            regression=fit.regression,
            maximum=fit.maximum,
            rms=fit.rms,
            unseen_regression=fit.comparison.regression,
            unseen_maximum=fit.comparison.network.maximum,
            unseen_rms=fit.comparison.network.rms,
        )
        table.append(row)
    most = 1.05 * min(row.unseen_rms for row in table)
    good = [fit for fit, row in zip(fits, table, strict=True) if row.unseen_rms <= most]
    fit = min(good, key=lambda fit: fit.calibration.shape.nodes)
    base = None if fit.comparison is None else fit.comparison.base
    return NetworkChoice(
        table=tuple(table),
        fit=fit,
        base_rms=None if base is None else base.rms,
        base_maximum=None if base is None else base.maximum,
    )
