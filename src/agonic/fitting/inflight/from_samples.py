"""`fit_inflight`: bias, gains or all nine numbers from the magnitude of the field on the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agonic.calibration.base import Calibration, apply
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.field.place import field_along
from agonic.fitting.inflight import belief, drift, evidence, restored
from agonic.fitting.inflight.record import InflightFit
from agonic.health import FEWEST, usable_rows
from agonic.kernels import taught
from agonic.kernels.affine import SYMMETRIC
from agonic.kernels.leastsq import robust_scale
from agonic.reference import Reference
from agonic.samples import Samples

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]
Solve = Literal["bias", "gains", "full"]

BLOCKS = 10
MOST_INTERVALS = 32
WORTH = 0.98
"""More knots are kept when they bring the unseen residual below this share."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """What is to be fitted: precorrected field and magnitudes over `magnitude`, priors, times."""

    field: Array
    wanted: Array
    magnitude: float
    time: Array
    believed: Rows
    ground: Calibration | None
    solve: str
    gain_sd: float
    soft_iron_sd: float | None
    robust: bool
    seed: int


def fit_inflight(
    samples: Samples,
    reference: Reference | None = None,
    *,
    ground: Calibration | None = None,
    solve: Solve | None = None,
    drift_knots: int | Literal["auto"] = "auto",
    exclude: ArrayLike | None = None,
    latitude_deg: tuple[float, float] | None = None,
    gain_sd: float = 0.01,
    soft_iron_sd: float | None = 0.1,
    robust: bool = True,
    seed: int = 0,
) -> InflightFit:
    """A calibration brought up to date, or made, against the geomagnetic model.

    With u the field by the ground calibration, minimises over bias c, matrix M and the drift

        Σ ρ(r/σ)/ν + |prior|²/2,   r = (|M (u − c(t))| − F(t)) / |Mᵀû|

    where ν is how many readings count as one: errors of the model last for minutes, so the
    correlation of the residuals is estimated and enters every standard error.

    Parameters
    ----------
    samples : readings with times; with a track and a date where no reference is given.
    reference : the field on the way, or a scalar instrument's reading (`Reference.magnitude`);
        default: the world model along the samples' own track.
    ground : the calibration made on the ground (affine, thermal, or a chain): its shape in
        temperature stays, what is solved for moves on top of it.
    solve : "bias", "gains" (bias and three gains) or "full" (all nine); default "bias" with a
        ground calibration and "full" without.
    drift_knots : intervals of the spline of the bias in time; 0 for a constant bias, "auto" for as
        many as make unseen readings fit better.
    exclude : (n,) true for rows to leave out (torquers on); `latitude_deg` (low, high) keeps rows
        between these latitudes.
    gain_sd : how far gains and cross terms may have moved since the ground, as a share.
    soft_iron_sd : prior on soft iron where there is no ground calibration.

    Returns an `InflightFit`. Raises `CoverageError` where the readings cannot determine it,
    `AgonicError` without a reference or a track.

    Source: Olsen et al. (2003) for the scalar calibration in orbit, Earth Planets Space 55, 11–18.

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> made = simulate("tumble", n=4000, noise=50.0)
    >>> from dataclasses import replace
    >>> ground = replace(made.truth, bias=made.truth.bias + [800.0, -300.0, 500.0])
    >>> fit = fit_inflight(made.samples, Reference.constant(50_000.0), ground=ground)
    >>> bool(np.abs(fit.calibration.bias - made.truth.bias).max() < 10.0)
    True
    """
    solve = solve or ("full" if ground is None else "bias")
    check_choice("solve", solve, get_args(Solve))
    if samples.time is None:
        raise AgonicError("a fit in flight needs times; the log has none")
    if ground is None and solve != "full":
        raise AgonicError(f'solve="{solve}" moves a ground calibration; give one, or solve "full"')
    if reference is None:
        expected = field_along(samples)
        if expected is None:
            raise AgonicError(
                "the field on the way is not known: the log has no positions or no date; give a "
                "reference, two-line elements, or --date"
            )
        reference = expected.reference
    kept = _kept(samples, exclude, latitude_deg)
    before = samples if ground is None else apply(ground, samples)
    wanted = reference.magnitudes(len(samples))
    magnitude = float(wanted.mean())
    task = Task(
        field=before.field,
        wanted=np.broadcast_to(wanted / magnitude, len(samples)),
        magnitude=magnitude,
        time=samples.time,
        believed=kept,
        ground=ground,
        solve=solve,
        gain_sd=gain_sd,
        soft_iron_sd=soft_iron_sd,
        robust=robust,
        seed=seed,
    )
    intervals, held_out = _intervals(task, drift_knots)
    _, estimate = solved(task, kept, intervals)
    fit = restored.fit(task, estimate, intervals, samples, held_out)
    return evidence.examined(fit, task, samples)


def _kept(
    samples: Samples, exclude: ArrayLike | None, latitude_deg: tuple[float, float] | None
) -> Rows:
    """The rows that take part."""
    rows = usable_rows(samples.field)
    flagged = samples.columns().get("flagged")
    if flagged is not None:
        rows &= flagged == 0
    if exclude is not None:
        left_out = np.asarray(exclude, dtype=bool)
        if left_out.shape != rows.shape:
            raise AgonicError(f"exclude has {left_out.shape} values for {len(rows)} readings")
        rows &= ~left_out
    if latitude_deg is not None:
        if samples.latitude_deg is None:
            raise AgonicError("latitudes were asked for and the log has no positions")
        rows &= (samples.latitude_deg >= latitude_deg[0]) & (
            samples.latitude_deg <= latitude_deg[1]
        )
    if rows.sum() < FEWEST:
        raise CoverageError(f"{int(rows.sum())} readings are left, too few for a fit")
    return rows


def solved(task: Task, rows: Rows, intervals: int) -> tuple[taught.Problem, taught.Estimate]:
    """The estimate from some of the rows with so many intervals of drift, and its problem."""
    knots = drift.knots_between(task.time[0], task.time[-1], intervals)
    terms = drift.spline(task.time, knots)
    problem = taught.Problem(
        points=task.field / task.magnitude,
        terms=terms - terms.mean(axis=0),
        horizontal=np.asarray(task.wanted),
        vertical=np.zeros(1),
        down=None,
        across=None,
        model="full",
        gauge=SYMMETRIC,
        soft_iron_sd=task.soft_iron_sd,
        turn_sd=None,
    )
    part = problem.subset(np.flatnonzero(rows))
    if task.ground is None:
        return problem, taught.estimate(part, robust=task.robust, seed=task.seed)
    sd = belief.matrix_sd(task.ground, task.solve, task.gain_sd)
    start = np.concatenate([np.zeros(3), [1, 1, 1, 0, 0, 0], np.zeros(3 * terms.shape[1])])
    prior = belief.prior(sd, 3 * terms.shape[1], taught.TERM_SD)
    return problem, taught.refined(part, start, task.robust, prior)


def _intervals(task: Task, asked: int | Literal["auto"]) -> tuple[int, dict[int, float]]:
    """How many intervals of drift, and the unseen residual of each number tried, nT."""
    if asked != "auto":
        if asked < 0:
            raise AgonicError(f"drift_knots is {asked}; it counts intervals, 0 for a constant bias")
        return asked, {}
    tried = {0: _unseen(task, 0)}
    best, intervals = 0, 1
    while intervals <= MOST_INTERVALS and task.believed.sum() > 40 * (intervals + drift.DEGREE):
        tried[intervals] = _unseen(task, intervals)
        if tried[intervals] < WORTH * tried[best]:
            best = intervals
        elif intervals > 2 * max(best, 1):
            break
        intervals *= 2
    return best, tried


def _unseen(task: Task, intervals: int) -> float:
    """Robust rms of residuals in every second block of time, by a fit to the others, nT."""
    block = np.arange(len(task.time)) * BLOCKS // len(task.time) % 2 == 0
    left = []
    for rows in (block, ~block):
        problem, estimate = solved(task, task.believed & rows, intervals)
        unseen = problem.subset(np.flatnonzero(task.believed & ~rows))
        left.append(taught.residuals(unseen, "magnitude", estimate.solution.params))
    return robust_scale(np.concatenate(left)) * task.magnitude
