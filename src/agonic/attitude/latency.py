"""`fit_latency`: how late the readings of a magnetometer are, and `undelayed` to undo it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Slerp

from agonic.arrays import Array
from agonic.attitude.maths import latency as kernel
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.health import Finding, figure, sentences
from agonic.maths.rotations.attitude import angles_deg, rot_nb, yaw_pitch_roll
from agonic.readable import Readable
from agonic.samples import Samples

STRETCH_S = {"attitude": 20.0, "gyro": 10.0}
"""How long the field, and the drift of an integrated gyro, are taken to be steady."""

FEWEST = 100
"""Readings away from ends and gaps that a latency needs at least."""

_SIGNIFICANT = 3.0  # standard errors
_ANGLES = ("roll_deg", "pitch_deg", "heading_deg")
_READ = ("field", "second")  # two magnetometers on one bus are late together


@dataclass(frozen=True, kw_only=True)
class LatencyFit(Readable):
    """How late readings are beside the attitude or the gyro of the same log.

    A reading of row time t was measured at t − `latency_s`; `sd_s` is its standard error, infinite
    where nothing turned. It is `known` where the log determines it to a tenth of the search, and
    `significant` where it is also more than three standard errors, which is worth undoing.
    `method` is "attitude" or "gyro", `n` how many readings counted; `residual_before` and
    `residual_after` are per axis, in `unit`, without and with the latency.
    """

    latency_s: float
    sd_s: float
    known: bool
    significant: bool
    method: Literal["attitude", "gyro"]
    n: int
    residual_before: float
    residual_after: float
    unit: str
    findings: tuple[Finding, ...]

    @property
    def status(self) -> str:
        """The result in words."""
        return sentences(*(finding.sentence for finding in self.findings))


def fit_latency(
    samples: Samples,
    *,
    method: Literal["auto", "attitude", "gyro"] = "auto",
    limit_s: float = 0.3,
    stretch_s: float | None = None,
) -> LatencyFit:
    """The delay of raw readings beside the recorded attitude or rotation rate.

        raw(t) = Γ vec R(t − τ) + b,   R = rot_nb

    Γ (3, 9) and b (3,) are free in every stretch of time, so that neither a calibration nor the
    field need be known.

    Parameters
    ----------
    samples : raw or calibrated readings with times, and roll, pitch and heading or rotation rate.
    method : "attitude" (roll, pitch, heading), "gyro" (integrated rotation rate, its bias
        estimated), or "auto": the attitude where the log has it.
    limit_s : latencies within ± this are sought; rows this near to ends and gaps are left out.
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
    check_choice("method", method, ("auto", "attitude", "gyro"))
    if not limit_s > 0:
        raise AgonicError(f"limit_s is {limit_s}; the search needs it above zero")
    time, chosen = _time(samples), _method(samples, method)
    stretch = STRETCH_S[chosen] if stretch_s is None else stretch_s
    record = kernel.record(time, samples.field, limit_s, stretch)
    if len(record.time) < FEWEST:
        raise CoverageError(
            f"only {len(record.time)} readings lie {limit_s:g} s or more from ends and gaps; a "
            f"latency needs {FEWEST}",
            turns="record for half a minute while turning to and fro",
        )
    if not np.ptp(record.raw, axis=0).any():
        raise CoverageError(
            "the readings never change, so nothing tells how late they are",
            turns="check the sensor and its wiring",
        )
    if chosen == "attitude":
        found = kernel.estimate_attitude(record, time, _attitude(samples), limit_s)
    else:
        rate = samples.rotation_rate
        assert rate is not None, "_method has made sure of it"
        found = kernel.estimate_gyro(record, time, rate, limit_s)
    at_limit = abs(found.latency_s) >= limit_s
    known = found.sd_s < limit_s / 10 and not at_limit
    significant = known and abs(found.latency_s) > _SIGNIFICANT * found.sd_s
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


