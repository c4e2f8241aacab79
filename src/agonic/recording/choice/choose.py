"""`choose`: the method that a log determines best."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal, get_args

from agonic.attitude.heading_source import check_heading_source
from agonic.attitude.problem import is_known
from agonic.attitude.vertical_turn import tell_turn
from agonic.errors import AgonicError, check_choice
from agonic.field.place import describe_missing
from agonic.health import Finding
from agonic.health.gross import find_gross_readings
from agonic.health.inertial_unit import find_stopped_readings, leave_out_faulty
from agonic.recording.choice.fallback import fall_back
from agonic.recording.choice.fits import (
    Choice,
    fit_beside_attitude,
    fit_magnitude,
    join_disturbers,
)
from agonic.recording.choice.surer import choose_surer, fit_beside_unit
from agonic.reference import Reference
from agonic.samples import Samples

Kind = Literal["auto", "ellipsoid", "levelled", "vector", "inertial", "interference"]


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
    """The fit that a log allows, or the one that was asked for; without readings of a size that no
    sensor gives, and of one that had stopped."""
    check_choice("kind", kind, get_args(Kind))
    told = []
    for find in (find_gross_readings, find_stopped_readings):
        if (spoilt := find(samples)) is not None:
            rows, finding = spoilt
            reference = None if reference is None else reference.select(~rows)
            samples = samples.select(~rows)
            told.append(finding)
    chosen = _choose(samples, reference, kind, settings)
    return replace(chosen, fit=chosen.fit.with_findings(*told)) if told else chosen


def _choose(
    samples: Samples, reference: Reference | None, kind: Kind, settings: Mapping[str, Any]
) -> Choice:
    method, reason = (
        _choose_method(samples, reference) if kind == "auto" else (kind, "it was asked for")
    )
    if method == "ellipsoid":
        alone = _tell_turn(fit_magnitude(samples, reference, reason, settings))
        if kind != "auto":
            return alone
        return join_disturbers(alone, samples, reference, reason, settings)
    if kind == "auto" and method == "inertial":
        return choose_surer(samples, reference, reason, settings)
    if method == "inertial":
        return fit_beside_unit(samples, reference, reason, settings)
    if reference is None:
        raise AgonicError(
            f"{method}: this fit needs the field of the place: give it (--at LAT,LON, --date), or "
            "a reference with horizontal and vertical intensity"
        )
    if method == "vector" and (doubt := check_heading_source(samples, reference)) is not None:
        return _without_heading(samples, reference, kind, settings, doubt)
    aided = fit_beside_attitude(samples, reference, method, reason, settings)
    if kind == "auto" and aided.fit.verdict == "refused":
        return fall_back(aided, samples, reference, settings)
    return aided


def _tell_turn(alone: Choice) -> Choice:
    """A fit to the magnitude with how roll and pitch show the sensor turned in its vehicle."""
    if alone.fit.verdict == "refused":
        return alone
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
    told = replace(doubt, severity="note")  # the fit has no use for it
    return replace(levelled, fit=levelled.fit.with_findings(told))


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
