"""The main job: the best calibration of each magnetometer that a log allows, verified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.errors import AgonicError
from agonic.fit import Fit
from agonic.fitting.ellipsoid import evaluate, fit_ellipsoid
from agonic.kernels.affine import correct
from agonic.kernels.angles import angle_deg
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.verification import Check, Verification, verify

Array = NDArray[np.float64]

BLOCKS = 8
AGREEMENT_LIMIT_DEG = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibrated:
    """One magnetometer of a log: its readings, the fit, and its verification.

    `method` is the word of the fit ("ellipsoid"); `reason` says in a sentence why it was chosen;
    `verdict` is "good", "check" or "refused" and `status` the sentence that goes with it.
    """

    samples: Samples
    fit: Fit
    verification: Verification
    method: str
    reason: str
    verdict: str
    status: str


def calibrate(samples: Samples, reference: Reference | None = None, **settings: Any) -> Calibrated:
    """Calibrate one magnetometer and verify it on held-out parts of its own log.

    The log is cut into blocks of time; each row is judged by a fit to the blocks that do not hold
    it (two folds of alternate blocks). The calibration itself uses all rows.

    Parameters: samples, reference and settings as in `fit_ellipsoid`. Raises `CoverageError` where
    nothing can be fitted at all.

    >>> from agonic.simulation import simulate
    >>> calibrate(simulate("tumble").samples, Reference.constant(50_000)).verdict
    'good'
    """
    fit = fit_ellipsoid(samples, reference, **settings)
    folds = _folds(samples, reference, {**settings, "model": fit.calibration.model})
    gain = float(np.trace(fit.calibration.matrix) / 3)
    believed = np.ones(len(samples), dtype=bool) if fit.weights is None else fit.weights > 0
    verification = verify(
        fit.calibration,
        samples,
        reference,
        noise=fit.noise * gain,
        corrected=folds.unseen if folds else None,
        held_out=believed if believed.any() else None,
    )
    checks = (*verification.checks, _agreement(folds))
    return _judged(samples, fit, replace(verification, checks=checks))


def judge(
    calibration: Calibration,
    samples: Samples,
    reference: Reference | None = None,
    **settings: Any,
) -> Calibrated:
    """A calibration made earlier, with the evidence and checks that these samples give.

    Parameters: settings as in `evaluate`. Raises `AgonicError` for a calibration that is not
    affine or carries no covariance.
    """
    if not isinstance(calibration, Affine):
        raise AgonicError(f"a {calibration.kind} calibration cannot be reported yet; an affine can")
    fit = evaluate(calibration, samples, reference, **settings)
    known = reference if calibration.unit_out == "nT" else None
    return _judged(samples, fit, verify(calibration, samples, known))


@dataclass(frozen=True, eq=False)
class _Folds:
    """The field of each row by the fit that had not seen the row, and by the one that had."""

    unseen: Array
    seen: Array


def _folds(
    samples: Samples, reference: Reference | None, settings: Mapping[str, Any]
) -> _Folds | None:
    """Fits to the odd and to the even blocks of time, each applied to all rows."""
    block = np.arange(len(samples)) * BLOCKS // len(samples)
    even = block % 2 == 0
    fields = []
    for rows in (even, ~even):
        try:
            known = _part(reference, rows)
            part = fit_ellipsoid(samples.select(rows), known, **settings).calibration
        except AgonicError:
            return None
        fields.append(correct(samples.field, part.bias, part.matrix))
    unseen = np.where(even[:, None], fields[1], fields[0])
    return _Folds(unseen, np.where(even[:, None], fields[0], fields[1]))


def _part(reference: Reference | None, rows: NDArray[np.bool_]) -> Reference | None:
    """The reference of some of the rows."""
    if reference is None or len(reference.values) == 1:
        return reference
    return replace(reference, values=reference.values[rows])


def _agreement(folds: _Folds | None) -> Check:
    """Whether two halves of the log, fitted apart, point the same way."""
    name = "two halves of the log agree"
    if folds is None:
        return Check(
            name=name,
            value=float("nan"),
            limit=AGREEMENT_LIMIT_DEG,
            unit="°",
            passed=False,
            meaning="half of the log is not enough for a fit, so nothing could be held out: record "
            "longer",
        )
    turn = angle_deg(folds.unseen, folds.seen)
    rms = float(np.sqrt(np.mean(turn**2)))
    good = rms <= AGREEMENT_LIMIT_DEG
    return Check(
        name=name,
        value=rms,
        limit=AGREEMENT_LIMIT_DEG,
        unit="°",
        passed=good,
        meaning="calibrations from alternate parts of the log point the same way"
        if good
        else "calibrations from alternate parts of the log point differently: the field changed, "
        "or too few directions were visited",
    )


def _judged(samples: Samples, fit: Fit, verification: Verification) -> Calibrated:
    """The verdict: refused by the fit, to be checked for a failed check, or good."""
    failed = [check for check in verification.checks if check.passed is False]
    verdict, said = fit.verdict, [fit.status]
    if verdict != "refused" and failed:
        verdict = "check"
        said += [f"On held-out parts {_of(check)}: {check.meaning}." for check in failed]
    return Calibrated(
        samples=samples,
        fit=fit,
        verification=verification,
        method="ellipsoid",
        reason="the log holds no reference but the magnitude of the field",
        verdict=verdict,
        status=" ".join(said),
    )


def _of(check: Check) -> str:
    """A failed check with its numbers."""
    limit = "" if check.limit is None else f" (limit {check.limit:g} {check.unit})"
    return f"{check.name} is {check.value:.3g} {check.unit}{limit}".replace(" )", ")")