def undelayed(samples: Samples, latency_s: float) -> Samples:
    """The samples as if each reading had been recorded when it was made.

    Each row keeps its reading (and that of a second magnetometer, which is taken to be as late);
    its time becomes t − `latency_s`, and all other columns are interpolated to that moment:
    attitudes along the shortest turn, stations by the nearest row. Rows whose moment nothing was
    recorded about (ends, gaps) are left out and counted in `rejected`. Raises `AgonicError`
    without times, `CoverageError` where no row is left.

    >>> s = Samples(time=[0, 1, 2], field=np.eye(3), heading_deg=[340, 350, 20])
    >>> on_time = undelayed(s, 0.5)
    >>> on_time.time.tolist(), on_time.heading_deg.round(9).tolist()
    ([0.5, 1.5], [345.0, 5.0])
    >>> dict(on_time.rejected)
    {'nothing recorded at the moment of the reading': 1}
    """
    time = _time(samples)
    moments = time - latency_s
    kept = np.zeros(len(time), dtype=bool)
    rounding = 1e-9 * max(abs(latency_s), 1.0)
    for run in kernel.runs(time):
        kept |= (moments >= time[run[0]] - rounding) & (moments <= time[run[-1]] + rounding)
    if not kept.any():
        raise CoverageError(
            f"no reading is left when {figure(1e3 * latency_s)} ms are taken off its time"
        )
    at = np.clip(moments[kept], time[0], time[-1])
    columns = {
        name: _at(at, time, column)
        for name, column in samples.columns().items()
        if name not in ("time", *_READ, "station", *_ANGLES)
    }
    if samples.station is not None:
        middles = (time[1:] + time[:-1]) / 2
        columns["station"] = samples.station[np.searchsorted(middles, at)]
    left_out = {"nothing recorded at the moment of the reading": int((~kept).sum())}
    was = dict(samples.rejected)
    return samples.with_columns(
        time=moments[kept],
        **{name: c[kept] for name, c in samples.columns().items() if name in _READ},
        **columns,
        **_turned(samples, time, at),
        rejected=was | ({} if kept.all() else left_out),
        notes=(*samples.notes, f"a latency of {1e3 * latency_s:.2f} ms was taken off the times"),
    )


def _time(samples: Samples) -> Array:
    if samples.time is None or len(samples) < 2:
        raise AgonicError("a latency needs the times of the readings; this log has none")
    return samples.time


def _method(samples: Samples, method: str) -> Literal["attitude", "gyro"]:
    """The method asked for, or the one that the columns allow; or what is missing."""
    attitude = all(getattr(samples, name) is not None for name in _ANGLES)
    if attitude and method != "gyro":
        return "attitude"
    if samples.rotation_rate is not None and method != "attitude":
        return "gyro"
    needed = {
        "attitude": "roll, pitch and heading",
        "gyro": "rotation rate",
        "auto": "roll, pitch and heading, or of rotation rate",
    }
    raise AgonicError(
        f"{samples.name} has no columns of {needed[method]}; without them nothing tells when the "
        "sensor turned"
    )


def _attitude(samples: Samples) -> Array:
    """rot_nb (n, 3, 3); angles that were not recorded count as zero."""
    roll, pitch, heading = _angles(samples)
    return rot_nb(roll, pitch, heading)


def _angles(samples: Samples) -> tuple[Array, Array, Array]:
    roll, pitch, heading = (getattr(samples, name) for name in _ANGLES)
    none = np.zeros(len(samples))
    return (
        none if roll is None else roll,
        none if pitch is None else pitch,
        none if heading is None else heading,
    )


def _turned(samples: Samples, time: Array, at: Array) -> dict[str, Array]:
    """The recorded angles at other moments, along the shortest turn from row to row."""
    if all(getattr(samples, name) is None for name in _ANGLES):
        return {}
    roll, pitch, heading = _angles(samples)
    turned = Slerp(time, yaw_pitch_roll(heading, pitch, roll))(at)
    angles = zip(_ANGLES, angles_deg(turned.as_matrix()), strict=True)
    return {name: angle for name, angle in angles if getattr(samples, name) is not None}


def _at(at: Array, time: Array, column: Array) -> Array:
    """A column (n,) or (n, 3) interpolated linearly."""
    if column.ndim == 1:
        return np.interp(at, time, column)
    return np.stack([np.interp(at, time, axis) for axis in column.T], axis=1)


def _finding(
    found: kernel.Estimate, method: str, known: bool, significant: bool, at_limit: bool
) -> Finding:
    """What the latency means, and the move that helps."""
    beside = "the recorded attitude" if method == "attitude" else "the gyro"
    size = f"{abs(1e3 * found.latency_s):.1f} ± {max(1e3 * found.sd_s, 0.05):.1f} ms"
    if not known:
        why = "the best fit lies at the end of the search" if at_limit else "it turned too little"
        return Finding(
            "latency unknown",
            "note",
            f"how late the readings are beside {beside} is not determined: {why}",
            "turn the sensor to and fro, briskly, for half a minute",
        )
    if not significant:
        return Finding("latency", "note", f"no latency of readings beside {beside} shows ({size})")
    late = "late" if found.latency_s > 0 else "early"
    return Finding(
        "latency",
        "check",
        f"the readings are {size} {late} beside {beside}",
        "take it out before calibrating, and where the heading is computed",
    )
