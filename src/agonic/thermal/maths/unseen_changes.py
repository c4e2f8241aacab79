"""What changes of the field between stations may do to a calibration by the magnitude, unseen.

Twelve magnitudes less nine numbers leave three. A field, or a gain, that is another from one
station on looks in most of its parts like another calibration, and hardly shows: between six faces
up and six others, by a hundredth of itself. What little shows
tells how much did not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtri

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.thermal.maths.estimate import StationEstimate
from agonic.thermal.maths.fault_scores import change_fields, linearise
from agonic.thermal.maths.gaussian_process import STEADY
from agonic.thermal.maths.station_residuals import StationProblem, make_whitener

PLAUSIBLE = 0.003
"""Of the field: what it may change by from one hour to another in a building, if nobody watches."""
_BOUND = float((3.0 / chdtri(3, 0.95)) ** 0.5)
"""A standard deviation that three numbers tell is below 2.9 times theirs with 95 %."""


def measure_shown_change(estimate: StationEstimate) -> float:
    """By how much of itself the field, or the gain, seems to change between stations, where the
    magnitude alone is known: what showed is another constant at each, for steps look like it.
    """
    slow = estimate.slow
    return _BOUND * slow.sd if estimate.poses is None and slow.kind == STEADY else 0.0


def allow_for_unseen_changes(
    problem: StationProblem, estimate: StationEstimate, time: Array, sds: Sequence[float]
) -> list[Array]:
    """What joins the covariance (a, a) of the coefficients, where the field takes a random step of
    each of `sds` (over the field) from each station to the next; `time` (m,) of the means, s.

        ΔC = (Jᵀ V⁻¹ J + P)⁻¹ − (JᵀJ + P)⁻¹,   V = 1 + σ² S Sᵀ

    with the whitened Jacobian J, the prior P, and what each step does to the residuals, S. Parts of
    a step that would show count no more than the noise lets them.
    """
    a = problem.layout.shape[1]
    if problem.turns_known or problem.stations < 2:
        return [np.zeros((a, a)) for _ in sds]
    fit = linearise(problem, estimate, time, ())
    later = _rank_stations(problem, time)[:, None] >= np.arange(1, problem.stations)
    steps = change_fields(fit, later)
    whiten = make_whitener(problem, fit.state._replace(slow=fit.slow))
    rows, (_, by) = whiten(np.hstack([fit.jacobian, steps])), fit.prior
    known, told, steady = by.T @ by, rows.T @ rows, np.eye(problem.stations - 1)
    n = len(known)
    at_rest = leastsq.inverse(told[:n, :n] + known)[:a, :a]
    return [
        leastsq.inverse(told + block_diag(known, steady / sd**2))[:a, :a] - at_rest
        if sd > 0.0
        else np.zeros((a, a))
        for sd in sds
    ]


def _rank_stations(problem: StationProblem, time: Array) -> Array:
    """Of each mean (m,) how many stations were recorded before; in their order without a clock."""
    if not np.isfinite(time).all():
        return np.asarray(problem.station)
    first = [float(time[problem.station == k].min()) for k in range(problem.stations)]
    return np.asarray(np.argsort(np.argsort(first))[problem.station])
