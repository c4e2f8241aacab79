"""The fit beside accelerometer and gyro of a live session: made by the choice of `calibrate`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from agonic.attitude.known_heading import compute_mounted_heading
from agonic.calibration.affine import Affine
from agonic.coverage import Coverage
from agonic.errors import AgonicError
from agonic.fit import Fit
from agonic.health import Finding
from agonic.inertial.fit import InertialFit
from agonic.inertial.plan import Drive, predict_heading_sd
from agonic.live.level import Plan, choose_step, see_level
from agonic.live.state import LiveParams
from agonic.live.track import Track
from agonic.recording.advice import TURNING
from agonic.recording.calibrated import calibrate_as_named
from agonic.recording.choice.choose import choose
from agonic.samples import Samples

MIN_ROWS = 100
"""Rows of a track without which no fit is made."""


class Aided(NamedTuple):
    """What the choice among the fits came to.

    `method` is the word of the `fit`; `calibration` and `coverage` are its own, with the heading's
    standard error in the sensor's own axes, as `calibrate` judges it; `vehicle_sd_deg` is that with
    how the sensor sits in the vehicle. `objections` are what `calibrate` would say against the fit,
    and `plan` is what to drive next, where the vehicle stays level.
    """

    fit: Fit
    method: str
    calibration: Affine
    coverage: Coverage
    vehicle_sd_deg: float
    objections: tuple[Finding, ...]
    plan: Plan | None = None

    @property
    def chosen(self) -> bool:
        """Whether it is a fit beside the attitude, and not that by the magnitude alone."""
        return self.method != "ellipsoid"


def get_samples(params: LiveParams, track: Track) -> Samples:
    """The rows of a track as samples."""
    unit = "raw" if params.unit == "raw" else "nT"
    return track.make_samples(params.name, unit, params.device_id)


def fit_aided(params: LiveParams, track: Track | None) -> Aided | None:
    """The fit that `calibrate` would choose for a track; `None` where there is none yet, or the
    field of the place is not known."""
    reference = params.reference
    if track is None or len(track.slots) < MIN_ROWS or params.field_n is None:
        return None
    samples = get_samples(params, track)
    try:
        choice = choose(samples, reference, "auto", {"inclination_deg": params.inclination_deg})
    except AgonicError:
        return None
    calibration, coverage = choice.fit.calibration, choice.fit.coverage
    own = compute_mounted_heading(calibration, coverage).own_sd_deg
    enough = own <= params.target_deg and choice.method != "ellipsoid"
    return Aided(
        choice.fit,
        choice.method,
        calibration,
        replace(coverage, heading_sd_deg=own),
        coverage.heading_sd_deg,
        find_objections(params, samples) if enough else _list_refusals(choice.fit, track),
    )


def plan_drive(params: LiveParams, track: Track | None, aided: Aided) -> Plan | None:
    """What to drive next, where the vehicle stays level and the fit can tell; it takes seconds."""
    own_deg, reference, fit = aided.coverage.heading_sd_deg, params.reference, aided.fit
    level = see_level(track, aided.calibration)
    if own_deg <= params.target_deg or level is None or not isinstance(fit, InertialFit):
        return None
    assert track is not None
    assert reference is not None
    past = get_samples(params, track.coarsen())

    def predict(drive: Drive) -> float:
        return min(predict_heading_sd(fit, past, reference, drive, level.down), own_deg)

    return choose_step(level, own_deg, predict)


def _list_refusals(fit: Fit, track: Track) -> tuple[Finding, ...]:
    """What is wrong, whatever is driven further: axes, units and signs of the sensors."""
    if track.duration_s < 30.0:
        return ()
    refused = (finding for finding in fit.findings if finding.severity == "refuse")
    return tuple(finding for finding in refused if finding.name not in TURNING)


def find_objections(params: LiveParams, samples: Samples, **named: Any) -> tuple[Finding, ...]:
    """What `agonic calibrate` would object to; `named` what it is told besides, as the `kind`."""
    named["inclination_deg"] = params.inclination_deg
    try:
        made = calibrate_as_named(samples, params.reference, **named)
    except AgonicError as error:
        return (Finding("calibration", "check", str(error), "go on turning"),)
    return made.objections
