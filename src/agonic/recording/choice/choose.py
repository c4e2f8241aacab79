"""`choose`: the method that a log determines best, and what is left where one is refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal, get_args

from agonic.attitude.heading_source import check_heading_source
from agonic.attitude.known_heading import is_known
from agonic.attitude.mounted_heading import compute_mounted_heading
from agonic.attitude.vertical_turn import tell_turn
from agonic.errors import AgonicError, CoverageError, LogError, check_choice
from agonic.field.place import describe_missing
from agonic.fit import Fit
from agonic.health import Finding
from agonic.health.inertial_unit import find_stopped_readings, leave_out_faulty
from agonic.recording.choice.fits import (
    Choice,
    fit_alone,
    fit_beside_attitude,
    fit_magnitude,
    join_disturbers,
    state_heading_alone,
)
from agonic.recording.choice.sources import list_sources
from agonic.reference import Reference
from agonic.samples import Samples

Kind = Literal["auto", "ellipsoid", "levelled", "vector", "inertial", "interference"]

SURER = 0.8
"""Of the heading's standard error: a fit that knows more has to be better by this much."""
BIAS_LOOSER = 3.0
"""A bias that is known so many times less well makes no fit surer."""
SURE_DEG = 0.3
"""A heading that is known to this by the magnitude alone needs nothing else."""
OF_THE_RECORDING = {"attitude", "heading", "mounting", "inertial unit"}
"""Reasons to refuse a fit which another recording of the same motion would not have."""
NOT_OF_THE_MAGNETOMETER = {"attitude", "heading", "mounting"}
"""Reasons to refuse a fit that do not concern one that knows the magnitude only."""

SEEN_BY_DIRECTION = {"turned sensor", "non-linear", "compressed", "follows bank", "follows pitch"}
"""Errors that dip and azimuth show and the magnitude hides: a fit by the magnitude alone is sure of
itself for not seeing them."""

ASK_FOR_PLACE = (
    "say where and when the log was recorded (--at LAT,LON, --date), and the calibration turns the "
    "sensor to roll and pitch; look how the sensor sits, and set their zero with the vehicle level"
)
ASK_FOR_ATTITUDE = (
    "leave out --method, and the calibration turns the sensor to roll and pitch; look how the "
    "sensor sits, and set their zero with the vehicle level"
)
"""What makes use of a turn that a fit to the magnitude leaves in the readings."""


def choose(
    samples: Samples, reference: Reference | None, kind: Kind, settings: Mapping[str, Any]
) -> Choice:
    """The fit that a log allows, or the one that was asked for; without readings of a sensor that
    had stopped."""
    check_choice("kind", kind, get_args(Kind))
    stopped = find_stopped_readings(samples)
    if stopped is not None:
        rows, finding = stopped
        reference = None if reference is None else reference.select(~rows)
        chosen = _choose(samples.select(~rows), reference, kind, settings)
        return replace(chosen, fit=chosen.fit.with_findings(finding))
    return _choose(samples, reference, kind, settings)


def _choose(
    samples: Samples, reference: Reference | None, kind: Kind, settings: Mapping[str, Any]
) -> Choice:
    method, reason = (
        _choose_method(samples, reference) if kind == "auto" else (kind, "it was asked for")
    )
    if method == "ellipsoid":
        alone = _tell_turn(fit_magnitude(samples, reference, reason, settings))
        if kind != "auto" or reference is None:
            return alone
        return join_disturbers(alone, samples, reference, reason, settings)
    if kind == "auto" and method == "inertial":
        return _choose_surer(samples, reference, reason, settings)
    if method == "inertial":
        return _fit_inertial(samples, reference, reason, settings)
    if reference is None:
        raise AgonicError(
            f"{method}: this fit needs the field of the place: give it (--at LAT,LON, --date), or "
            "a reference with horizontal and vertical intensity"
        )
    if method == "vector" and (doubt := check_heading_source(samples, reference)) is not None:
        return _without_heading(samples, reference, kind, settings, doubt)
    aided = fit_beside_attitude(samples, reference, method, reason, settings)
    if kind != "auto":
        return aided
    if aided.fit.verdict == "refused":
        return fall_back(aided, samples, reference, settings)
    return _leave_attitude(aided, samples, reference, settings)


def _tell_turn(alone: Choice) -> Choice:
    """A fit to the magnitude with how roll and pitch show the sensor turned in its vehicle."""
    kind = alone.reference.kind if alone.reference is not None else None
    known = kind in ("vector", "horizontal-vertical")
    move = ASK_FOR_ATTITUDE if known else ASK_FOR_PLACE
    told = tell_turn(alone.fit, alone.samples, alone.latency, move)
    return replace(alone, fit=told)


def _without_heading(
    samples: Samples,
    reference: Reference,
    kind: Kind,
    settings: Mapping[str, Any],
    doubt: Finding,
) -> Choice:
    """The fit by roll and pitch alone, or the one that was asked for, with what speaks against the
    heading."""
    if kind != "auto":
        chosen = fit_beside_attitude(samples, reference, kind, "it was asked for", settings)
        told = replace(doubt, severity="refuse")
        return replace(chosen, fit=chosen.fit.with_findings(told))
    levelled = fit_beside_attitude(samples, reference, "levelled", doubt.what, settings)
    return replace(levelled, fit=levelled.fit.with_findings(doubt))


