"""`choose`: the method that a log determines best, and what is left where that is refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal, get_args

from agonic.attitude.heading_source import check_heading_source
from agonic.attitude.known_heading import compute_mounted_heading
from agonic.attitude.problem import is_known
from agonic.errors import AgonicError, CoverageError, LogError, check_choice
from agonic.field.place import describe_missing
from agonic.fit import Fit
from agonic.health.finding import Severity
from agonic.health.inertial_unit import find_stopped_readings, leave_out_faulty
from agonic.inertial.evidence import check_felt_dip
from agonic.recording.choice.fits import (
    Case,
    Choice,
    fit_alone,
    fit_beside_attitude,
    fit_magnitude,
    join_disturbers,
    list_sources,
)
from agonic.reference import Reference
from agonic.samples import Samples

SURER = 0.8
"""Of the heading's standard error, or the unseen spread of a mix: a fit that uses more has to be
better by this much."""
SURE_DEG = 0.3
"""A heading that is known to this by the magnitude alone needs nothing else."""


def choose_surer(case: Case, reason: str) -> Choice:
    """The fit beside accelerometer and gyro, or that by the magnitude alone where it is as sure.
    Raises `CoverageError` where the log determines neither."""
    enough = "the magnitude alone determines the calibration as well as with the attitude"
    lacks_dip = _lacks_dip(case.reference)
    try:
        alone: Choice | None = fit_alone(case)
    except CoverageError:
        alone = None
    if alone is not None and lacks_dip:
        alone = join_disturbers(alone, case, alone.reason)
    if alone is not None and alone.fit.verdict != "refused":
        opposite = check_felt_dip(alone.fit, case.samples, case.reference)
        if opposite is not None:
            return replace(alone, fit=alone.fit.with_findings(opposite), reason=enough)
    if alone is not None:
        sure = alone.fit.verdict == "good" and alone.fit.coverage.heading_sd_deg < SURE_DEG
        if sure or "static" in find_causes(alone):  # what never turned blames no other sensor
            return replace(alone, reason=enough)
    try:
        aided = fit_beside_unit(case, reason)
    except CoverageError:
        return replace(alone or fit_alone(case), reason=enough)
    except LogError:  # of what is wrong with the acceleration the other fit tells too
        if alone is None:
            raise
        return replace(alone, reason=enough)
    if alone is None:
        return aided
    if lacks_dip and aided.fit.verdict != "refused" and not list_sources(alone.fit):
        alone = fit_alone(case.given(inclination_deg=aided.fit.coverage.inclination_deg))
    ranks = [("good", "check", "refused").index(one.fit.verdict) for one in (aided, alone)]
    surer = ranks[0] < ranks[1]
    if ranks[0] == ranks[1]:
        surer = _own_heading_deg(aided.fit) < SURER * alone.fit.coverage.heading_sd_deg
    if surer:
        return aided
    if aided.fit.verdict == "refused":
        if alone.fit.verdict != "refused":
            return carry_refusal(alone, aided)
        if find_causes(aided) & OF_THE_RECORDING:
            return aided  # what was recorded wrongly is the first thing to know
    return replace(alone, reason=enough)


def fit_beside_unit(case: Case, reason: str) -> Choice:
    """The fit beside accelerometer and gyro; what disturbs on board is chosen by a known field."""
    given = case.given(sources=()) if _lacks_dip(case.reference) else case
    return fit_beside_attitude(given, "inertial", reason)


def _lacks_dip(reference: Reference | None) -> bool:
    return reference is None or reference.values.ndim == 1


def _own_heading_deg(fit: Fit) -> float:
    """The standard error of the heading of the sensor's own axes, degrees; with what disturbs on
    board that of the vehicle's, which is no less."""
    if list_sources(fit):
        return fit.coverage.heading_sd_deg
    return compute_mounted_heading(fit.calibration, fit.coverage).own_sd_deg


Kind = Literal["auto", "ellipsoid", "levelled", "vector", "inertial", "interference"]


def choose(
    samples: Samples, reference: Reference | None, kind: Kind, settings: Mapping[str, Any]
) -> Choice:
    """The fit that a log allows, or the one that was asked for; without readings of a sensor that
    had stopped."""
    check_choice("kind", kind, get_args(Kind))
    case, spoilt = Case(samples, reference, settings), find_stopped_readings(samples)
    if spoilt is None:
        return _choose(case, kind)
    rows, finding = spoilt
    chosen = _choose(case.select(~rows), kind)
    return replace(chosen, fit=chosen.fit.with_findings(finding))


