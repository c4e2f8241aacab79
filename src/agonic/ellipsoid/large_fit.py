"""`fit_recording`: from one recording of any length, read piece by piece."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from agonic.calibration.base import Validity
from agonic.ellipsoid.evidence import assess
from agonic.ellipsoid.large_scan import Progress, Recording, Scan, scan_recording
from agonic.ellipsoid.large_solve import Whole, maximise
from agonic.ellipsoid.moments_fit import normalise_moments
from agonic.ellipsoid.problem import Scale, make_calibration, normalise, rows_of
from agonic.ellipsoid.settings import CITATIONS, Fixed, Gauge, Model, Settings
from agonic.ellipsoid.solve import Found, choose_model, solve_algebraic
from agonic.errors import AgonicError, check_choice
from agonic.fit import Fit, ModelTest
from agonic.health import (
    FEWEST,
    Finding,
    check_bias_drift,
    check_outliers,
    check_rejected,
    find_usable_rows,
)
from agonic.maths.equation.channels import Problem, compute_distances
from agonic.maths.equation.maximum_likelihood import estimate
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples

Method = Literal["likelihood", "adjusted"]

BEYOND_CHANCE = 60.0
"""χ² of a change of nine parameters at an unknown moment; chance alone makes some 30 of it."""


def fit_recording(
    recording: Recording,
    reference: Reference | None = None,
    *,
    model: Model = "auto",
    method: Method = "likelihood",
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    gauge: Gauge = "symmetric",
    inclination_deg: float = 60.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Fit:
    """`fit_ellipsoid` over a recording of any length, read piece by piece in constant memory.

    The first pass draws some 100 000 readings evenly and, for the adjusted fit, adds up moments,
    which is all that it needs. For maximum likelihood the fit to the readings drawn is the start,
    and each iteration is one pass that adds up the normal equations of all readings; one is the
    rule, two where outliers are down-weighted. Noise, losses, correlation and standard errors are
    those of all readings.

    Parameters
    ----------
    recording : what gives the readings: `ag.inflight.open_mission(paths)`.
    reference : one constant magnitude, nT; as in `fit_ellipsoid`.
    method : "likelihood", or "adjusted", one pass.
    progress : called with the name of the pass and the rows done in it.

    The others as in `fit_ellipsoid`: `model`, `robust`, `soft_iron_sd`, `gauge`, `inclination_deg`
    (degrees), `seed`. Residuals and weights of the result are those of the readings
    drawn, `n` counts all.

    Returns a `Fit`. Raises `CoverageError` where nothing can be fitted at all, `LogError` where
    files do not follow each other in time.

    Source: normal equations in pieces, see docs/theory/large-data; Huber (1981) for the covariance,
    with the scatter of batches where errors last (Künsch 1989).

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from agonic.logs.large.mission import open_mission
    >>> from agonic.exports.csv import write_csv
    >>> from agonic.simulation import simulate
    >>> made = simulate("tumble")
    >>> with TemporaryDirectory() as folder:
    ...     path = write_csv(made.samples, Path(folder, "long.csv"))
    ...     fit = fit_recording(open_mission([path]), Reference.constant(50_000))
    >>> fit.n == len(made.samples), fit.ok
    (True, True)
    """
    settings = Settings(
        model=model,
        method=method,
        robust=robust,
        soft_iron_sd=soft_iron_sd,
        gauge=gauge,
        inclination_deg=inclination_deg,
        seed=seed,
    )
    return _fit(recording, reference, settings, progress)[0]


def fit_recording_and_rows(
    recording: Recording,
    reference: Reference | None = None,
    *,
    progress: Progress | None = None,
    **settings: Any,
) -> tuple[Fit, Samples]:
    """`fit_recording`, and the readings drawn from it, a row for each of the fit's residuals."""
    return _fit(recording, reference, Settings(**settings), progress)


def _fit(
    recording: Recording, reference: Reference | None, settings: Settings, progress: Progress | None
) -> tuple[Fit, Samples]:
    check_choice("method", settings.method, get_args(Method))
    if reference is not None and len(reference.values) > 1:
        raise AgonicError("a recording read in pieces needs one constant reference magnitude")
    report = progress or (lambda _name, _rows: None)
    scan = scan_recording(recording, settings.method == "adjusted", settings.seed, report)
    solve = _adjust if settings.method == "adjusted" else _maximise
    solved = solve(recording, scan, reference, settings, report)
    return _assess(recording, scan, reference, settings, solved), scan.samples


