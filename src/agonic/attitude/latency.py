"""`fit_latency`: how late the readings of a magnetometer are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast, get_args
from weakref import WeakKeyDictionary

import numpy as np

from agonic.arrays import Array
from agonic.attitude.maths import latency as kernel
from agonic.calibration.setup import LATENCY_SD_S
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.health import Finding, sentences
from agonic.health.inertial_unit import find_faults
from agonic.health.turning import explains_change, find_telling
from agonic.maths.rotations.attitude import down_b, rot_nb
from agonic.new_rows import find_fresh, interpolate_repeated
from agonic.readable import Readable
from agonic.samples import Samples

Method = Literal["attitude", "tilt", "gyro"]

STRETCH_S = {"attitude": 20.0, "gyro": 10.0}
"""How long the field, and the drift of an integrated gyro, are taken to be steady."""
SEARCHES_S = (0.3, 1.0, 3.0)
"""Latencies within ± the first are sought, and within the next where the best lies at the end, is
not known, or the gyro does not turn as the readings do: a clock may be off by seconds."""
KNOWN_S = 0.03
"""Standard error above which a latency is not known."""
FEWEST = 100
"""Readings away from ends and gaps that a latency needs at least."""

_SIGNIFICANT = 3.0  # standard errors
_CLOSE_S = LATENCY_SD_S / 2  # a standard error above it needs as many times more of them
_ANGLES = ("roll_deg", "pitch_deg", "heading_deg")
_FOUND: WeakKeyDictionary[Samples, LatencyFit | None] = WeakKeyDictionary()
_BESIDE = {"attitude": "the recorded attitude", "tilt": "roll and pitch", "gyro": "the gyro"}


@dataclass(frozen=True, kw_only=True)
class LatencyFit(Readable):
    """How late readings are beside the attitude or the gyro of the same log.

    A reading of row time t was measured at t − `latency_s`; `sd_s` is its standard error, infinite
    where nothing turned. It is `known` where the log determines it to 30 ms or a tenth of a smaller
    search, and `significant` where it is also more than three standard errors, which is worth
    undoing; where these are larger than 5 ms, by as much more. `method` is "attitude", "tilt" or
    "gyro", `n` how many readings counted; `residual_before` and `residual_after` are per axis, in
    `unit`, without and with the latency.
    """

    latency_s: float
    sd_s: float
    known: bool
    significant: bool
    method: Method
    n: int
    residual_before: float
    residual_after: float
    unit: str
    findings: tuple[Finding, ...]

    @property
    def undone_s(self) -> float:
        """What is taken off the times: the latency where it is significant, else nothing."""
        return self.latency_s if self.significant else 0.0

    @property
    def left_sd_s(self) -> float:
        """The standard deviation of the delay that is left then. A latency that is not significant
        is not zero: what was found counts with its error, but no more than `LATENCY_SD_S`, the
        delays that sensors have."""
        if self.significant:
            return self.sd_s
        found = np.hypot(self.sd_s, self.latency_s) if self.known else np.inf
        return float((LATENCY_SD_S**-2 + found**-2) ** -0.5) if found else 0.0

    @property
    def status(self) -> str:
        """The result in words."""
        return sentences(*(finding.sentence for finding in self.findings))


def fit_latency(
    samples: Samples,
    *,
    method: Literal["auto", "attitude", "tilt", "gyro"] = "auto",
    limit_s: float | None = None,
    stretch_s: float | None = None,
) -> LatencyFit:
    """The delay of raw readings beside the recorded attitude or rotation rate.

        raw(t) = Γ vec R(t − τ) + b,   R = rot_nb

    Γ (3, 9) and b (3,) are free in every stretch of time, so that neither a calibration nor the
    field need be known. Readings that only repeat the one before are left out. Of more than
    60 000 rows those are taken in which most moves.

    Parameters
    ----------
    samples : raw or calibrated readings with times, and roll, pitch and heading or rotation rate.
    method : "attitude" (roll, pitch, heading), "gyro" (integrated rotation rate, its bias
        estimated), "tilt" (roll and pitch: the delay beside the gyro less that which down by roll
        and pitch has beside it), or "auto": the first of attitude, tilt and gyro that the log has.
    limit_s : latencies within ± this are sought; rows this near to ends and gaps are left out.
        Default: 0.3, then 1 and 3 where the best lies at the end of that, is not known, or the
        gyro does not turn as the readings do.
    stretch_s : seconds over which the field is taken to be constant; default: `STRETCH_S`.

    Returns a `LatencyFit`. Raises `AgonicError` without times or anything that tells how the
    sensor turned, `CoverageError` where too few rows are left.

    Source: variable projection (Golub & Pereyra 1973; Kaufman 1975), Tukey's loss, standard error
    with the correlation of the residuals.

    Examples
    --------
    >>> from agonic.simulation import delayed, simulate
    >>> late = delayed(0.020)(simulate("hand").samples)
    >>> fit = fit_latency(late)
    >>> round(1000 * fit.latency_s), fit.significant
    (20, True)
    """
    check_choice("method", method, ("auto", *get_args(Method)))
    if limit_s is not None and not limit_s > 0:
        raise AgonicError(f"limit_s is {limit_s}; the search needs it above zero")
    chosen, samples = _method(samples, method), interpolate_repeated(find_telling(samples))
    for fault in () if chosen == "attitude" else find_faults(samples):
        if fault.column == "rotation_rate" and fault.finding.severity == "refuse":
            raise AgonicError(fault.finding.sentence)  # beside it any delay would fit as well
    first, *wider = SEARCHES_S if limit_s is None else (limit_s,)
    found, limit = _estimate(samples, chosen, first, stretch_s), first
    turns_alike = chosen == "attitude" or explains_change(samples)
    for beyond in wider:
        if _is_known(found, limit) and turns_alike:
            break
        try:
            farther = _estimate(samples, chosen, beyond, stretch_s)
        except CoverageError:  # too few rows so far from ends and gaps
            break
        if abs(found.latency_s) >= limit or farther.sd_s < found.sd_s:
            found, limit = farther, beyond
    at_limit = abs(found.latency_s) >= limit
    known = _is_known(found, limit)
    least = _SIGNIFICANT * found.sd_s * max(found.sd_s / _CLOSE_S, 1.0)
    significant = known and abs(found.latency_s) > least
    return LatencyFit(
        latency_s=found.latency_s,
        sd_s=found.sd_s,
        known=known,
        significant=significant,
        method=chosen,
        n=found.n,
        residual_before=found.before,
        residual_after=found.after,
        unit=samples.unit,
        findings=(_finding(found, chosen, known, significant, at_limit),),
    )


def _is_known(found: kernel.Estimate, limit_s: float) -> bool:
    """Whether a latency lies inside of its search, and to a small part of it."""
    return found.sd_s < min(limit_s / 10, KNOWN_S) and abs(found.latency_s) < limit_s


def find_latency(samples: Samples) -> LatencyFit | None:
    """The delay of the readings, or `None` where nothing in the log could tell it. Several fits to
    one log ask for it: as long as the samples live it is found once."""
    if samples not in _FOUND:
        try:
            _FOUND[samples] = fit_latency(samples)
        except AgonicError:
            _FOUND[samples] = None
    return _FOUND[samples]


def share_latency(samples: Samples, part: Samples) -> None:
    """Take what is known of the delay of samples for that of a part of them."""
    if samples in _FOUND:
        _FOUND[part] = _FOUND[samples]


def _estimate(
    samples: Samples, chosen: Method, limit_s: float, stretch_s: float | None
) -> kernel.Estimate:
    """The latency beside what tells the attitude; of a tilt that of both beside the gyro."""
    time = samples.time
    assert time is not None
    beside = "attitude" if chosen == "attitude" else "gyro"
    stretch = STRETCH_S[beside] if stretch_s is None else stretch_s
    record = _record(samples, samples.field, limit_s, stretch)
    if beside == "attitude":
        angles = [cast(Array, getattr(samples, name)) for name in _ANGLES]
        return kernel.estimate_attitude(record, time, rot_nb(*angles), limit_s)
    rate = samples.rotation_rate
    assert rate is not None, "_method has made sure of it"
    found = kernel.estimate_gyro(record, time, rate, limit_s)
    if chosen == "gyro" or not _is_known(found, limit_s):
        return found
    down = down_b(cast(Array, samples.roll_deg), cast(Array, samples.pitch_deg))
    try:
        tilt = kernel.estimate_gyro(_record(samples, down, limit_s, stretch), time, rate, limit_s)
    except CoverageError:  # level throughout
        tilt = None
    if tilt is None or tilt.sd_s > LATENCY_SD_S:
        return found._replace(sd_s=float(np.hypot(found.sd_s, LATENCY_SD_S)))
    sd = float(np.hypot(found.sd_s, tilt.sd_s))
    return found._replace(latency_s=found.latency_s - tilt.latency_s, sd_s=sd)


def _record(samples: Samples, readings: Array, limit_s: float, stretch_s: float) -> kernel.Record:
    """The rows with readings (n, 3) of their own that take part."""
    assert samples.time is not None
    if not np.ptp(readings, axis=0).any():
        raise CoverageError(
            "the readings never change, so their delay is not determined",
            turns="check the sensor and its wiring",
        )
    own = find_fresh(readings)
    record = kernel.record(samples.time[own], readings[own], limit_s, stretch_s)
    if len(record.time) < FEWEST:
        raise CoverageError(
            f"only {len(record.time)} readings lie {limit_s:g} s or more from ends and gaps; a "
            f"latency needs {FEWEST}",
            turns="record for half a minute while turning back and forth",
        )
    return record


def _method(samples: Samples, method: str) -> Method:
    """The method asked for, or the one that the columns allow; or what is missing."""
    if samples.time is None or len(samples) < 2:
        raise AgonicError("a latency needs the times of the readings; this log has none")
    there = [name for name in _ANGLES if getattr(samples, name) is not None]
    gyro = samples.rotation_rate is not None
    allowed: dict[Method, bool] = {
        "attitude": len(there) == len(_ANGLES),
        "tilt": gyro and {"roll_deg", "pitch_deg"} <= set(there),
        "gyro": gyro,
    }
    for name, possible in allowed.items():
        if possible and method in ("auto", name):
            return name
    needed = {
        "attitude": "roll, pitch and heading",
        "tilt": "roll, pitch and rotation rate",
        "gyro": "rotation rate",
        "auto": "roll, pitch and heading, or of rotation rate",
    }
    raise AgonicError(
        f"{samples.name} has no columns of {needed[method]}; without them it is not known when "
        "the sensor turned"
    )


def _finding(
    found: kernel.Estimate, method: str, known: bool, significant: bool, at_limit: bool
) -> Finding:
    """What the latency means, and the move that helps."""
    beside = _BESIDE[method]
    size = f"{abs(1e3 * found.latency_s):.1f} ± {max(1e3 * found.sd_s, 0.05):.1f} ms"
    if not known:
        why = "the best fit lies at the end of the search" if at_limit else "it turned too little"
        return Finding(
            "latency unknown",
            "note",
            f"the delay of the readings relative to {beside} is not determined: {why}",
            "turn the sensor quickly back and forth for half a minute",
        )
    if not significant:
        return Finding("latency", "note", f"no delay relative to {beside} is seen ({size})")
    late = "late" if found.latency_s > 0 else "early"
    return Finding(
        "latency",
        "check",
        f"the readings are {size} {late} relative to {beside}",
        "take it out before calibrating, and where the heading is computed",
    )