def _choose_method(samples: Samples, reference: Reference | None) -> tuple[str, str]:
    """The word of the method, and why."""
    if reference is None or reference.kind not in ("vector", "horizontal-vertical"):
        if samples.roll_deg is None and _has_unit(samples):
            return "inertial", "accelerometer and gyro tell how the sensor turned, and the dip"
        if reference is None:
            lacks = describe_missing(samples)
            return "ellipsoid", f"{lacks}, so only the steadiness of the magnitude counts"
        return "ellipsoid", "no reference but the magnitude of the field is known"
    if samples.roll_deg is None or samples.pitch_deg is None:
        if samples.acceleration is None:
            return "ellipsoid", "the log holds no roll and pitch, so only the magnitude counts"
        unit = "accelerometer" if samples.rotation_rate is None else "accelerometer and gyro"
        return "inertial", f"{unit} tell how the sensor turned, and the field of the place is known"
    if not is_known(samples) or reference.kind != "vector":
        return "levelled", "roll and pitch were recorded and the field of the place is known"
    if samples.heading_source is not None:
        told = f"roll and pitch were recorded, {samples.heading_source} tells the heading"
        return "vector", f"{told}, and the field of the place is known"
    return "vector", "the whole attitude was recorded and the field of the place is known"


def _has_unit(samples: Samples) -> bool:
    """Whether the samples hold accelerometer and gyro, and nothing is wrong with either."""
    if samples.time is None or samples.acceleration is None or samples.rotation_rate is None:
        return False
    usable = leave_out_faulty(samples)[0]
    return usable.acceleration is not None and usable.rotation_rate is not None


def _lacks_dip(reference: Reference | None) -> bool:
    return reference is None or reference.values.ndim == 1


def _fit_inertial(
    samples: Samples, reference: Reference | None, reason: str, settings: Mapping[str, Any]
) -> Choice:
    """The fit beside accelerometer and gyro; what disturbs on board is chosen by a known field."""
    given = {"sources": (), **settings} if _lacks_dip(reference) else settings
    return fit_beside_attitude(samples, reference, "inertial", reason, given)


def _choose_surer(
    samples: Samples, reference: Reference | None, reason: str, settings: Mapping[str, Any]
) -> Choice:
    """The fit beside accelerometer and gyro, or that by the magnitude alone where it is as sure."""
    alone = aided = None
    try:
        alone = fit_alone(samples, reference, settings)
        if reference is not None and _lacks_dip(reference):
            alone = join_disturbers(alone, samples, reference, alone.reason, settings)
    except CoverageError as error:
        failed = error
    enough = "the magnitude alone tells the calibration as surely as with the attitude"
    if alone is not None and _is_sure(alone.fit):
        return replace(alone, reason=enough)
    try:
        aided = _fit_inertial(samples, reference, reason, settings)
        if alone is not None and _lacks_dip(reference) and settings.get("inclination_deg") is None:
            found = {"inclination_deg": aided.fit.coverage.inclination_deg}
            if not list_sources(alone.fit):
                alone = fit_alone(samples, reference, {**settings, **found})  # heading by heading
    except CoverageError:
        if alone is None:
            raise failed from None
    except LogError:  # what is wrong with the acceleration, as the other fit says too
        if alone is None:
            raise
    if aided is None or (alone is not None and not _is_surer(aided.fit, alone.fit)):
        assert alone is not None
        if aided is not None and aided.fit.verdict == "refused":
            if alone.fit.verdict != "refused":
                return _tell(alone, aided)
            if _causes(aided) & OF_THE_RECORDING:
                return aided  # what was recorded wrongly is the first thing to know
        return replace(alone, reason=enough)
    return aided


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


def _leave_attitude(
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


def _sees_less(alone: Fit, aided: Fit) -> bool:
    """Whether directions show an error of the readings that magnitudes hide."""
    told = {finding.name for finding in aided.findings} & SEEN_BY_DIRECTION
    return not told <= {finding.name for finding in alone.findings}


def fall_back(
    aided: Choice, samples: Samples, reference: Reference | None, settings: Mapping[str, Any]
) -> Choice:
    """A fit without what was recorded wrongly: without the heading, then without roll and pitch.

    Where anything else refuses a fit, one that knows less would be refused too, or should be.
    """
    recorded = samples.roll_deg is not None and samples.pitch_deg is not None
    if (
        reference is not None
        and recorded
        and "heading" in _causes(aided)
        and _causes(aided) <= NOT_OF_THE_MAGNETOMETER
    ):
        levelled = fit_beside_attitude(samples, reference, "levelled", "", settings)
        aided = _tell(levelled, aided)
    causes = _causes(aided)
    if not causes or not causes <= NOT_OF_THE_MAGNETOMETER:
        return aided
    try:
        alone = fit_alone(samples, reference, settings)
    except CoverageError:
        return aided
    return aided if alone.fit.verdict == "refused" else _tell(alone, aided)


def _causes(choice: Choice) -> set[str]:
    """The names of what refuses a fit."""
    return {finding.name for finding in choice.fit.findings if finding.severity == "refuse"}


def _tell(choice: Choice, refused: Choice) -> Choice:
    """A choice with what refused the fit before it: the log's attitude has to be looked at.

    What the choice says itself is not told again, nor, where it names axes, a mounting by right
    angles or an attitude, nor what a gyro of another unit or axes made of the fit beside it.
    """
    grave = [finding for finding in refused.fit.findings if finding.severity == "refuse"]
    said = {finding.name for finding in choice.fit.findings}
    said |= {"mounting", "attitude"} if "axes" in said else set()
    if "inertial unit" in said:
        said |= {finding.name for finding in refused.fit.findings}
    told = [replace(one, severity="check") for one in grave if one.name not in said]
    carried = [one for one in refused.fit.findings if one.name == "heading" and one not in grave]
    why = f"a {refused.method} fit was refused ({grave[0].what})"
    return replace(choice, fit=choice.fit.with_findings(*told, *carried), reason=why)