class _Solved(NamedTuple):
    """What was found, in normalised coordinates; the tests of models; all that the passes saw."""

    found: Found
    scale: Scale
    tests: tuple[ModelTest, ...]
    n: int
    whole: Whole | None = None


def _adjust(
    _recording: Recording,
    scan: Scan,
    reference: Reference | None,
    settings: Settings,
    _told: Progress,
) -> _Solved:
    """The adjusted fit, from the moments of the first pass."""
    assert scan.moments is not None
    count = scan.moments.count
    sums, scale = normalise_moments(scan.moments, reference)
    found, tests = choose_model(
        lambda model: solve_algebraic(sums, model, "adjusted"), settings.model, count, "adjusted"
    )
    return _Solved(found, scale, tests, count)


def _maximise(
    recording: Recording,
    scan: Scan,
    reference: Reference | None,
    settings: Settings,
    report: Progress,
) -> _Solved:
    """The maximum of the likelihood of all readings, from that of the rows in memory."""
    usable = find_usable_rows(scan.samples.field)
    scale, magnitude = normalise(scan.samples, reference, usable, "likelihood")
    points = (scan.samples.field[rows_of(usable)] - scale.centre) / scale.size
    robust = settings.robust and len(points) >= 2 * FEWEST
    seen: dict[str, Whole] = {}

    def attempt(chosen: Fixed) -> Found:
        problem = Problem(points, magnitude, chosen, settings.soft_iron_sd)
        start = estimate(problem, robust=robust, seed=settings.seed)
        whole = maximise(
            recording, scan, scale, chosen, start, settings.soft_iron_sd, robust, report
        )
        residuals, _ = compute_distances(points, whole.found.bias, whole.found.matrix, magnitude)
        weights = whole.noise.loss.weight((residuals / whole.noise.sd) ** 2)
        seen[chosen] = whole
        return whole.found._replace(residuals=residuals, weights=weights)

    found, tests = choose_model(attempt, settings.model, scan.rows, "likelihood")
    whole = seen[found.model]
    return _Solved(found, scale, tests, whole.n, whole)


def _assess(
    recording: Recording,
    scan: Scan,
    reference: Reference | None,
    settings: Settings,
    solved: _Solved,
) -> Fit:
    """The fit, with what the rows in memory tell and what the passes counted."""
    samples, found = scan.samples, solved.found
    affine = replace(
        make_calibration(found, solved.scale, samples.unit, settings.gauge),
        sensor=samples.name,
        frame_in=samples.frame,
        frame_out=samples.frame,
        validity=Validity(largest_reading=scan.largest),
        provenance=Provenance(
            inputs=recording.inputs,
            settings=settings.recorded(reference),
            method=CITATIONS[settings.method],
        ),
    )
    assert affine.noise is not None
    fit = assess(
        found._replace(noise=affine.noise),
        affine,
        samples,
        reference,
        find_usable_rows(samples.field),
        solved.tests,
        settings.inclination_deg,
    )
    findings = tuple(f for f in fit.findings if f.name != "outliers")
    fit = replace(fit, n=solved.n, findings=findings)
    if scan.stride > 1:
        thinned = (
            f"rows were thinned for pictures and for what single rows tell: {len(samples)} of "
            f"{scan.rows}, drawn evenly; the fit is of all"
        )
        fit = replace(fit, remarks=(*fit.remarks, thinned))
    return fit.with_findings(
        *check_rejected(scan.rejected, scan.rows + sum(scan.rejected.values())),
        *_find_over_all(scan, solved, fit),
    )


def _find_over_all(scan: Scan, solved: _Solved, fit: Fit) -> tuple[Finding | None, ...]:
    """What the passes over all readings found out: outliers, and a bias that moves."""
    whole = solved.whole
    if whole is None or fit.verdict == "refused":
        return ()
    if any(f.name == "field changed" for f in fit.findings):
        return ()  # one cause is not told twice
    outliers, moved = check_outliers(whole.outliers, whole.n), whole.change_point
    if moved is None or moved.significance < BEYOND_CHANCE:
        return (outliers,)
    shift = float(np.linalg.norm(moved.shift[:3])) * solved.scale.size
    gain = float(np.trace(fit.calibration.matrix) / 3)
    assert fit.calibration.magnitude is not None
    moment = f"row {moved.stretch * scan.stretch}"
    if scan.begun is not None:
        moment = f"t = {scan.begun[moved.stretch] - scan.begun[0]:.1f} s"
    radius = fit.calibration.magnitude / gain
    return outliers, check_bias_drift(shift, radius, moment, fit.calibration.unit_in)
