"""`fit_mission`: a fit in flight over more readings than memory holds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from tempfile import TemporaryFile
from typing import IO, Literal

import numpy as np

from agonic.calibration.base import Calibration, apply
from agonic.calibration.timing import find_timing
from agonic.errors import AgonicError
from agonic.inflight.fit import evidence, large_scan
from agonic.inflight.fit.allowances import allow_for_unseen
from agonic.inflight.fit.covariance import Clock, Estimate
from agonic.inflight.fit.decay import settle_torquers
from agonic.inflight.fit.prior import build_prior
from agonic.inflight.fit.problem import Problem, Solve, make_settings, pose_problem
from agonic.inflight.fit.result import InflightFit, build_result
from agonic.inflight.fit.solve import add_covariance, compute_residuals_of, find_estimate
from agonic.inflight.fit.torquers import Switches, is_on, is_settling
from agonic.inflight.maths.residuals import Block, cut, residual_pieces
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import squares, tukey


def fit_mission(
    recording: large_scan.Recording,
    *,
    scalar: bool = False,
    ground: Calibration | None = None,
    solve: Solve | None = None,
    drift_knots: int | Literal["auto"] = "auto",
    latitude_deg: tuple[float, float] | None = None,
    temperature_degree: int = 0,
    matrix_rate: bool = False,
    sources: Sequence[str] = (),
    gain_sd: float = 0.01,
    soft_iron_sd: float | None = 0.1,
    robust: bool = True,
    seed: int = 0,
    progress: large_scan.Progress | None = None,
) -> InflightFit:
    """`fit_inflight` over a record of any length, by the magnitude, piece by piece.

    The first pass evaluates the world model along the track and keeps the field in a temporary
    file, 20 bytes a reading; some 100 000 rows evenly over the record are fitted in memory and
    settle what the terms are. Then each iteration is one pass that adds up the normal equations of
    all readings, and a last pass reads off how long errors are correlated.

    Parameters
    ----------
    recording : what gives the readings: `ag.inflight.open_mission(paths)`.
    scalar : against the scalar instrument in the record instead of the world model.
    progress : called with the name of the pass and the rows done in it.

    The others as in `fit_inflight`: `ground`, `solve`, `drift_knots`, `latitude_deg` (low, high)
    degrees, `temperature_degree`, `matrix_rate`, `sources`, `gain_sd`, `soft_iron_sd`, `robust`,
    `seed`. Rows of the result are every `thinned`-th.

    Returns an `InflightFit`. Raises `CoverageError` where the readings cannot determine it,
    `AgonicError` without a track or a date, `LogError` where pieces do not follow in time.

    Source: normal equations in pieces, see docs/theory/inflight; Huber (1981) for the covariance.

    Examples
    --------
    >>> from agonic.inflight.simulation.orbit import simulate_orbit
    >>> made = simulate_orbit(n=4000, rate_Hz=0.1, thermal=0.0, external=0.0, pointing="tumble")
    >>> class Halves:
    ...     rows = 4000
    ...     def pieces(self, without=()):
    ...         for half in (np.arange(2000), np.arange(2000, 4000)):
    ...             yield made.samples.select(half)
    >>> fit = fit_mission(Halves(), drift_knots=0)
    >>> bool(np.abs(fit.change.bias - made.bias[-1]).max() < 5 * fit.sd[:3].max()), fit.n
    (True, 4000)
    """
    settings = make_settings(locals())
    if timed := find_timing(settings.sources):
        raise AgonicError(
            f"{', '.join(timed)}: a record that is read piece by piece has no delays and time "
            "constants of sources; name them as they are (readings while torquers settle are left "
            "out), or give one file that fits in memory"
        )
    progress = progress or (lambda _name, _rows: None)
    with TemporaryFile() as cache:
        scan = large_scan.scan_recording(recording, cache, scalar, settings, progress)
        problem = pose_problem(
            scan.samples,
            scan.known.magnitudes,
            np.isfinite(scan.known.magnitudes),
            ground,
            settings,
            source=scan.source,
            direction_e=scan.known.direction_e,
        )
        first = find_estimate(problem)
        problem, thinned = settle_torquers(*first, scan.since, scan.step_s, follows=False)
        estimate, n = _solve_whole(recording, cache, scan, problem, thinned, progress)
    seen = compute_residuals_of(problem, estimate, "magnitude")[problem.used]
    whole = estimate._replace(residuals={"magnitude": seen})
    whole, found = allow_for_unseen(problem, whole)
    fit = build_result(problem, whole, scan.samples)
    fit = replace(fit, correlation_s=fit.correlation * scan.step_s, thinned=scan.stride)
    return replace(evidence.examine(fit, problem, scan.samples, found), n=n)


def _solve_whole(
    recording: large_scan.Recording,
    cache: IO[bytes],
    scan: large_scan.Scan,
    problem: Problem,
    estimate: Estimate,
    progress: large_scan.Progress,
) -> tuple[Estimate, int]:
    """The estimate from all readings, noise and terms as the rows in memory had them; and how many
    readings they are."""
    loss = tukey() if problem.settings.robust else squares()
    noise = estimate.noise["magnitude"]._replace(loss=loss)
    torquers = problem.torquers
    off = torquers.unmodelled if torquers.on else ()
    passes = taking_part = 0

    def source() -> Iterator[Block]:
        nonlocal passes, taking_part
        passes, done, taking_part = passes + 1, 0, 0
        switches = Switches(torquers.commands)
        cache.seek(0)
        for samples in recording.pieces(scan.without):
            known = large_scan.Known.read(cache, len(samples))
            since = switches.measure_since(samples)
            left = is_on(samples, off) | is_settling(since, torquers.settling_s, scan.step_s)
            known = known._replace(magnitudes=np.where(left, np.nan, known.magnitudes))
            here = replace(
                problem,
                samples=samples if problem.ground is None else apply(problem.ground, samples),
                wanted=known.magnitudes / problem.magnitude,
                direction_e=known.direction_e,
            )
            rows, usable = here.rows(estimate.terms), np.isfinite(known.magnitudes)
            rows = rows if usable.all() else rows.select(usable)
            taking_part += len(rows.points)
            yield from cut(rows, estimate.layout)
            done += len(samples)
            progress(f"iteration {passes}", done)

    plain = residual_pieces(source, "magnitude", estimate.layout, noise.sd)
    channel = leastsq.Channel(plain, noise.sd, loss, noise.correlation, keep=False)
    solution = leastsq.solve_together(
        [channel],
        estimate.solution.params,
        prior=build_prior(problem, estimate.terms, estimate.layout),
        tolerance=3e-2,
    )
    clock = Clock.of(float(problem.time[0]), float(problem.time[-1]), scan.step_s)
    whole = estimate._replace(solution=solution, noise={"magnitude": noise})
    return add_covariance(problem, whole, source, clock), taking_part
