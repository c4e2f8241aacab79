"""A reference that drifts while the vehicle goes round: what it adds, and what would show it."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.headings.maths import swing_plan
from agonic.headings.maths.reference_drift import (
    MOST,
    ReferenceDrift,
    add_drift,
    average_over_drift,
)
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.deviation import DeviationSolution


def allow_drift(
    rows: Array,
    solved: DeviationSolution,
    weighted: bool,
    noise_deg: float | None,
    drift_deg: float | None,
) -> ReferenceDrift:
    """With what a drift of the reference adds: as much as is stated, or as may be."""
    used = solved.weights > 0 if weighted else np.ones(len(rows), dtype=bool)
    if drift_deg is None:
        return average_over_drift(rows[used], solved.residuals[used], solved.covariance, noise_deg)
    if not drift_deg >= 0.0:
        raise AgonicError(f"drift_deg is {drift_deg}; give the drift over the swing, 0 for none")
    return ReferenceDrift(add_drift(rows[used], solved.covariance, drift_deg), 0.0)


def ask_to_return(compass_deg: Array, drift_deg: float | None) -> tuple[str, ...]:
    """What would show a drift that was not stated, where few readings went round once.

    >>> len(ask_to_return(np.array([0.0, 120.0, 240.0]), None))
    1
    >>> ask_to_return(np.array([0.0, 120.0, 240.0, 359.0]), None)
    ()
    """
    returned = abs(float(wrap_deg(compass_deg[-1] - compass_deg[0]))) <= swing_plan.CELL_DEG
    if returned or drift_deg is not None or len(compass_deg) > MOST:
        return ()
    return (
        "a reference that drifted meanwhile looks like A to E: steer the first heading again at "
        "the end, or state its drift (drift_deg)",
    )
