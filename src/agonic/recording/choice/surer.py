"""Which of two fits is surer: that by the magnitude alone, or that beside an attitude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from agonic.attitude.mounted_heading import compute_mounted_heading
from agonic.errors import CoverageError, LogError
from agonic.fit import Fit
from agonic.inertial.evidence import check_felt_dip
from agonic.recording.choice.fallback import OF_THE_RECORDING, carry_refusal, find_causes
from agonic.recording.choice.fits import (
    Choice,
    fit_alone,
    fit_beside_attitude,
    join_disturbers,
    list_sources,
)
from agonic.reference import Reference
from agonic.samples import Samples

SURER = 0.8
"""Of the heading's standard error: a fit that knows more has to be better by this much."""
SURE_DEG = 0.3
"""A heading that is known to this by the magnitude alone needs nothing else."""


def choose_surer(
    samples: Samples, reference: Reference | None, reason: str, settings: Mapping[str, Any]
) -> Choice:
    """The fit beside accelerometer and gyro, or that by the magnitude alone where it is as sure.

    Raises `CoverageError` where the log determines neither.
    """
    enough = "the magnitude alone tells the calibration as surely as with the attitude"
    alone = _try_alone(samples, reference, settings)
    if alone is not None and alone.fit.verdict != "refused":
        opposite = check_felt_dip(alone.fit, samples, reference)
        if opposite is not None:
            return replace(alone, fit=alone.fit.with_findings(opposite), reason=enough)
    if alone is not None:
        sure = alone.fit.verdict == "good" and alone.fit.coverage.heading_sd_deg < SURE_DEG
        if sure or "static" in find_causes(alone):  # what never turned blames no other sensor
            return replace(alone, reason=enough)
    try:
        aided = fit_beside_unit(samples, reference, reason, settings)
    except CoverageError:
        return replace(alone or fit_alone(samples, reference, settings), reason=enough)
    except LogError:  # of what is wrong with the acceleration the other fit tells too
        if alone is None:
            raise
        return replace(alone, reason=enough)
    if alone is None:
        return aided
    if _lacks_dip(reference) and aided.fit.verdict != "refused" and not list_sources(alone.fit):
        at_dip = {"inclination_deg": aided.fit.coverage.inclination_deg, **settings}
        alone = fit_alone(samples, reference, at_dip)
    if _is_surer(aided.fit, alone.fit):
        return aided
    if aided.fit.verdict == "refused":
        if alone.fit.verdict != "refused":
            return carry_refusal(alone, aided)
        if find_causes(aided) & OF_THE_RECORDING:
            return aided  # what was recorded wrongly is the first thing to know
    return replace(alone, reason=enough)


def _try_alone(
    samples: Samples, reference: Reference | None, settings: Mapping[str, Any]
) -> Choice | None:
    """The fit by the magnitude alone, with what disturbs on board where that is known."""
    try:
        alone = fit_alone(samples, reference, settings)
    except CoverageError:
        return None
    if not _lacks_dip(reference):
        return alone
    return join_disturbers(alone, samples, reference, alone.reason, settings)


def fit_beside_unit(
    samples: Samples, reference: Reference | None, reason: str, settings: Mapping[str, Any]
) -> Choice:
    """The fit beside accelerometer and gyro; what disturbs on board is chosen by a known field."""
    given = {"sources": (), **settings} if _lacks_dip(reference) else settings
    return fit_beside_attitude(samples, reference, "inertial", reason, given)


def _lacks_dip(reference: Reference | None) -> bool:
    return reference is None or reference.values.ndim == 1


def _is_surer(aided: Fit, alone: Fit) -> bool:
    """Whether a fit beside the attitude is clearly better than that by the magnitude alone."""
    if _rank(aided) != _rank(alone):
        return _rank(aided) < _rank(alone)
    return _own_heading_deg(aided) < SURER * alone.coverage.heading_sd_deg


def _rank(fit: Fit) -> int:
    return ("good", "check", "refused").index(fit.verdict)


def _own_heading_deg(fit: Fit) -> float:
    """The standard error of the heading of the sensor's own axes, degrees; with what disturbs on
    board that of the vehicle's, which is no less."""
    if list_sources(fit):
        return fit.coverage.heading_sd_deg
    return compute_mounted_heading(fit.calibration, fit.coverage).own_sd_deg
