"""What may have been another at some stations: faults to look for, and their weights."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.thermal.maths.station_residuals import StationProblem

ODD, STEP, SETTLING, AGEING = "odd", "step", "settling", "ageing"
THERMOMETER, UNSETTLED = "thermometer", "unsettled"
OF_TEMPERATURE = (THERMOMETER, UNSETTLED)
"""Faults of the temperature; the others are of the bias."""
DECAYS = (0.02, 0.06, 0.2)
"""Time constants of a bias that settles, of the whole campaign."""
_UNSETTLED = 0.1  # of a station's recording: how long a temperature takes to settle
_MOMENTS = 30


class Candidate(NamedTuple):
    """A fault to look for: `weight` (m,) of it at each mean.

    `station` is the odd one, or that in which or before which a step came; `time` the first time
    (s) with the fault; of a bias that settles, its time constant.
    """

    kind: str
    weight: Array
    station: int = 0
    time: float = np.nan


def list_candidates(problem: StationProblem, time: Array) -> Iterator[Candidate]:
    """Odd stations, thermometers that are off, and, where times are known, temperatures that had
    not settled, steps between stations and in the middle of each, and biases that age or settle.
    """
    stations = range(problem.stations) if problem.stations > 1 else ()
    for k in stations:
        own = (problem.station == k).astype(np.float64)
        yield Candidate(ODD, own, k)
        if problem.degree:
            yield Candidate(THERMOMETER, own, k)
    if not np.isfinite(time).all() or np.ptp(time) == 0.0:
        return
    first = [float(time[problem.station == k].min()) for k in stations]
    order = sorted(stations, key=lambda k: first[k])
    for k in order:
        own = problem.station == k
        begins, ends = first[k], float(time[own].max())
        if problem.degree:
            since = np.maximum(time - begins, 0.0) / (_UNSETTLED * max(ends - begins, 1e-9))
            yield Candidate(UNSETTLED, np.asarray(own * np.exp(-since), dtype=np.float64), k)
        for moment in ((begins + ends) / 2,) if k == order[0] else (begins, (begins + ends) / 2):
            yield Candidate(STEP, _step_at(time, moment), k, moment)
    last = order[-1]
    yield Candidate(AGEING, (time - (time.min() + time.max()) / 2) / float(np.ptp(time)), last)
    for share in DECAYS:
        constant = share * float(np.ptp(time))
        left = np.exp((time.min() - time) / constant)
        yield Candidate(SETTLING, np.asarray(left, dtype=np.float64), order[0], constant)


def list_moments(problem: StationProblem, step: Candidate, time: Array) -> Iterator[Candidate]:
    """A step at moments about that of a candidate, as far as half of a station away."""
    own = time[problem.station == step.station]
    reach = 0.55 * float(np.ptp(own))
    near = np.unique(time[np.abs(time - step.time) <= reach])
    for moment in near[:: max(len(near) // _MOMENTS, 1)][1:]:
        place = int(problem.station[np.argmin(np.abs(time - moment))])
        yield Candidate(STEP, _step_at(time, float(moment)), place, float(moment))


def _step_at(time: Array, moment: float) -> Array:
    """Less one half before a moment, one half after."""
    return np.where(time >= moment, 0.5, -0.5)
