"""Which of two fits is surer: that by the magnitude alone, or that beside an attitude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from agonic.attitude.mounted_heading import compute_mounted_heading
from agonic.errors import CoverageError, LogError
from agonic.fit import Fit
from agonic.inertial.evidence import check_felt_dip
from agonic.model.terms import HIDDEN
from agonic.recording.choice.fallback import OF_THE_RECORDING, carry_refusal, find_causes
from agonic.recording.choice.fits import (
    Choice,
    fit_alone,
    fit_beside_attitude,
    join_disturbers,
    state_heading_alone,
)
from agonic.recording.choice.sources import list_sources
from agonic.reference import Reference
from agonic.samples import Samples

SURER = 0.8
"""Of the heading's standard error: a fit that knows more has to be better by this much."""
BIAS_LOOSER = 3.0
"""A bias that is known so many times less well makes no fit surer."""
SURE_DEG = 0.3
"""A heading that is known to this by the magnitude alone needs nothing else."""
SEEN_BY_DIRECTION = {"turned sensor", *(term.name for term in HIDDEN if term.at_rest)}
"""Errors that dip and azimuth show and the magnitude hides: a fit by the magnitude alone is sure of
itself for not seeing them."""


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
    if alone is not None and (_is_sure(alone.fit) or "static" in find_causes(alone)):
        return replace(alone, reason=enough)  # what never turned blames no other sensor
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
        alone = _fit_at_dip(samples, reference, aided.fit, settings)
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


def _fit_at_dip(
    samples: Samples, reference: Reference | None, aided: Fit, settings: Mapping[str, Any]
) -> Choice:
    """The fit by the magnitude alone, its heading stated at the dip that another found."""
    dip = settings.get("inclination_deg")
    found = {"inclination_deg": aided.coverage.inclination_deg if dip is None else dip}
    return fit_alone(samples, reference, {**settings, **found})


def fit_beside_unit(
    samples: Samples, reference: Reference | None, reason: str, settings: Mapping[str, Any]
) -> Choice:
    """The fit beside accelerometer and gyro; what disturbs on board is chosen by a known field."""
    given = {"sources": (), **settings} if _lacks_dip(reference) else settings
    return fit_beside_attitude(samples, reference, "inertial", reason, given)


def _lacks_dip(reference: Reference | None) -> bool:
    return reference is None or reference.values.ndim == 1


def leave_attitude(
    aided: Choice, samples: Samples, reference: Reference, settings: Mapping[str, Any]
) -> Choice:
    """The fit to the magnitude alone where it is clearly surer than beside roll and pitch.

    In a room the dip is not that of the place, and an attitude may be wrong for seconds: errors
    which the magnitude does not have.
    """
    if list_sources(aided.fit) or _own_heading_deg(aided.fit) < SURE_DEG:
        return aided
    wanted_deg = SURER * _own_heading_deg(aided.fit)
    try:
        if state_heading_alone(samples, reference, settings) >= wanted_deg:
            return aided  # its evidence could only add to that
        alone = fit_alone(samples, reference, settings)
    except CoverageError:
        return aided
    surer = alone.fit.coverage.heading_sd_deg < wanted_deg and knows_bias(alone.fit, aided.fit)
    if not surer or _rank(alone.fit) > _rank(aided.fit) or _sees_less(alone.fit, aided.fit):
        return aided
    why = "the magnitude alone tells the calibration more surely than with the attitude"
    return replace(alone, reason=why)


def knows_bias(alone: Fit, aided: Fit) -> bool:
    """Whether a fit knows the bias along all axes about as well as another.

    A level heading hardly asks for the vertical one, but that of a tilted vehicle does.
    """
    return float(alone.sd[:3].max()) < BIAS_LOOSER * float(aided.sd[:3].max())


def _is_sure(alone: Fit) -> bool:
    """Whether a fit by the magnitude alone is good and leaves nothing to ask for."""
    return alone.verdict == "good" and alone.coverage.heading_sd_deg < SURE_DEG


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


def _sees_less(alone: Fit, aided: Fit) -> bool:
    """Whether directions show an error of the readings that magnitudes hide."""
    told = {finding.name for finding in aided.findings} & SEEN_BY_DIRECTION
    return not told <= {finding.name for finding in alone.findings}
