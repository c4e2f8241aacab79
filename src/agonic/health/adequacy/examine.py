"""All tests of a fit, the wider covariance, and the findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.health.adequacy.fitted import Fitted, ModelError
from agonic.health.adequacy.moving_bias import find_lasting, find_moving_bias
from agonic.health.adequacy.structure import find_prior, find_structure
from agonic.health.adequacy.terms import find_terms
from agonic.health.adequacy.work import prepare
from agonic.health.finding import Finding, figure

DOUBTFUL_DEG = 0.5
"""Of heading: what the model leaves open beyond this asks for a look."""

SEEN_DEG = 0.2
"""Of heading: nobody looks for what is less."""

CAUSES: dict[str, tuple[str, str]] = {
    "non-linear": (
        "the sensor is not linear: its readings bend",
        "take iron and magnets away from it, choose a wider range, or calibrate it with a network "
        "(agonic fit network)",
    ),
    "compressed": (
        "readings are compressed where the field on the sensor is strong",
        "take iron and magnets away from it or choose a wider range",
    ),
    "late": (
        "readings are late where the sensor turns fast",
        "turn it slowly, or take the delay out (agonic fit latency)",
    ),
    "memory": (
        "readings depend on those before them (a filter, rows interpolated between readings, axes "
        "read one after another, or iron that is magnetised)",
        "turn it slowly; if that changes nothing, take soft iron away from the sensor, or "
        "demagnetise it",
    ),
    "bias drift": (
        "the bias moved during the log",
        "let it warm up, keep iron and currents as they are, and record again",
    ),
    "gain drift": (
        "gains changed during the log",
        "let it warm up and keep its settings as they are, and record again",
    ),
    "alternating": (
        "even and odd rows differ: two sensors take turns",
        "separate them (a sensor column, --sensor) and calibrate each by itself",
    ),
    "comes and goes": (
        "a disturbance along one direction comes and goes (a current, something that moves)",
        "switch currents off or record them beside the field, and fasten what moves",
    ),
    "follows bank": (
        "a disturbance goes with the bank of the vehicle (a current, something that swings)",
        "fasten what swings, record the currents beside the field, and calibrate with them",
    ),
    "follows pitch": (
        "a disturbance goes with the pitch of the vehicle (a current, something that swings)",
        "fasten what swings, record the currents beside the field, and calibrate with them",
    ),
    "follows turns": (
        "a disturbance goes with how fast the vehicle turns (the current of motors that turn it)",
        "record the currents beside the field and calibrate with them, or turn it by hand",
    ),
    "two populations": (
        "readings are of two calibrations, mixed: two sensors, or a current that switches",
        "separate the sensors, or record the current beside the field",
    ),
    "prior": (
        "the directions seen (a cap, a plane or two) do not determine the heading; what is "
        "known of it is the prior's word, or comes of noise",
        "turn the sensor about all three axes",
    ),
    "by direction": (
        "residuals depend on the direction, by what the model does not know",
        "record away from steel, turning about the sensor itself; look at the map of residuals",
    ),
}
"""What each cause means, and what to do."""

_MOVING_CAUSES = ("bias drift", "gain drift", "alternating", "comes and goes", "two populations")


def examine_model(fitted: Fitted) -> tuple[ModelError, ...]:
    """What the residuals show that the model does not have, the most telling first."""
    work = prepare(fitted)
    if work is None:
        return ()
    found = [*find_terms(work), *find_moving_bias(work)]
    found += find_structure(work, found)
    return (*found, *find_lasting(work, found), *find_prior(work))


def widen(calibration: Affine, errors: Sequence[ModelError], plain: Array | None = None) -> Affine:
    """The calibration with a covariance that covers what the model does not have.

    `plain` is its covariance without what noise with memory adds, where that is in it: an error of
    the model that comes and goes is such noise, and counts once. What lasts and may be noise is in
    it as noise; it counts beside it for field and heading, as a hidden bias.
    """
    own = calibration.covariance
    lasting = next((error for error in errors if error.cause == "lasting"), None)
    errors = [one for one in errors if one is not lasting]
    if lasting is not None:
        calibration = replace(calibration, hidden_bias=lasting.growth[:3, :3])
    if not errors or own is None:
        return calibration
    grown = (own if plain is None else plain) + sum(error.growth for error in errors)
    return replace(calibration, covariance=grown if plain is None else _cover(own, grown))


def _cover(one: Array, other: Array) -> Array:
    """A covariance that is as large as either in every direction: a + (b − a)₊."""
    size = np.sqrt(np.maximum(np.diag(one) + np.diag(other), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh((other - one) / np.outer(size, size))
    beyond = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.asarray(one + beyond * np.outer(size, size))


def describe_model_errors(
    errors: Sequence[ModelError], others: Sequence[Finding], unit: str
) -> tuple[Finding, ...]:
    """A finding for each cause, none where another finding already names it.

    A check where it matters beside what was stated without it, else a note; of what only may be
    there nothing, but for what lasts: it is said where it is most of a heading's doubtful error.
    """
    if any(finding.severity == "refuse" for finding in others):
        return ()
    told = any(finding.name in ("field changed", "two sensors mixed") for finding in others)
    shown = tuple(
        _finding(error, unit)
        for error in errors
        if error.probability == 1.0 and not (told and error.cause in _MOVING_CAUSES)
    )
    lasting = (error for error in errors if error.cause == "lasting" and _leads(error))
    return (*shown, *(_say_what_lasts(error, unit) for error in lasting))


def _say_what_lasts(error: ModelError, unit: str) -> Finding:
    return Finding(
        "noise with memory",
        "note",
        f"residuals of {figure(error.size)} {unit} rms last while the sensor turns: noise with "
        "memory, which averages out, or a field that differs from place to place, which does not "
        f"and would leave the heading open by {figure(error.heading_deg)}°; turned on the spot, "
        "away from iron, it is noise",
    )


def _leads(error: ModelError) -> bool:
    """Whether a heading's error is most of all this one, and can be seen."""
    return error.heading_deg > max(SEEN_DEG, error.stated_deg)


def _matters(error: ModelError) -> bool:
    return error.heading_deg > max(DOUBTFUL_DEG, error.stated_deg)


def _finding(error: ModelError, unit: str) -> Finding:
    what, move = CAUSES[error.cause]
    matters = _matters(error)
    size = f", by {figure(error.size)} {unit} rms" if error.size else ""
    return Finding(
        error.cause,
        "check" if matters else "note",
        f"{what}{size}; it leaves the heading open by {figure(error.heading_deg)}°",
        move if matters else "",
    )
