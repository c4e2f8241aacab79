"""`fit_inflight`: bias, gains or all nine numbers from the known field along the track."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from agonic.calibration.base import Calibration
from agonic.errors import AgonicError
from agonic.field.place import describe_missing, field_along
from agonic.inflight.fit import evidence
from agonic.inflight.fit.allowances import allow_for_unseen
from agonic.inflight.fit.decay import settle_torquers
from agonic.inflight.fit.pointing import expect_direction, find_direction_e
from agonic.inflight.fit.problem import (
    Attitude,
    Problem,
    Settings,
    Solve,
    make_settings,
    pose_problem,
    select_rows,
)
from agonic.inflight.fit.result import InflightFit, build_result
from agonic.inflight.fit.solve import find_estimate
from agonic.inflight.fit.torquers import Switches
from agonic.reference import Reference
from agonic.samples import Samples


def fit_inflight(
    samples: Samples,
    reference: Reference | None = None,
    *,
    ground: Calibration | None = None,
    solve: Solve | None = None,
    drift_knots: int | Literal["auto"] = "auto",
    exclude: ArrayLike | None = None,
    latitude_deg: tuple[float, float] | None = None,
    residual_limit: float | None = None,
    temperature_degree: int = 0,
    matrix_rate: bool = False,
    sources: Sequence[str] = (),
    attitude: Attitude = "none",
    gain_sd: float = 0.01,
    soft_iron_sd: float | None = 0.1,
    robust: bool = True,
    seed: int = 0,
) -> InflightFit:
    """A calibration brought up to date, or made, against the geomagnetic model.

    With u the field by the ground calibration, minimises over bias c, matrix M and their terms

        Σ ρ(r/σ)/ν + |prior|²/2,   r = (|M (u − c)| − F) / |Mᵀû|,

    c = c₀ + spline(t) + powers of temperature + currents, M alike. With the attitude two more kinds
    of residual across the field join, each with a noise of its own. Errors of the model are
    correlated in time: how much of the residuals, and how long, enters every standard error.

    Parameters
    ----------
    samples : readings with times; with a track and a date where no reference is given. Rows that
        are `flagged` are left out, and so are those in which a torquer is on (a disturber in A m²)
        that `sources` do not name, or has not settled yet after it switched; where `sources` name
        it, the time constant with which its field follows is found and taken into account.
    reference : the field on the way, or a scalar instrument's reading (`Reference.magnitude`);
        default: the world model along the samples' own track. With the attitude directions are
        those of the world model where the reference is a magnitude.
    ground : the calibration made on the ground (affine, thermal, or a chain): its shape in
        temperature stays, what is solved for moves on top of it.
    solve : "bias", "gains" (bias and three gains) or "full" (all nine); default "bias" with a
        ground calibration and "full" without.
    drift_knots : intervals of the spline of the bias in time; 0 for a constant bias, "auto" for as
        many as make unseen readings fit better.
    exclude : (n,) true for rows to leave out; `latitude_deg` (low, high) keeps rows between these
        latitudes; `residual_limit` leaves out readings farther off than so many nT.
    temperature_degree : order of polynomials in temperature of the bias and of what is solved for
        of the matrix; 0 for none. The calibration is then a `Thermal`.
    matrix_rate : let the matrix change steadily with time; the calibration is that at the end.
    sources : what disturbs on board, recorded in the samples: "current_A", "throttle", "second";
        the calibration is then an `Interference`.
    attitude : "logged": the fit is aided by roll, pitch and heading, and the rotation from the
        sensor to them is found; "nadir": they are those of a spacecraft that keeps one side to the
        Earth, from its track; "none".
    gain_sd : how far gains and cross terms may have moved since the ground, as a share.
    soft_iron_sd : prior on soft iron where there is no ground calibration.
    robust : down-weight outliers with Tukey's loss. seed : of the random starts.

    Returns an `InflightFit`. Raises `CoverageError` where the readings cannot determine it,
    `AgonicError` without a reference or a track, `LogError` where a column is missing.

    Source: Olsen et al. (2003) for the scalar calibration in orbit, Earth Planets Space 55, 11–18;
    Huber (1981) for loss and covariance; Markley (1988) for the first rotation.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from agonic.simulation import simulate
    >>> made = simulate("tumble", n=4000, noise=50.0)
    >>> ground = replace(made.truth, bias=made.truth.bias + [800.0, -300.0, 500.0])
    >>> fit = fit_inflight(made.samples, Reference.constant(50_000.0), ground=ground)
    >>> bool(np.abs(fit.calibration.bias - made.truth.bias).max() < 10.0)
    True
    """
    settings = make_settings(locals())
    problem = _pose_problem(samples, reference, ground, exclude, settings)
    problem, estimate = find_estimate(problem)
    since = Switches(problem.torquers.commands).measure_since(problem.samples)
    step_s = float(np.median(np.diff(problem.time)))
    problem, estimate = settle_torquers(problem, estimate, since, step_s, follows=True)
    estimate, found = allow_for_unseen(problem, estimate)
    return evidence.examine(build_result(problem, estimate, samples), problem, samples, found)


def _pose_problem(
    samples: Samples,
    reference: Reference | None,
    ground: Calibration | None,
    exclude: ArrayLike | None,
    settings: Settings,
) -> Problem:
    """What is to be fitted, or an error that says what is missing."""
    if samples.time is None:
        raise AgonicError("a fit in flight needs times; the log has none")
    along = reference
    if reference is None or (settings.attitude != "none" and reference.kind != "vector"):
        expected = field_along(samples)
        if expected is None:
            raise AgonicError(
                f"the field along the track is not known: {describe_missing(samples)}; give a "
                "reference, positions (they can come from two-line elements), or --date"
            )
        along = expected.reference
    assert along is not None
    left_out = None if exclude is None else np.asarray(exclude, dtype=bool)
    return pose_problem(
        samples,
        np.broadcast_to((reference or along).magnitudes(len(samples)), len(samples)),
        select_rows(samples, left_out, settings.latitude_deg),
        ground,
        settings,
        source=(reference or along).source,
        direction=expect_direction(samples, along, settings.attitude),
        direction_e=find_direction_e(samples, along),
    )