def _choose(case: Case, kind: Kind) -> Choice:
    samples, reference, _ = case
    method, reason = (
        _choose_method(samples, reference) if kind == "auto" else (kind, "as asked for")
    )
    if method == "ellipsoid":
        alone = fit_magnitude(case, reason)
        return join_disturbers(alone, case, reason) if kind == "auto" else alone
    if method == "inertial":
        return (choose_surer if kind == "auto" else fit_beside_unit)(case, reason)
    if reference is None:
        raise AgonicError(
            f"{method}: this fit needs the field of the place: give it (--at LAT,LON, --date), or "
            "a reference with horizontal and vertical intensity"
        )
    if method == "vector" and (doubt := check_heading_source(samples, reference)) is not None:
        by, told = kind, replace(doubt, severity="refuse")
        if kind == "auto":  # roll and pitch are left, and that fit has no use for the heading
            by, reason, told = "levelled", doubt.what, replace(doubt, severity="note")
        chosen = fit_beside_attitude(case, by, reason)
        return replace(chosen, fit=chosen.fit.with_findings(told))
    aided = fit_beside_attitude(case, method, reason)
    if kind == "auto" and aided.fit.verdict == "refused":
        return fall_back(aided, case)
    return aided


def _choose_method(samples: Samples, reference: Reference | None) -> tuple[str, str]:
    """The word of the method, and why."""
    if reference is None or reference.kind not in ("vector", "horizontal-vertical"):
        if samples.roll_deg is None and _has_unit(samples):
            return "inertial", "accelerometer and gyro give the attitude and the dip"
        if reference is None:
            lacks = describe_missing(samples)
            return "ellipsoid", f"{lacks}, so the magnitude is taken as constant, of unknown size"
        return "ellipsoid", "no reference but the magnitude of the field is known"
    if samples.roll_deg is None or samples.pitch_deg is None:
        if samples.acceleration is None:
            return "ellipsoid", "the log holds no roll and pitch, so only the magnitude counts"
        unit = "accelerometer" if samples.rotation_rate is None else "accelerometer and gyro"
        return "inertial", f"the attitude is from {unit}, and the field of the place is known"
    if not is_known(samples) or reference.kind != "vector":
        return "levelled", "roll and pitch were recorded and the field of the place is known"
    if samples.heading_source is not None:
        told = f"roll and pitch were recorded, the heading comes from {samples.heading_source}"
        return "vector", f"{told}, and the field of the place is known"
    return "vector", "the whole attitude was recorded and the field of the place is known"


def _has_unit(samples: Samples) -> bool:
    """Whether the samples hold accelerometer and gyro, and nothing is wrong with either."""
    if samples.time is None or samples.acceleration is None or samples.rotation_rate is None:
        return False
    usable = leave_out_faulty(samples)[0]
    return usable.acceleration is not None and usable.rotation_rate is not None


OF_THE_RECORDING = {"attitude", "heading", "mounting", "inertial unit"}
"""Reasons to refuse a fit which another recording of the same motion would not have."""
NOT_OF_THE_MAGNETOMETER = {"attitude", "heading", "mounting", "correlated noise"}
"""Reasons to refuse a fit that do not concern one that knows the magnitude only, or need not."""


def fall_back(aided: Choice, case: Case) -> Choice:
    """A fit without what was recorded wrongly: without the heading, then without roll and pitch.
    Where anything else refuses a fit, one that knows less would be refused too, or should be."""
    samples = case.samples
    recorded = samples.roll_deg is not None and samples.pitch_deg is not None
    if (
        case.reference is not None
        and recorded
        and aided.method == "vector"
        and {"heading", "mounting"} & find_causes(aided)
        and find_causes(aided) <= NOT_OF_THE_MAGNETOMETER
    ):
        aided = carry_refusal(fit_beside_attitude(case, "levelled", ""), aided)
    causes = find_causes(aided)
    if not causes or not causes <= NOT_OF_THE_MAGNETOMETER:
        return aided
    try:
        alone = fit_alone(case)
    except CoverageError:
        return aided
    return aided if alone.fit.verdict == "refused" else carry_refusal(alone, aided)


def find_causes(choice: Choice) -> set[str]:
    """The names of what refuses a fit."""
    return {finding.name for finding in choice.fit.findings if finding.severity == "refuse"}


def carry_refusal(choice: Choice, refused: Choice) -> Choice:
    """A choice with what refused the fit before it: the log's attitude has to be looked at. What
    the choice says itself is not told again, nor, where it names axes, a mounting by right angles
    or an attitude, nor what a gyro of another unit or axes made of the fit beside it."""
    grave = [finding for finding in refused.fit.findings if finding.severity == "refuse"]
    said = {finding.name for finding in choice.fit.findings}
    said |= {"mounting", "attitude"} if "axes" in said else set()
    if "inertial unit" in said:
        said |= {finding.name for finding in refused.fit.findings}
    known: dict[str, Severity] = {"heading": "note"}  # of which the calibration has no use
    told = [
        replace(one, severity=known.get(one.name, "check")) for one in grave if one.name not in said
    ]
    beside = {"heading", "attitude"} - said
    carried = [one for one in refused.fit.findings if one.name in beside and one not in grave]
    why = f"a {refused.method} fit was refused ({grave[0].what})"
    return replace(choice, fit=choice.fit.with_findings(*told, *carried), reason=why)
