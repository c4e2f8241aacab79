"""`fit_recording`: from one recording of any length, read piece by piece."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from agonic.calibration.base import Validity
from agonic.ellipsoid.calibration import CITATIONS, Gauge, Scale, calibration, finished, settings
from agonic.ellipsoid.evidence import rows_of, with_evidence
from agonic.ellipsoid.fit import Asked, normalised
from agonic.ellipsoid.large_scan import Progress, Recording, Scan, scanned
from agonic.ellipsoid.large_solve import Whole, maximised
from agonic.ellipsoid.moments_fit import middle
from agonic.ellipsoid.solve import Fixed, Found, Model, algebraic, choose
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
from agonic.maths.equation import likelihood
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
    and each iteration is one pass that adds up the normal equations of all readings; two are the
    rule. Noise, losses, correlation and standard errors are those of all readings.

    Parameters
    ----------
    recording : what gives the readings: `ag.open_mission(paths)`.
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
    asked = Asked(model, method, robust, soft_iron_sd, gauge, inclination_deg, seed)
    return _fitted(recording, reference, asked, progress)[0]


def fit_and_rows(
    recording: Recording,
    reference: Reference | None = None,
    *,
    progress: Progress | None = None,
    **settings: Any,
) -> tuple[Fit, Samples]:
    """`fit_recording`, and the readings drawn from it, a row for each of the fit's residuals."""
    return _fitted(recording, reference, Asked(**settings), progress)


def _fitted(
    recording: Recording, reference: Reference | None, asked: Asked, progress: Progress | None
) -> tuple[Fit, Samples]:
    check_choice("model", asked.model, get_args(Model))
    check_choice("method", asked.method, get_args(Method))
    check_choice("gauge", asked.gauge, get_args(Gauge))
    if reference is not None and len(reference.values) > 1:
        raise AgonicError("a recording read in pieces needs one constant reference magnitude")
    told = progress or (lambda _name, _rows: None)
    scan = scanned(recording, asked.method == "adjusted", asked.seed, told)
    solve = _adjusted if asked.method == "adjusted" else _likeliest
    solved = solve(recording, scan, reference, asked, told)
    return _evident(recording, scan, reference, asked, solved), scan.samples


class _Solved(NamedTuple):
    """What was found, in normalised coordinates; the tests of models; all that the passes saw."""

    found: Found
    scale: Scale
    tests: tuple[ModelTest, ...]
    n: int
    whole: Whole | None = None


def _adjusted(
    _recording: Recording, scan: Scan, reference: Reference | None, asked: Asked, _told: Progress
) -> _Solved:
    """The adjusted fit, from the moments of the first pass."""
    assert scan.moments is not None
    count = scan.moments.count
    centre, size = middle(scan.moments)
    known = None if reference is None else float(reference.magnitudes(1)[0])
    scale = Scale(centre, size, known, reference.sd if reference else 0.0)
    sums = scan.moments.rebase(centre, size).sums
    found, tests = choose(
        lambda chosen: algebraic(sums, chosen, "adjusted"), asked.model, count, "adjusted"
    )
    return _Solved(found, scale, tests, count)


def _likeliest(
    recording: Recording, scan: Scan, reference: Reference | None, asked: Asked, told: Progress
) -> _Solved:
    """The maximum of the likelihood of all readings, from that of the rows in memory."""
    usable = find_usable_rows(scan.samples.field)
    scale, magnitude = normalised(scan.samples, reference, usable, "likelihood")
    points = (scan.samples.field[rows_of(usable)] - scale.centre) / scale.size
    robust = asked.robust and len(points) >= 2 * FEWEST
    seen: dict[str, Whole] = {}

    def attempt(chosen: Fixed) -> Found:
        problem = likelihood.Problem(points, magnitude, chosen, asked.soft_iron_sd)
        start = likelihood.estimate(problem, robust=robust, seed=asked.seed)
        whole = maximised(recording, scan, scale, chosen, start, asked.soft_iron_sd, robust, told)
        residuals, _ = likelihood.distances(points, whole.found.bias, whole.found.matrix, magnitude)
        weights = whole.noise.loss.weight((residuals / whole.noise.sd) ** 2)
        seen[chosen] = whole
        return whole.found._replace(residuals=residuals, weights=weights)

    found, tests = choose(attempt, asked.model, scan.rows, "likelihood")
    whole = seen[found.model]
    return _Solved(found, scale, tests, whole.n, whole)


def _evident(
    recording: Recording, scan: Scan, reference: Reference | None, asked: Asked, solved: _Solved
) -> Fit:
    """The fit, with what the rows in memory tell and what the passes counted."""
    samples, found = scan.samples, solved.found
    chosen = settings(
        asked.model,
        asked.method,
        asked.gauge,
        reference,
        robust=asked.robust,
        soft_iron_sd=asked.soft_iron_sd,
        seed=asked.seed,
    )
    affine = replace(
        calibration(found, solved.scale, samples.unit, asked.gauge),
        sensor=samples.name,
        frame_in=samples.frame,
        frame_out=samples.frame,
        validity=Validity(largest_reading=scan.largest),
        provenance=Provenance(
            inputs=recording.inputs, settings=chosen, method=CITATIONS[asked.method]
        ),
    )
    assert affine.noise is not None
    fit = with_evidence(
        found._replace(noise=affine.noise),
        affine,
        samples,
        reference,
        find_usable_rows(samples.field),
        solved.tests,
        asked.inclination_deg,
    )
    findings = tuple(f for f in fit.findings if f.name != "outliers")
    fit = replace(fit, n=solved.n, findings=findings)
    if scan.stride > 1:
        thinned = (
            f"rows were thinned for pictures and for what single rows tell: {len(samples)} of "
            f"{scan.rows}, drawn evenly; the fit is of all"
        )
        fit = replace(fit, remarks=(*fit.remarks, thinned))
    return finished(
        fit, (*check_rejected(scan.rejected, _total(scan)), *_passed(scan, solved, fit))
    )


def _total(scan: Scan) -> int:
    return scan.rows + sum(scan.rejected.values())


def _passed(scan: Scan, solved: _Solved, fit: Fit) -> tuple[Finding | None, ...]:
    """What the passes over all readings found out: strays, and a bias that moves."""
    whole = solved.whole
    if whole is None or fit.verdict == "refused":
        return ()
    if any(f.name == "field changed" for f in fit.findings):
        return ()  # one cause is not told twice
    strays, moved = check_outliers(whole.strays, whole.n), whole.moved
    if moved is None or moved.significance < BEYOND_CHANCE:
        return (strays,)
    shift = float(np.linalg.norm(moved.shift[:3])) * solved.scale.size
    gain = float(np.trace(fit.calibration.matrix) / 3)
    assert fit.calibration.magnitude is not None
    moment = f"row {moved.stretch * scan.stretch}"
    if scan.begun is not None:
        moment = f"t = {scan.begun[moved.stretch] - scan.begun[0]:.1f} s"
    radius = fit.calibration.magnitude / gain
    return strays, check_bias_drift(shift, radius, moment, fit.calibration.unit_in)
