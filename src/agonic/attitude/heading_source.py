"""Headings of another origin than the magnetometer: the course over ground, and whether one that is
said to be such follows the magnetometer, or the gyro contradicts it."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.attitude.fit import CHANNELS, fit_channels_alone
from agonic.attitude.problem import Settings
from agonic.calibration.affine import Affine
from agonic.errors import AgonicError, LogError
from agonic.health import Finding, figure
from agonic.maths.earth.geodesy import SEMI_MAJOR_M
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.one_pass import median
from agonic.maths.rotations import tilt as kernel
from agonic.maths.rotations.angles import wrap_deg
from agonic.reference import Reference
from agonic.samples import Samples

WINDOW_S = 1.0
"""Half of the time over which a velocity is taken."""
SPEED_SD_M_S = 0.2
SLIP_DEG = 2.0
"""How far a car or a rover moves beside its nose, in turns and on slopes."""
CLEARLY = 5.0
UNKNOWN_SD_DEG = 180.0


def with_course(samples: Samples, *, speed_sd_m_s: float = SPEED_SD_M_S) -> Samples:
    """The samples with the course over ground as their heading, and its standard deviation.

        course = atan2(v_east, v_north),   sd² = (sd of a speed / speed)² + slip²

    where the speed is five times its own sd and more; elsewhere the sd is 180°. For a car or a
    rover that drives forwards, never for a boat, a plane or a copter, which drift aside.

    Parameters: samples with times and positions; `speed_sd_m_s` of a velocity over two seconds.
    Raises `LogError` without times or positions, or where nothing moved.

    >>> time = np.arange(0.0, 20.0, 0.5)
    >>> east = Samples(field=np.ones((40, 3)), time=time, latitude_deg=np.zeros(40),
    ...                longitude_deg=4e-5 * time, unit="nT")
    >>> float(with_course(east).heading_deg[20].round(1))
    90.0
    """
    time, latitude, longitude = samples.time, samples.latitude_deg, samples.longitude_deg
    if time is None or latitude is None or longitude is None:
        raise LogError(
            f"the course of {samples.name} needs times and positions (latitude_deg, longitude_deg)"
        )
    north = np.radians(latitude) * SEMI_MAJOR_M
    east = np.unwrap(np.radians(longitude)) * SEMI_MAJOR_M * np.cos(np.radians(latitude))
    before, after = time - WINDOW_S, time + WINDOW_S  # over a window about each row
    span = np.maximum(np.minimum(after, time[-1]) - np.maximum(before, time[0]), 1e-3)
    velocity = [
        (np.interp(after, time, along) - np.interp(before, time, along)) / span
        for along in (north, east)
    ]
    speed = np.hypot(*velocity)
    known = speed > CLEARLY * speed_sd_m_s
    if not known.any():
        raise LogError(
            f"{samples.name} never moved faster than {float(speed.max()):.2g} m/s, so its course "
            f"is not known; drive faster than {CLEARLY * speed_sd_m_s:.2g} m/s"
        )
    sd = np.hypot(np.degrees(speed_sd_m_s / np.maximum(speed, speed_sd_m_s)), SLIP_DEG)
    course = np.degrees(np.arctan2(velocity[1], velocity[0])) % 360.0
    if samples.heading_deg is not None:
        course = np.where(known, course, samples.heading_deg)
    return samples.with_columns(
        heading_deg=course,
        heading_sd_deg=np.where(known, sd, UNKNOWN_SD_DEG),
        heading_source="the course over ground",
        heading_estimated=False,
    )


TELLS_DEG = 3.0
"""Where readings and calibrated field point apart by less, it cannot be told which one a heading
follows, and it does not matter either."""
NEARER, FOLLOWS_DEG = 0.5, 12.0
"""A heading follows what it scatters about by less than half as much as about the other, and by no
more than a filter does; one in other units or axes follows neither."""
MOST_ROWS = 3_000
"""Rows, evenly spaced, that tell the calibrated field well enough to compare a heading with."""
STRETCH_S, LEAST_ROWS = 20.0, 10
CONTRADICTS = 5.0
"""Standard deviations by which the gyro must disagree within a stretch."""
GYRO_DEG = 2.0
"""What a gyro with a bias of its own and a tilt of a degree drifts in a stretch."""
MANY = 0.2
"""Share of the stretches that may disagree: GPS has its moments."""


def check_heading_source(
    samples: Samples, reference: Reference, calibration: Affine | None = None
) -> Finding | None:
    """The finding that a log's heading cannot teach a calibration; `None` where nothing is against.
    A heading that comes from the magnetometer agrees with the field as it was read, or as the
    autopilot corrected it on board, and not with the calibrated field. One by a filter that has not
    settled turns otherwise than the gyro does."""
    if samples.heading_deg is None or samples.roll_deg is None or samples.pitch_deg is None:
        return None  # the fit says what is missing
    named = samples.heading_source or "the logged heading"
    if (followed := _find_followed(samples, reference, calibration)) is not None:
        what, own, other = followed
        return Finding(
            "heading follows the magnetometer",
            "check",
            f"{named} follows {what}: it scatters by {figure(own)}° about it, and by "
            f"{figure(other)}° about the calibrated field; it was not used",
            "record a heading of another origin: two GPS antennas, a yaw by velocities, the course",
        )
    if (apart := _disagree_with_gyro(samples)) is not None:
        return Finding(
            "heading against the gyro",
            "check",
            f"{named} contradicts the gyro in {100 * apart:.0f} % of the log, so it was not used",
            "record until it has settled (drive a figure of eight), or check its axes and clock",
        )
    return None


def _find_followed(
    samples: Samples, reference: Reference, calibration: Affine | None
) -> tuple[str, float, float] | None:
    """What the heading follows, and how far it scatters about that and the calibrated field."""
    some = np.arange(0, len(samples), -(-len(samples) // MOST_ROWS))
    samples, reference = samples.select(some), reference.select(some)
    assert samples.heading_deg is not None
    assert samples.roll_deg is not None
    assert samples.pitch_deg is not None
    rows = samples.heading_known
    if calibration is None:
        try:
            calibration = fit_channels_alone(samples, reference, CHANNELS["levelled"], Settings())
        except AgonicError:
            return None
    tilt = kernel.tilt_from_angles(samples.roll_deg[rows], samples.pitch_deg[rows])
    logged = samples.heading_deg[rows]
    calibrated = kernel.heading_deg(calibration.correct(samples.field[rows]), tilt)
    other = _scatter_deg(logged - calibrated)
    taken = {"the magnetometer's own readings": samples.field}
    if samples.logged is not None:  # what a compass on board could have taken for the field
        corrected = (samples.field - samples.logged.bias) @ samples.logged.matrix.T
        taken = {"the magnetometer as it was corrected on board": corrected, **taken}
    for what, field in taken.items():
        read = kernel.heading_deg(field[rows], tilt)
        own = _scatter_deg(logged - read)
        if _scatter_deg(read - calibrated) > TELLS_DEG and own < min(NEARER * other, FOLLOWS_DEG):
            return what, own, other
    return None


def _scatter_deg(difference_deg: Array) -> float:
    """The standard deviation of angles about their middle, by the median."""
    middle = np.degrees(np.angle(np.mean(np.exp(1j * np.radians(difference_deg)))))
    left = wrap_deg(difference_deg - middle)
    return float(MAD_TO_SD * median(np.abs(left - median(left))))


def _disagree_with_gyro(samples: Samples) -> float | None:
    """The share of stretches in which the heading turns otherwise than the gyro, if it is large."""
    if samples.time is None or samples.rotation_rate is None:
        return None
    if samples.frame != "b" and samples.heading_source is None:
        return None  # whose axes the gyro has is not known
    assert samples.heading_deg is not None
    assert samples.roll_deg is not None
    assert samples.pitch_deg is not None
    roll, pitch = np.radians(samples.roll_deg), np.radians(samples.pitch_deg)
    _, q, r = samples.rotation_rate.T
    rate = np.degrees(q * np.sin(roll) + r * np.cos(roll)) / np.maximum(np.cos(pitch), 0.1)
    steps = np.diff(samples.time, prepend=samples.time[0])
    turned = np.cumsum(rate * np.minimum(steps, 1.0))
    known = samples.heading_known
    sd = np.zeros(len(turned)) if samples.heading_sd_deg is None else samples.heading_sd_deg
    number = np.floor((samples.time - samples.time[0]) / STRETCH_S)
    bad = [
        _contradicts(samples.heading_deg[own] - turned[own], sd[own], samples.time[own])
        for k in np.unique(number[known])
        if (own := known & (number == k)).sum() >= LEAST_ROWS
    ]
    share = float(np.mean(bad)) if bad else 0.0
    return share if share > MANY else None


def _contradicts(apart_deg: Array, sd_deg: Array, time: Array) -> bool:
    """Whether heading less gyro is no straight line in time, as a gyro's bias would make it."""
    apart = np.unwrap(apart_deg, period=360.0)
    line = np.polynomial.polynomial.polyfit(time - time[0], apart, 1)
    left = apart - np.polynomial.polynomial.polyval(time - time[0], line)
    slope = abs(float(line[1])) * float(time[-1] - time[0])
    allowed = CONTRADICTS * float(np.hypot(median(sd_deg), GYRO_DEG))
    return bool(np.sqrt(np.mean(left**2)) > allowed or slope > CONTRADICTS * 10.0 + allowed)
