"""The delay of a magnetometer undone, and what is left of it carried on in its calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.latency import LatencyFit, find_latency
from agonic.attitude.maths.latency import runs
from agonic.calibration.base import Calibration
from agonic.errors import AgonicError, CoverageError
from agonic.fit import Fit
from agonic.health import Finding, figure
from agonic.health.evidence import HEADING_DOUBTFUL_DEG
from agonic.maths.one_pass import interpolate
from agonic.maths.rotations.attitude import angles_deg, yaw_pitch_roll
from agonic.model.posterior import LEAST_SHARE
from agonic.model.verdict import check_coverage
from agonic.reference import Reference
from agonic.samples import Samples

RATE_S = 0.2
"""Over which recorded attitudes tell a rate: from row to row their noise would."""
_READ = ("field", "second")  # two magnetometers on one bus are late together
_ANGLES = ("roll_deg", "pitch_deg", "heading_deg")
_FELT = ("acceleration", "rotation_rate")
_Found = TypeVar("_Found", bound=Fit)
_Known = TypeVar("_Known", Reference, Reference | None)


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
    time = samples.time
    if time is None or len(samples) < 2:
        raise AgonicError("a latency needs the times of the readings; this log has none")
    moments = time - latency_s
    kept = np.zeros(len(time), dtype=bool)
    rounding = 1e-9 * max(abs(latency_s), 1.0)
    for run in runs(time):
        kept |= (moments >= time[run[0]] - rounding) & (moments <= time[run[-1]] + rounding)
    if not kept.any():
        raise CoverageError(
            f"no reading is left when {figure(1e3 * latency_s)} ms are taken off its time"
        )
    at = np.clip(moments[kept], time[0], time[-1])
    columns = {
        name: interpolate(at, time, column)
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
        **_turn_angles(samples, time, at),
        rejected=was | ({} if kept.all() else left_out),
        notes=(*samples.notes, f"a latency of {1e3 * latency_s:.2f} ms was taken off the times"),
    )


def find_and_undo(samples: Samples, reference: _Known) -> tuple[Samples, _Known, LatencyFit | None]:
    """The samples at the moments of their readings, the reference of the rows that are left, and
    the delay; it is undone where it is significant, and `None` where nothing could tell it."""
    latency = find_latency(samples)
    if latency is None or not latency.significant:
        return samples, reference, latency
    on_time = undelayed(samples, latency.latency_s)
    assert samples.time is not None
    assert on_time.time is not None
    if reference is not None:
        middles = (samples.time[1:] + samples.time[:-1]) / 2
        reference = reference.select(np.searchsorted(middles, on_time.time + latency.latency_s))
    return on_time, reference, latency


def remove_delay(calibration: Calibration, samples: Samples) -> Samples:
    """The samples, each at the moment it was measured by the latency that the calibration knows."""
    latency_s = getattr(calibration, "latency_s", 0.0)
    if not latency_s or samples.time is None or len(samples) < 2:
        return samples
    return undelayed(samples, latency_s)


def bring_forward(samples: Samples, late_s: float) -> tuple[Samples, Mask]:
    """The samples beside the attitude of their own moments, where that was recorded `late_s` later;
    and the rows (n,) of whose moment no attitude was recorded (ends, gaps). Nothing is recorded
    before it was measured: readings that seem early beside the attitude show that the attitude, the
    accelerometer or the gyro is late."""
    time = samples.time
    if time is None:
        raise AgonicError("a latency needs the times of the readings; this log has none")
    unknown = np.zeros(len(time), dtype=bool)
    for run in runs(time):
        unknown[run] = time[run] + late_s > time[run[-1]] + 1e-9
    at = np.clip(time + late_s, time[0], time[-1])
    felt = {
        name: interpolate(at, time, c) for name, c in samples.columns().items() if name in _FELT
    }
    return samples.with_columns(**felt, **_turn_angles(samples, time, at)), unknown


def advance(field: Array, samples: Samples, calibration: Calibration) -> Array:
    """The field (n, 3) of samples at the moments of their rows, from readings that came late."""
    latency_s = getattr(calibration, "latency_s", 0.0)
    if not latency_s or samples.time is None:
        return field
    return interpolate(samples.time + latency_s, samples.time, field)


def keep_latency(fit: _Found, samples: Samples, latency: LatencyFit | None) -> _Found:
    """The fit with the delay in its calibration, and its error in that of the heading. While the
    vehicle turns at ω, an error δτ of the delay turns the heading by about ω δτ. Its rms at the
    rates of this log joins the standard error of the heading."""
    if latency is None:
        return fit
    sd = latency.left_sd_s
    calibration = replace(fit.calibration, latency_s=latency.undone_s, latency_sd_s=sd)
    turned = float(np.degrees(measure_rate(samples) * sd))
    coverage, own = fit.coverage, fit.coverage.heading_sd_deg
    coverage = replace(coverage, heading_sd_deg=float(np.hypot(own, turned)))
    accuracy = fit.accuracy and replace(fit.accuracy, delay_deg=turned)
    # the finding on the directions has the one standard error that is stated everywhere
    told, whole = check_coverage(fit.coverage), check_coverage(coverage)
    findings = fit.findings
    if told is not None and whole is not None and whole.what != told.what:
        what = f"{whole.what}, the error of the delay included"
        findings = tuple(replace(f, what=what) if f.what == told.what else f for f in findings)
    made = {**fit.shares, "delay": turned} if turned**2 > LEAST_SHARE * own**2 else fit.shares
    kept = replace(fit, calibration=calibration, coverage=coverage, accuracy=accuracy)
    kept = replace(kept, findings=findings, shares=dict(sorted(made.items(), key=lambda s: -s[1])))
    if turned < HEADING_DOUBTFUL_DEG:
        return kept
    rate = figure(float(np.degrees(measure_rate(samples))))
    return kept.with_findings(
        Finding(
            "delay",
            "check",
            f"the delay of the readings is known to ± {figure(1e3 * sd)} ms only: while turning as "
            f"in this log, at {rate}°/s, that is {figure(turned)}° of heading",
            "log the magnetometer beside gyro or attitude at 50 rows a second or more, and turn "
            "back and forth; or turn more slowly where the heading counts",
        )
    )


def measure_rate(samples: Samples) -> float:
    """How fast the sensor turned, rms, rad/s: by the gyro, else by the recorded attitude; 0 where
    neither tells."""
    if samples.rotation_rate is not None:
        return float(np.sqrt((samples.rotation_rate**2).sum(axis=1).mean()))
    roll, pitch, heading = (getattr(samples, name) for name in _ANGLES)
    if samples.time is None or roll is None or pitch is None or heading is None:
        return 0.0
    turns, squares, count = yaw_pitch_roll(heading, pitch, roll), 0.0, 0
    for run in runs(samples.time):
        own = samples.time[run]
        later = np.searchsorted(own, own + RATE_S)
        inside = later < len(run)
        first, last = run[inside], run[later[inside]]
        if len(first):
            rate = (turns[first].inv() * turns[last]).magnitude()
            rate = rate / (samples.time[last] - samples.time[first])
            squares, count = squares + float((rate**2).sum()), count + len(rate)
    return float(np.sqrt(squares / max(count, 1)))


def _turn_angles(samples: Samples, time: Array, at: Array) -> dict[str, Array]:
    """The recorded angles at other moments, along the shortest turn from row to row."""
    from scipy.spatial.transform import Slerp  # slow to load

    given = [getattr(samples, name) for name in _ANGLES]
    if all(angle is None for angle in given):
        return {}
    none = np.zeros(len(samples))
    roll, pitch, heading = (none if angle is None else angle for angle in given)
    turned = Slerp(time, yaw_pitch_roll(heading, pitch, roll))(at)
    angles = zip(_ANGLES, angles_deg(turned.as_matrix()), strict=True)
    return {name: angle for name, angle in angles if getattr(samples, name) is not None}
