"""What is said of a sensor that was not the same at all stations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from agonic.health import Finding, figure
from agonic.thermal.campaign.description import Told
from agonic.thermal.fit.problem import ChamberReadings
from agonic.thermal.fit.solve import Solution
from agonic.thermal.maths.fault_terms import (
    AGEING,
    ODD,
    SETTLING,
    STEP,
    THERMOMETER,
    UNSETTLED,
    WALK,
)
from agonic.thermal.maths.gaussian_process import STEADY
from agonic.thermal.maths.station_faults import Fault

_HOUR = 3600.0
_DIFFERENT = 10.0
"""Twice the logarithm of the likelihood by which stations must differ: by chance once in 1000."""


def judge_faults(result: Solution, readings: ChamberReadings) -> list[Finding]:
    """Each fault with its place, its time, its size, and what to do."""
    left_out = [
        Finding(
            "odd station",
            "check",
            f"{_name_station(place, readings)} does not fit the others at all and was left out",
            "see whether another sensor was read there, or its axes exchanged, and record it again",
        )
        for place in result.faults.left_out
    ]
    found = [_judge(fault, readings) for fault in result.faults.found]
    return [*found, *left_out, *_find_differing(result, readings)]


def _find_differing(result: Solution, readings: ChamberReadings) -> list[Finding]:
    """Stations that differ, where the magnitude alone cannot tell why.

    Nine numbers and a step have as many unknowns as there are twelve stations.
    """
    slow = result.estimate.slow
    if result.problem.turns_known or slow.kind != STEADY or slow.gain < _DIFFERENT:
        return []
    amount = figure(slow.sd * (readings.scale.magnitude or readings.scale.size))
    return [
        Finding(
            "stations differ",
            "check",
            f"the field seems to differ by {amount} nT from station to station; by the magnitude "
            "alone a sensor that was knocked looks the same, and most of it does not show: the "
            "standard error contains what that may be",
            "describe how the stations stood (stations='known'), or record the first one again at "
            "the end",
        )
    ]


_HOLD_LONGER = (
    "hold the temperature longer before recording, and see that the thermometer touches the "
    "sensor; record the station again or leave it out"
)
TOLD: Mapping[str, Told] = {
    ODD: Told(
        "odd station",
        "at {station} the bias is {amount} away from that of the other stations; the "
        "calibration is corrected for it",
        "see whether iron, a cable or another sensor was there, and record it again or leave it "
        "out",
    ),
    STEP: Told(
        "bias step",
        "the bias changed at once by {amount} {moment}; the calibration lies between both, which "
        "the standard error contains",
        "see what moved or magnetised the sensor then, and calibrate the parts by themselves",
    ),
    AGEING: Told(
        "ageing",
        "the bias changed steadily, by {amount} from the first reading to the last, which was "
        "taken for changes of the field; the standard error contains it",
        "let the sensor age at its highest temperature first, and calibrate again",
    ),
    SETTLING: Told(
        "settling",
        "the bias began {amount} off and settled over {hours}; the calibration is corrected for it",
        "let the sensor settle before the first station, or leave the first stations out",
    ),
    WALK: Told(
        "stations differ",
        "the bias, or the field, seems to differ from station to station, by {amount} in all: with "
        "turns known no better a sensor that was knocked looks like a field that changed, and most "
        "of it does not show; the standard error contains what that may be",
        "record the first station again at the end, and keep iron away from the chamber",
    ),
    THERMOMETER: Told(
        "odd temperature",
        "at {station} the sensor was {away} °C away from what its thermometer said; the "
        "calibration is corrected for it",
        _HOLD_LONGER,
    ),
    UNSETTLED: Told(
        "odd temperature",
        "at {station} the sensor was at first {away} °C away from what its thermometer said; "
        "the calibration is corrected for it",
        _HOLD_LONGER,
    ),
}
"""What is said of each kind of fault."""


def _judge(fault: Fault, readings: ChamberReadings) -> Finding:
    scale, candidate = readings.scale, fault.candidate
    size = float(np.linalg.norm(fault.size))
    told = TOLD[candidate.kind]
    message = told.message.format(
        station=_name_station(candidate.station, readings),
        amount=f"{figure(size * scale.size)} {readings.unit}",
        away=figure(size * scale.half_C),
        moment=_tell_moment(fault, readings) if candidate.kind == STEP else "",
        hours=_tell_hours(candidate.time),
    )
    return Finding(told.name, "check", message, told.action)


def _name_station(place: int, readings: ChamberReadings) -> str:
    """A station by its number, and when it was recorded, in hours since the first reading."""
    name, time = f"station {readings.numbers[place]}", readings.cells.time
    if not np.isfinite(time).all():
        return name
    own = time[readings.station == place] - time.min()
    return f"{name} ({own.min() / _HOUR:.1f} to {own.max() / _HOUR:.1f} h)"


def _tell_moment(fault: Fault, readings: ChamberReadings) -> str:
    """Between or in which stations, and when."""
    time, place = readings.cells.time, readings.station
    before, at = time < fault.candidate.time, fault.candidate.station
    after = f"{_tell_hours(fault.candidate.time - float(time.min()))} after the first reading"
    if (before & (place == at)).any():
        return f"in station {readings.numbers[at]}, about {after}"
    last = int(place[before][np.argmax(time[before])])
    return f"between stations {readings.numbers[last]} and {readings.numbers[at]}, {after}"


def _tell_hours(seconds: float) -> str:
    return f"{seconds / _HOUR:.1f} h"
