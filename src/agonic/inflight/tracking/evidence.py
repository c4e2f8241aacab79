"""What a followed calibration has to say of itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agonic.calibration.tracking import TrackerState
from agonic.health import Finding, figure
from agonic.inflight.tracking.opening import compute_nonlinearity

REFUSED = 0.1
"""Share of refused readings that is to be looked at."""
INCONSISTENT = (0.5, 1.5)
"""Innovations over their stated sd, rms: outside of this the noise model is wrong."""
UNSEEN = 0.05
"""Turn between two readings, rad, that their rates leave open, from which it is to be looked at."""
CORRELATED = 1.5
"""Standard errors over those of independent errors from which they are to be looked at."""

_ENOUGH = 1000  # readings after which the size of innovations is known


def list_findings(state: TrackerState) -> Iterator[Finding]:
    """What the user should know about a state."""
    if state.jumps:
        last, unit = state.jumps[-3:], state.base.unit_in
        sizes = ", ".join(
            f"at {jump.time:.1f} s by {figure(float((jump.shift**2).sum() ** 0.5))} {unit}"
            for jump in last
        )
        more = f"; the last {len(last)} of {len(state.jumps)} are given"
        yield Finding(
            "bias jumped",
            "check",
            f"the bias jumped {sizes}{more if len(state.jumps) > 3 else ''}",
            "look for what was switched or deployed then; earlier readings are not used any more",
        )
    if state.gyro_unused:
        yield Finding(
            "gyro left aside",
            "note",
            f"{state.gyro_unused}, so the bias is followed by the magnitude alone",
            "name units and axes of gyro and magnetometer alike, or ask for the gyro",
        )
    bent = 0.0  # the standard error of the bias, which is a line's, says little where it is large
    if state.settled and state.turn is None:
        bent = compute_nonlinearity(state.estimate, state.magnitude or 0.0)
    if not state.settled or bent > state.noise:
        yield Finding(
            "not settled",
            "check",
            f"the bias is not determined yet after {state.n} readings",
            "pass on more readings, in more directions of the field",
        )
    yield from _judge_readings(state)
    yield from _judge_errors(state)


def _judge_readings(state: TrackerState) -> Iterator[Finding]:
    """Readings that did not fit, and turns between them that their rates leave open."""
    if state.refused > REFUSED * state.n > 0:
        yield Finding(
            "readings refused",
            "check",
            f"{100 * state.refused / state.n:.0f} % of the readings did not fit their "
            "prediction and were not used",
            "look for what disturbs, or give a larger noise",
        )
    if state.turn is not None and state.turn.unseen_turn > UNSEEN:
        yield Finding(
            "turn between readings",
            "check",
            f"how far the sensor turned between two readings is known to "
            f"{np.degrees(state.turn.unseen_turn):.0f}° only, by the rates at both; "
            "the bias allows for it, but the delay and with it the field may be further off",
            "record readings and rates more often, or turn more slowly",
        )


def _judge_errors(state: TrackerState) -> Iterator[Finding]:
    """Prediction errors that are correlated, or not as large as stated."""
    factor, growing = state.estimate.inflation
    if state.settled and factor.max() != 1.0:
        larger = figure(float(factor[state.estimate.coefficients[:3]].max()))
        yield Finding(
            "correlated errors",
            "check" if growing or factor.max() > CORRELATED else "note",
            "prediction errors are correlated over time: standard errors of the bias are "
            f"{larger} times those of independent errors, and are stated with it"
            + (", and errors may last for longer than was seen" if growing else ""),
            "give the error of the reference and its time (external_sd, external_time_s), or "
            "follow a bias that moves (walk)",
        )
    low, high = INCONSISTENT
    if state.n >= _ENOUGH and not low < state.consistency < high:
        yield Finding(
            "innovations",
            "check",
            f"prediction errors are {figure(state.consistency)} times as large as stated",
            "adapt noise, walk or external field; the stated band is wrong by about the same "
            "factor",
        )
